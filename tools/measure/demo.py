"""`make demo`: what a user would type, typed for them: fly, export, measure the gap of a hidden difference."""

import shutil
import subprocess
import sys
from pathlib import Path

OUT = Path("out/demo")
HIDDEN = ("--effect", "drag:scale=0.4", "--effect", "net_buoyancy:mass=0.015")

STEPS: tuple[tuple[str, tuple[tuple[str, ...], ...]], ...] = (
    (
        "A mission on the simulated board, under the real runtime (the first time, its kernels are compiled)",
        (("fly", "--mission", "sawtooth", "--seed", "1", "--log", "sawtooth.mcap"),),
    ),
    (
        "Two more: the vehicle as its file says, and one that drags 40 % more and is 15 g heavy, which nobody is told",
        (
            ("fly", "--mission", "spiral", "--seed", "2", "--log", "honest.mcap"),
            ("fly", "--mission", "spiral", "--seed", "3", "--log", "hidden.mcap", *HIDDEN),
        ),
    ),
    (
        "Their logs as run data",
        (("log", "export", "honest.mcap", "--out", "honest"), ("log", "export", "hidden.mcap", "--out", "hidden")),
    ),
    (
        "The gap: each window flown again by the nominal model from its start, against what was measured",
        (("gap", "measure", "honest"), ("gap", "measure", "hidden")),
    ),
)


def main() -> int:
    """Run the steps in OUT; returns the exit code of the first that fails, else 0."""
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    for number, (title, commands) in enumerate(STEPS, start=1):
        print(f"\n{number}. {title}", flush=True)
        for command in commands:
            print(f"   $ glider {' '.join(command)}", flush=True)
            done = subprocess.run([sys.executable, "-m", "tools.cli.main", *command], cwd=OUT)
            if done.returncode:
                return done.returncode
    pages = ", ".join(str(OUT / name) for name in ("honest-gap.html", "hidden-gap.html"))
    print(f"\nPictures of measured against predicted flights: {pages} (any browser, no network needed)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
