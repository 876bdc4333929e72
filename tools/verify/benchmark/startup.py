"""How long a person waits before the first word; as a program, gets ready to fly, ticks once and says so."""

import shutil
import subprocess
import sys
from pathlib import Path

from glider.tools.verify.benchmark.registry import Settings
from glider.tools.verify.benchmark.tick import harness
from glider.tools.verify.benchmark.timing import median, process_seconds, seconds


def glider_command() -> list[str]:
    """The installed `glider` of this interpreter; without one, the module behind it."""
    beside = shutil.which("glider", path=str(Path(sys.executable).parent))
    return [beside] if beside else [sys.executable, "-m", "glider.tools.cli.main"]


def _first_tick() -> None:
    """Start a process that gets ready to fly, and wait until it has ticked once."""
    command = [sys.executable, "-m", "glider.tools.verify.benchmark.startup"]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        if process.stdout.readline() != b"ticked\n":
            raise RuntimeError("the flying process did not get to its first tick")


def measure(settings: Settings) -> dict[str, float]:
    """help_s: `glider --help`, the whole process; first_tick_s: from its start to the first tick; medians, wall time.

    The kernels are compiled and cached before; the log is being written when the tick comes.
    """
    command = [*glider_command(), "--help"]
    process_seconds(command)  # the first one fetches files from disk
    _first_tick()
    return {
        "help_s": median([process_seconds(command) for _ in range(2 * settings.repeats + 1)]),
        "first_tick_s": median([seconds(_first_tick) for _ in range(settings.repeats)]),
    }


if __name__ == "__main__":
    with harness() as flown:
        flown.runtime.tick()
        print("ticked", flush=True)
