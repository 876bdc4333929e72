"""`make demo`: what a user would type: flights of a vehicle with a hidden effect, and the effect found.

The flights are a blind test of one case (docs/explanation/blind-tests.md): another plant than the model, with one
effect that the
seed draws. The answer is opened after the diagnosis. The first time, the diagnosis' kernels are compiled on a second
core while the flights are made.
"""

import shutil
import subprocess
import sys
import time
from pathlib import Path

from glider.tools.cli.common import progress
from glider.tools.diagnose.precompile import compile_aside, wait_for
from glider.tools.verify.challenge.seal import ARCHIVE, open_answers

OUT_FOLDER = Path("out/demo")
CASE = "case000"

STEPS = (  # what is done, and the command
    ("Flights of a vehicle with one effect that its file does not know; which one is sealed",
     "gap challenge make --out blind --seed 6 --single 1 --none 0 --pairs 0 --unknown 0"),
    ("The gap: root mean square errors of the nominal model, in tolerances",
     f"gap measure blind/cases/{CASE} --report gap.html"),
    ("The diagnosis: where the model is wrong, which effect causes it, how far the gap shrinks",
     f"gap diagnose blind/cases/{CASE} --out diagnosis"),
)  # fmt: skip


def main() -> int:
    """Run the steps in OUT; returns the exit code of the first that fails, else 0."""
    shutil.rmtree(OUT_FOLDER, ignore_errors=True)
    OUT_FOLDER.mkdir(parents=True)
    begin, ahead = time.monotonic(), compile_aside()
    if ahead is not None:
        print("The first time, kernels are compiled on the way: 1 to 4 minutes of what follows.", flush=True)
    for number, (title, command) in enumerate(STEPS, start=1):
        print(f"\n{number}. {title}\n   $ glider {command}", flush=True)
        done = subprocess.run([sys.executable, "-m", "glider.tools.cli.main", *command.split()], cwd=OUT_FOLDER)
        if done.returncode:
            return done.returncode
        if ahead is not None:
            wait_for(ahead, progress)
            ahead = None
    hidden = open_answers(OUT_FOLDER / "blind" / ARCHIVE).cases[CASE]["labels"]
    report = OUT_FOLDER / "diagnosis" / "report.html"
    print(f"\nThe sealed answer: {', '.join(hidden)}. The report: {report} (opens offline)")
    print(f"{time.monotonic() - begin:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
