"""The runs of a case as one table, and what the attitude says of body rates.

Increments of the attitude between two samples are turned into a rotation vector in body axes and summed up, so that the
noise of the attitude does not grow with time; rates are integrated by the trapezoidal rule. Where a sample is missing
the sums stop (NaN) and go on from 0: a piece of them is known up to a constant, which every block has of its own.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run
from glider.tools.readings.regression import blocks_of

LONGEST_STEP = 0.5  # s between two samples that are still integrated over


@dataclass(frozen=True)
class SignalTable:
    """All runs behind each other: `t` (rows,) s from each run's start, `run` its number, `columns` by name."""

    names: tuple[str, ...]  # of the runs
    t: np.ndarray
    run: np.ndarray
    columns: dict[str, np.ndarray]
    flying: np.ndarray  # (rows,) bool

    def has(self, *wanted: str) -> bool:
        """Whether all of these columns hold anything."""
        return all(name in self.columns and np.isfinite(self.columns[name]).any() for name in wanted)

    @property
    def block(self) -> np.ndarray:
        """Blocks for the covariances, (rows,)."""
        return blocks_of(self.t, self.run)

    @property
    def period(self) -> float:
        """Median time between samples, s."""
        step = np.diff(self.t)[np.diff(self.run) == 0]
        return float(np.median(step)) if len(step) else 1.0

    def flown(self, values: np.ndarray) -> np.ndarray:
        """Values where the vehicle flies, NaN elsewhere."""
        return np.where(self.flying if values.ndim == 1 else self.flying[:, None], values, np.nan)


def table_of(runs: list[Run], flying: list[np.ndarray] | None = None) -> SignalTable:
    """The runs as a table; a column that a run lacks is NaN there. `flying` holds a bool per row and run."""
    known = [name for name in names.ALL if name != names.TIME and any(name in run.columns for run in runs)]
    columns = {
        name: np.concatenate([run.columns.get(name, np.full(run.rows, np.nan)) for run in runs]) for name in known
    }
    t = np.concatenate([run.t - run.t[0] for run in runs])
    number = np.repeat(np.arange(len(runs)), [run.rows for run in runs])
    flies = np.ones(len(t), dtype=bool) if flying is None else np.concatenate(flying)
    return SignalTable(tuple(run.name for run in runs), t, number, columns, flies)


def steps(table: SignalTable) -> np.ndarray:
    """Time to the row before, (rows,) s; NaN at a run's first row and over a gap."""
    dt = np.diff(table.t, prepend=np.nan)
    dt[np.flatnonzero(np.diff(table.run)) + 1] = np.nan
    dt[0] = np.nan
    return np.where(dt <= LONGEST_STEP, dt, np.nan)


def unwrapped(angle: np.ndarray, run: np.ndarray) -> np.ndarray:
    """An angle (rows,) without jumps of 2 pi, missing samples left out, run by run."""
    out = angle.copy()
    for n in np.unique(run):
        here = (run == n) & np.isfinite(angle)
        out[here] = np.unwrap(angle[here])
    return out


def body_increments(attitude: np.ndarray) -> np.ndarray:
    """Rotation from each row to the next in body axes, (rows, 3) rad, row 0 NaN; attitude (rows, 3) ZYX angles, rad.

    Rotation vectors of q_before* q_after: exact for a rotation about a fixed axis, to third order otherwise.
    """
    half = 0.5 * attitude
    (cf, ct, cp), (sf, st, sp) = np.cos(half).T, np.sin(half).T
    q = np.column_stack([
        cf * ct * cp + sf * st * sp, sf * ct * cp - cf * st * sp, cf * st * cp + sf * ct * sp,
        cf * ct * sp - sf * st * cp,
    ])  # fmt: skip
    a, b = q[:-1], q[1:]
    scalar = (a * b).sum(axis=1)
    vector = np.column_stack([
        a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] - a[:, 2] * b[:, 3] + a[:, 3] * b[:, 2],
        a[:, 0] * b[:, 2] - a[:, 2] * b[:, 0] - a[:, 3] * b[:, 1] + a[:, 1] * b[:, 3],
        a[:, 0] * b[:, 3] - a[:, 3] * b[:, 0] - a[:, 1] * b[:, 2] + a[:, 2] * b[:, 1],
    ])  # fmt: skip
    vector *= np.where(scalar < 0.0, -1.0, 1.0)[:, None]
    length = np.linalg.norm(vector, axis=1)
    angle = 2.0 * np.arctan2(length, np.abs(scalar))
    ratio = np.where(length > 1e-9, angle / np.maximum(length, 1e-12), 2.0)
    return np.vstack([np.full((1, 3), np.nan), vector * ratio[:, None]])


def summed(increments: np.ndarray, usable: np.ndarray) -> np.ndarray:
    """Running sums of increments (rows, k) over pieces without a gap; NaN where a row cannot be reached."""
    good = usable & np.isfinite(increments).all(axis=1)
    total = np.cumsum(np.where(good[:, None], increments, 0.0), axis=0)
    return np.where(good[:, None], total, np.nan)


def pieces(usable: np.ndarray) -> np.ndarray:
    """Number of the unbroken piece each row belongs to, (rows,)."""
    return np.cumsum(~usable)


class Rates:
    """Rates (rows, k) of a table, their integral, and both some time before each row. Prepared once for many delays."""

    def __init__(self, table: SignalTable, rates: np.ndarray):
        self.table, self.values = table, rates
        middle = 0.5 * (rates + np.vstack([np.full((1, rates.shape[1]), np.nan), rates[:-1]]))
        self.increments = middle * steps(table)[:, None]
        ends = np.searchsorted(table.run, np.arange(len(table.names) + 1))
        self._runs = [self._past(slice(begin, end)) for begin, end in pairwise(ends) if end > begin]

    def _past(self, here: slice) -> tuple:
        """A run: rows, times, integral, where an increment is unknown (1.0), each rate's samples that are there."""
        t, increments, rates = self.table.t[here], self.increments[here], self.values[here]
        holes = (~np.isfinite(increments).all(axis=1)).astype(float)
        known = [np.isfinite(column) for column in rates.T]
        samples = [(t[good], column[good]) for good, column in zip(known, rates.T, strict=True)]
        return here, t, np.cumsum(np.nan_to_num(increments), axis=0), holes, samples

    def integrated(self, delay: float = 0.0) -> np.ndarray:
        """Increments of the integral up to `delay` s before each row, (rows, k); NaN over gaps."""
        if delay == 0.0:
            return self.increments
        moved = np.full_like(self.increments, np.nan)
        for here, t, total, holes, _ in self._runs:
            then = t - delay
            inside = (then >= t[0]) & (then <= t[-1])
            # A missing rate near the moment itself leaves the increment unknown.
            known = inside & (np.interp(then, t, holes) == 0.0)
            known[0] = False
            known[1:] &= inside[:-1]
            of_run = moved[here]
            for axis in range(total.shape[1]):
                of_run[1:, axis] = np.diff(np.interp(then, t, total[:, axis]))
            of_run[~known] = np.nan
        return moved

    def shifted(self, delay: float) -> np.ndarray:
        """The rates `delay` s before each row, (rows, k), interpolated over missing samples; 0 where there are none."""
        if delay == 0.0:
            return np.nan_to_num(self.values)
        out = np.zeros_like(self.values)
        for here, t, _, _, samples in self._runs:
            for axis, (times, values) in enumerate(samples):
                if len(times):
                    out[here, axis] = np.interp(t - delay, times, values)
        return out
