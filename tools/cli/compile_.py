"""`glider compile`: every kernel compiled ahead."""

import subprocess
import sys
from importlib.util import find_spec

import click

from glider.tools.cli.common import fail, json_option, print_json, progress, say


@click.command("compile")
@json_option
def compile_(as_json: bool) -> None:
    """Compile every kernel of a flight, and of a diagnosis where that is installed; `make setup` does so.

    Once for a version of the code: later starts load them.
    """
    from glider.firmware.core.jit import CACHE_DIR
    from glider.tools.flight.precompile import FLIGHT, ensure_compiled

    diagnosis = _compile_diagnosis()
    ensure_compiled(FLIGHT, say, progress)
    if diagnosis is not None and diagnosis.wait():
        fail("glider: the kernels of a diagnosis were not compiled")
    if as_json:
        print_json(FLIGHT.compile())
    else:
        say(f"kernels: {CACHE_DIR or 'plain Python (GLIDER_JIT=0)'}")


def _compile_diagnosis() -> subprocess.Popen[bytes] | None:
    """A process that compiles what a diagnosis calls, beside the flight's; None where it is there, or not installed."""
    if not find_spec("scipy"):
        return None
    from glider.tools.diagnose.precompile import DIAGNOSIS

    stamp = DIAGNOSIS.stamp()
    if stamp is None or stamp.exists():
        return None
    return subprocess.Popen([sys.executable, "-m", "glider.tools.diagnose.precompile"])
