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


def observer_of(vehicle: LoadedVehicle, runs: Sequence[OwnRun], every_row: bool = False) -> Observer:
    """The observer of a vehicle's model over runs: on rows LEAST_STEP apart at least, or on every row."""
    chosen = list(runs) if every_row else [thinned(run) for run in runs]
    vehicle = replace(vehicle, declared=with_operating_points(vehicle.declared, chosen))
    return (Observer if vehicle.level else BlackBox)(vehicle, chosen)


def thinned(run: OwnRun) -> OwnRun:
    """Every so many-th row of a run that was logged faster than its motion needs."""
    step = max(1, round(LEAST_STEP / max(float(np.median(np.diff(run.t))), 1e-9)))
    return run if step == 1 else replace(run, t=run.t[::step], inputs=run.inputs[::step], outputs=run.outputs[::step])
