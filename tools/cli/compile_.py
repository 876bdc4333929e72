"""`glider compile`: every kernel compiled ahead."""

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

    aside = None
    if find_spec("scipy"):
        from glider.tools.diagnose.precompile import compile_aside, wait_for

        aside = compile_aside()
    ensure_compiled(FLIGHT, say, progress)
    if aside is not None and wait_for(aside, progress):
        fail("glider: the kernels of a diagnosis were not compiled")
    if as_json:
        print_json(FLIGHT.compile())
    else:
        say(f"kernels: {CACHE_DIR or 'plain Python (GLIDER_JIT=0)'}")
