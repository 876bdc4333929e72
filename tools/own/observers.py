"""Which observer a vehicle has, and the rows of runs that it sees."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glider.tools.own.black_box import BlackBox
from glider.tools.own.load import LoadedVehicle
from glider.tools.own.observer import Observer
from glider.tools.own.operating_points import with_operating_points
from glider.tools.own.runs import OwnRun

LEAST_STEP = 0.1  # s between rows
ROUNDING = 0.01  # of that, in the times of rows


def observer_of(vehicle: LoadedVehicle, runs: Sequence[OwnRun], every_row: bool = False) -> Observer:
    """The observer of a vehicle's model over runs: on rows LEAST_STEP apart at least, or on every row."""
    chosen = (
        list(runs)
        if every_row
        else [thinned(run, [one.interpolated for one in vehicle.declared.inputs]) for run in runs]
    )
    vehicle = replace(vehicle, declared=with_operating_points(vehicle.declared, chosen))
    return (Observer if vehicle.level else BlackBox)(vehicle, chosen)


def thinned(run: OwnRun, interpolated: Sequence[bool] = ()) -> OwnRun:
    """A run that was logged faster than its motion needs: of every output a reading each LEAST_STEP, where it was read.

    Of rows so close together those are kept that have most outputs, until every output that was read is there: sensors
    that report on rows of their own all stay, at their times. An input that is held is the mean of the rows that a row
    stands for; of one that is interpolated (by input; none is) stays the value at the row.
    """
    interval = max(float(np.median(np.diff(run.t))), 1e-9)
    step = max(1, round(LEAST_STEP / interval))
    if step == 1:
        return run
    together = np.floor((run.t - run.t[0]) / (step * interval) + ROUNDING).astype(int)
    read, kept = np.isfinite(run.outputs), list[int]()
    for rows in np.split(np.arange(len(run.t)), np.flatnonzero(np.diff(together)) + 1):
        missing, chosen = read[rows].any(axis=0), list[int]()
        while missing.any():
            best = int(rows[np.argmax((read[rows] & missing).sum(axis=1))])
            chosen.append(best)
            missing = missing & ~read[best]
        kept += sorted(chosen) or [int(rows[0])]
    inputs = run.inputs[kept]
    held = [n for n in range(inputs.shape[1]) if n >= len(interpolated) or not interpolated[n]]
    rows = np.diff([*kept, len(run.t)])[:, None]
    inputs[:, held] = np.add.reduceat(run.inputs[:, held], kept, axis=0) / rows
    return replace(run, t=run.t[kept], inputs=inputs, outputs=run.outputs[kept])
