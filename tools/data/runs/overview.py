"""What is in runs, a line a column: what a person looks at to see that units and signs are right."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run

UNITS = (("_rad_s", "rad/s"), ("_m_s2", "m/s2"), ("_m_s", "m/s"), ("_1_s", "1/s"), ("_kg_m3", "kg/m3"),
         ("_rad", "rad"), ("_kg", "kg"), ("_m3", "m3"), ("_m", "m"), ("_s", "s"), ("_c", "deg C"))  # fmt: skip


@dataclass(frozen=True)
class Column:
    """A column of all runs that have it."""

    name: str
    unit: str
    smallest: float | None  # None where no sample is there
    largest: float | None
    missing_percent: float


def unit_of(name: str) -> str:
    """The unit of a column, by what its name ends in."""
    return next((unit for ending, unit in UNITS if name.endswith(ending)), "1")


def overview(runs: Sequence[Run]) -> list[Column]:
    """The columns of the runs, in the order of run data."""
    found = []
    for name in names.in_order(list(dict.fromkeys(one for run in runs for one in run.columns))):
        values = np.concatenate([run.columns.get(name, np.full(run.rows, np.nan)) for run in runs])
        seen = values[np.isfinite(values)]
        smallest, largest = (float(seen.min()), float(seen.max())) if seen.size else (None, None)
        found.append(Column(name, unit_of(name), smallest, largest, 100.0 * (1.0 - seen.size / max(len(values), 1))))
    return found


def lines(runs: Sequence[Run]) -> list[str]:
    """The overview as a table, with the seconds of the runs below."""
    table = [f"{'column':<18} {'unit':<6} {'smallest':>11} {'largest':>11} {'missing':>8}"]
    for one in overview(runs):
        ends = ["-" if end is None else f"{end:.4g}" for end in (one.smallest, one.largest)]
        table.append(f"{one.name:<18} {one.unit:<6} {ends[0]:>11} {ends[1]:>11} {one.missing_percent:>6.1f} %")
    lengths = [float(run.t[-1] - run.t[0]) for run in runs]
    each = ", ".join(f"{length:.4g}" for length in lengths[:8]) + (", ..." if len(lengths) > 8 else "")
    return [*table, f"{len(runs)} run{'s' if len(runs) != 1 else ''} of {each} s"]
