"""`make demo`: what a user would type: flights of a vehicle with a hidden effect, and the effect found.

The flights are a blind test of one case (docs/CHALLENGE.md): another plant than the model, with one effect that the
seed draws. The answer is opened after the diagnosis. The first time, the diagnosis' kernels are compiled on a second
core while the flights are made.
"""

import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from firmware.core.jit import CACHE_DIR
from firmware.core.vehicle.layout import X_NU, X_POS, X_QUAT
from tools.data.runs import columns as names
from tools.data.runs.case import Case, load_case, write_case
from tools.data.runs.run import Run
from tools.diagnose.diagnosis import diagnose
from tools.inference.model import effect_vector
from tools.inference.problem import problem_of
from tools.study.challenge.seal import ARCHIVE, open_answers

OUT = Path("out/demo")
CASE = "case000"

STEPS = (  # what is done, and the command
    ("Flights of a vehicle with one effect that its file does not know; which one is sealed",
     "gap challenge make --out blind --seed 6 --single 1 --none 0 --pairs 0 --unknown 0"),
    ("The gap: root mean square errors of the nominal model, in tolerances",
     f"gap measure blind/cases/{CASE} --report gap.html"),
    ("The diagnosis: where the model is wrong, which effect causes it, how far the gap shrinks",
     f"gap diagnose blind/cases/{CASE} --out diagnosis"),
)  # fmt: skip


AHEAD = "ahead"  # the argument with which this file compiles
ROWS = 300  # of a run that is made up, at 10 Hz


def made_up(folder: Path, runs: list[Run]) -> Case:
    """A case of these runs, written into a folder and read back."""
    write_case(folder, runs, vehicle="roughie", site="nowhere", log_rate_hz=10.0, water_density_kg_m3=998.0)
    return load_case(folder)


def compile_ahead() -> None:
    """Compile what a diagnosis calls, by one of two short flights of the nominal vehicle: a dive and a climb."""
    onboard = (*names.ATTITUDE, *names.RATES, names.DEPTH, *names.DRAW_WIRES)
    columns: dict[str, np.ndarray] = {name: np.zeros(ROWS) for name in (*names.COMMANDS, *onboard)}
    columns[names.TIME] = 0.1 * np.arange(ROWS)
    columns[names.COMMANDS[2]] = np.where(columns[names.TIME] < 15.0, 0.1, -0.1)
    with tempfile.TemporaryDirectory() as folder:
        problem = problem_of(made_up(Path(folder, "blank"), [Run(name, None, columns) for name in ("run00", "run01")]))
        starts = problem.starts.copy()
        starts[:, X_POS + 2], starts[:, X_QUAT], starts[:, X_NU] = 1.0, 1.0, 0.2
        P, F = problem.model.P, effect_vector(problem.model)
        Z = problem.simulated(P, F, starts, np.random.default_rng(1))
        for run, flown in zip(problem.runs, np.split(Z, 2), strict=True):
            run.columns.update(zip(onboard, flown.T, strict=False))
        diagnose(made_up(Path(folder, "flown"), problem.runs))


def main() -> int:
    """Run the steps in OUT; returns the exit code of the first that fails, else 0."""
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    begin, ahead = time.monotonic(), None
    if CACHE_DIR is not None and not any(CACHE_DIR.rglob("*.nbc")):
        print("The first time, kernels are compiled on the way: about a minute of what follows.", flush=True)
        ahead = subprocess.Popen([sys.executable, "-m", "tools.measure.demo", AHEAD], stderr=subprocess.DEVNULL)
    for number, (title, command) in enumerate(STEPS, start=1):
        print(f"\n{number}. {title}\n   $ glider {command}", flush=True)
        done = subprocess.run([sys.executable, "-m", "tools.cli.main", *command.split()], cwd=OUT)
        if done.returncode:
            return done.returncode
        if ahead is not None:
            ahead.wait()
    hidden = open_answers(OUT / "blind" / ARCHIVE).cases[CASE]["labels"]
    print(f"\nThe sealed answer: {', '.join(hidden)}. The report: {OUT / 'diagnosis' / 'report.html'} (opens offline)")
    print(f"{time.monotonic() - begin:.0f} s")
    return 0


if __name__ == "__main__":
    if sys.argv[1:] == [AHEAD]:
        compile_ahead()
    else:
        sys.exit(main())
