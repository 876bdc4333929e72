"""The kernels of a diagnosis compiled ahead (tools/flight/precompile): two short flights are made up, measured and
diagnosed.

Those that follow models, which take the longest, are compiled by a process of their own meanwhile.
"""

import contextlib
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numba.core import event

from glider.firmware.core.jit import kernel_count
from glider.firmware.core.vehicle.layout import X_NU, X_POS, X_QUAT
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import Case, load_case, write_case
from glider.tools.data.runs.run import Run
from glider.tools.diagnose.diagnosis import diagnose
from glider.tools.flight.precompile import Compiled, Progress, Work
from glider.tools.gap.assess import assess
from glider.tools.inference.model import effect_vector
from glider.tools.inference.problem import Gains, Problem, problem_of

ROWS = 300  # of a run that is made up, at 10 Hz
ONBOARD = (*names.ATTITUDE, *names.RATES, names.DEPTH, *names.DRAW_WIRES)


def _case(folder: Path, runs: list[Run]) -> Case:
    """A case of these runs, written into a folder and read back."""
    write_case(folder, runs, vehicle="roughie", site="nowhere", log_rate_hz=10.0, water_density_kg_m3=998.0)
    return load_case(folder)


FOLLOW = "follow"  # the argument with which this file only follows models


def _blank(folder: Path) -> Problem:
    """Two runs of a dive and a climb, in which nothing was measured."""
    columns: dict[str, np.ndarray] = {name: np.zeros(ROWS) for name in (*names.COMMANDS, *ONBOARD)}
    columns[names.TIME] = 0.1 * np.arange(ROWS)
    columns[names.COMMANDS[2]] = np.where(columns[names.TIME] < 15.0, 0.1, -0.1)
    problem = problem_of(_case(Path(folder, "blank"), [Run(name, None, columns) for name in ("run00", "run01")]))
    problem.starts[:, X_POS + 2], problem.starts[:, X_QUAT], problem.starts[:, X_NU] = 1.0, 1.0, 0.2
    return problem


def _follow_a_moment() -> None:
    """Follow a model with gains that correct nothing."""
    with tempfile.TemporaryDirectory() as folder:
        problem = _blank(Path(folder))
        (rows, width), runs = problem.z.shape, len(problem.runs)
        gains = Gains(
            problem.z, problem.stamps, np.zeros((rows, width, width)),
            np.zeros((rows, problem.spreads.shape[1], width)), np.zeros((rows, problem.kind.n_state)),
            np.zeros((rows, problem.kind.n_path)), np.zeros((rows, width)), np.zeros(runs), problem.starts,
        )  # fmt: skip
        problem.follow([(problem.model.P, effect_vector(problem.model))], gains)


def _diagnose_a_moment() -> None:
    """Diagnose two short flights of the nominal vehicle."""
    # The lines that count kernels go to `wait_for`; a command's own standard output is its result's alone.
    counted = None if __name__ == "__main__" else subprocess.DEVNULL
    following = subprocess.Popen([sys.executable, "-m", "glider.tools.diagnose.precompile", FOLLOW], stdout=counted)
    with tempfile.TemporaryDirectory() as folder:
        problem = _blank(Path(folder))
        P, F = problem.model.P, effect_vector(problem.model)
        Z = problem.simulated(P, F, problem.starts.copy(), np.random.default_rng(1))
        for run, flown in zip(problem.runs, np.split(Z, 2), strict=True):
            run.columns.update(zip(ONBOARD, flown.T, strict=False))
        case = _case(Path(folder, "flown"), problem.runs)
        problem_of(case).filter(P, F, begin=True)
        following.wait()
        assess(case)
        diagnose(case)


EXPECTED = 2 * kernel_count()  # about as many as two processes compile, each of them those that are imported here
DIAGNOSIS = Work("diagnosis", kernel_count, _diagnose_a_moment)


def compile_aside() -> subprocess.Popen[bytes] | None:
    """A process that compiles what a diagnosis calls; None where that is compiled already. `wait_for` ends it."""
    stamp = DIAGNOSIS.stamp()
    if stamp is None or stamp.exists():
        return None
    return subprocess.Popen([sys.executable, "-m", "glider.tools.diagnose.precompile"], stdout=subprocess.PIPE)


def wait_for(process: subprocess.Popen[bytes], progress: Progress) -> int:
    """Wait for `compile_aside`, showing how many kernels are compiled; its exit code."""
    assert process.stdout is not None
    with progress("compiling what a diagnosis calls", EXPECTED) as advance, process.stdout as compiled:
        for _ in compiled:
            advance(1)
    return process.wait()


def _say_one(n: int) -> None:
    """Write a line for a kernel that is compiled, to `wait_for`."""
    with contextlib.suppress(OSError):  # nobody waits any more
        print(flush=True)


if __name__ == "__main__":
    if sys.argv[1:] == [FOLLOW]:
        with event.install_listener("numba:compile", Compiled(_say_one)):
            _follow_a_moment()
    else:
        DIAGNOSIS.compile(_say_one)
