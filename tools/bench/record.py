"""What the bench recorded, as run data: a case folder that every other command reads."""

import math
from pathlib import Path

import numpy as np

from glider.tools.bench.worker import ROW
from glider.tools.data.errors import InputError
from glider.tools.data.runs import case
from glider.tools.data.runs.run import Run


def table(rows: list[list[float | None]]) -> np.ndarray:
    """Rows as numbers, missing ones NaN, time from 0, (n, columns of ROW)."""
    data = np.array([[math.nan if value is None else value for value in row] for row in rows], dtype=float)
    data = data.reshape(-1, len(ROW))
    if len(data):
        data[:, 0] -= data[0, 0]
    return data


def free_folder(base: Path, name: str) -> Path:
    """The first of name-001, name-002, ... that is not there."""
    for number in range(1, 10_000):
        folder = base / f"{name}-{number:03d}"
        if not folder.exists():
            return folder
    raise InputError(f"no number left for {name}-NNN", source=base)


def write_case(folder: Path, data: np.ndarray, vehicle: str, site: str = "bench") -> Path:
    """A case of one run; the run's path. Columns that nothing was recorded in are left out."""
    rate = 1.0 / float(np.median(np.diff(data[:, 0]))) if len(data) > 2 else 100.0
    columns = {name: values for name, values in zip(ROW, data.T, strict=True) if np.isfinite(values).any()}
    (run,) = case.write_case(
        folder, [Run("run00", None, columns)], vehicle=vehicle, site=site, log_rate_hz=round(rate, 1),
        water_density_kg_m3=998.2, motion_capture=False,
    )  # fmt: skip
    return run
