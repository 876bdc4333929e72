"""`make demo`: what a user would type: a vehicle with a hidden difference is flown, and the difference found."""

import shutil
import subprocess
import sys
import time
from pathlib import Path

OUT = Path("out/demo")
HIDDEN = "drag:scale=0.4"
FLIGHTS = ("1", "2", "3")

STEPS: tuple[tuple[str, tuple[tuple[str, ...], ...]], ...] = (
    (
        "Three flights of a vehicle that drags 40 % more than its file says, and nobody is told",
        tuple(
            ("fly", "--mission", "spiral", "--seed", seed, "--effect", HIDDEN, "--log", f"flight{seed}.mcap")
            for seed in FLIGHTS
        ),
    ),
    (
        "Their logs as run data",
        (("log", "export", *(f"flight{seed}.mcap" for seed in FLIGHTS), "--out", "flights"),),
    ),
    (
        "The gap: root mean square errors of the nominal model, in tolerances",
        (("gap", "measure", "flights", "--report", "gap.html"),),
    ),
    (
        "The diagnosis: where the model is wrong, which effect causes it, how far the gap shrinks",
        (("gap", "diagnose", "flights", "--out", "diagnosis"),),
    ),
)


def main() -> int:
    """Run the steps in OUT; returns the exit code of the first that fails, else 0."""
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    begin = time.monotonic()
    for number, (title, commands) in enumerate(STEPS, start=1):
        print(f"\n{number}. {title}", flush=True)
        for command in commands:
            print(f"   $ glider {' '.join(command)}", flush=True)
            done = subprocess.run([sys.executable, "-m", "tools.cli.main", *command], cwd=OUT)
            if done.returncode:
                return done.returncode
    print(f"\nHidden was {HIDDEN}. The report: {OUT / 'diagnosis' / 'report.html'} (any browser, no network)")
    print(f"{time.monotonic() - begin:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
