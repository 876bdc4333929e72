"""The kernels of a diagnosis compiled ahead (tools/flight/precompile): by one of two short flights that are made up."""

import tempfile
from pathlib import Path

import numpy as np

from firmware.core.jit import kernel_count
from firmware.core.vehicle.layout import X_NU, X_POS, X_QUAT
from tools.data.runs import columns as names
from tools.data.runs.case import Case, load_case, write_case
from tools.data.runs.run import Run
from tools.diagnose.diagnosis import diagnose
from tools.flight.precompile import Work
from tools.inference.model import effect_vector
from tools.inference.problem import problem_of

ROWS = 300  # of a run that is made up, at 10 Hz


def _case(folder: Path, runs: list[Run]) -> Case:
    """A case of these runs, written into a folder and read back."""
    write_case(folder, runs, vehicle="roughie", site="nowhere", log_rate_hz=10.0, water_density_kg_m3=998.0)
    return load_case(folder)


def _diagnose_a_moment() -> None:
    """Diagnose two short flights of the nominal vehicle: a dive and a climb."""
    onboard = (*names.ATTITUDE, *names.RATES, names.DEPTH, *names.DRAW_WIRES)
    columns: dict[str, np.ndarray] = {name: np.zeros(ROWS) for name in (*names.COMMANDS, *onboard)}
    columns[names.TIME] = 0.1 * np.arange(ROWS)
    columns[names.COMMANDS[2]] = np.where(columns[names.TIME] < 15.0, 0.1, -0.1)
    with tempfile.TemporaryDirectory() as folder:
        problem = problem_of(_case(Path(folder, "blank"), [Run(name, None, columns) for name in ("run00", "run01")]))
        starts = problem.starts.copy()
        starts[:, X_POS + 2], starts[:, X_QUAT], starts[:, X_NU] = 1.0, 1.0, 0.2
        P, F = problem.model.P, effect_vector(problem.model)
        Z = problem.simulated(P, F, starts, np.random.default_rng(1))
        for run, flown in zip(problem.runs, np.split(Z, 2), strict=True):
            run.columns.update(zip(onboard, flown.T, strict=False))
        diagnose(_case(Path(folder, "flown"), problem.runs))


DIAGNOSIS = Work("diagnosis", kernel_count, _diagnose_a_moment)

if __name__ == "__main__":
    DIAGNOSIS.compile()
