"""Ocean gliders as a kind of vehicle: attitude and buoyancy engine measured, depth predicted.

See docs/explanation/ocean.md.
"""

import itertools
from collections.abc import Collection
from math import radians

import numpy as np

from glider.sim_backend.ocean.catalogue import ODDS, ONE_ON_DEPTH, catalogue
from glider.sim_backend.ocean.core import layout as at
from glider.tools.data.runs import columns as names
from glider.tools.inference.channels import DEGREES, Channel, Measures
from glider.tools.inference.core.ocean import (
    filter_runs,
    fly_followed,
    fly_windows,
    follow_runs,
    read_rows,
    simulate_runs,
)
from glider.tools.inference.hyperparameters import WATCH
from glider.tools.inference.kind import Kind, Reading
from glider.tools.inference.ocean_inputs import input_table, regime

FIRST_SPEED = 0.2  # m/s
MIN_READING_INTERVAL_S = 29.0  # s at least between readings that are looked at

# 10 minutes are several times what vertical water remembers. A depth rate that is wrong by 1 cm/s is off by 3.1 m rms
# over the 9 minutes that are predicted, half a tolerance. What changes has to be 8 mm/s of it, what creeps 12: seasons,
# a cell that drifts and a little growth did 9 mm/s in 20 days of an open mission (docs/explanation/ocean.md, Windows).
OCEAN_MEASURES = Measures(
    channels=(
        Channel("depth", (at.Y_DEPTH,), 6.0, unit="m"),
        Channel("roll", (at.Y_ROLL,), radians(3.0), unit="deg", scale=DEGREES),
        Channel("speed", (at.Y_SPEED,), 0.03, unit="m/s"),
        Channel("velocity", (at.Y_NORTH, at.Y_EAST), 0.05, unit="m/s"),
    ),
    columns=(names.DEPTH, names.ATTITUDE[0], names.SPEED, *names.VELOCITY),
    instead=(None,) * at.N_Y,
    window=600.0,
    look_in=60.0,
)


def _first_state(first: np.ndarray) -> np.ndarray:
    """State (N_X,) at the first readings."""
    x = np.zeros(at.N_X)
    x[at.X_DEPTH], x[at.X_SPEED] = first[at.Y_DEPTH], FIRST_SPEED
    return x


def _unread(t: np.ndarray, bounds: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    """Readings that are not looked at, (rows, N_Y): of rows that are not steady all but the depth, and all in between.

    Over a few seconds a vehicle pitches, and its density lags: every reading would be asked for what no flight model
    means to know.
    """
    found = np.repeat(inputs[:, [at.U_UNSTEADY]] > 0.0, at.N_Y, axis=1)
    found[:, at.Y_DEPTH] = False
    for a, b in itertools.pairwise(bounds):
        last = -np.inf
        for i in range(a, b):
            if t[i] - last < MIN_READING_INTERVAL_S:
                found[i] = True
            else:
                last = t[i]
    return found


def _one_group(seen: Collection[str]) -> tuple[str, ...]:
    """Labels that are one without a measured speed."""
    return () if {"speed", "north"} & set(seen) else ONE_ON_DEPTH


OCEAN = Kind(
    name="ocean",
    measures=OCEAN_MEASURES,
    catalogue=catalogue,
    readings=(
        Reading("depth", names.DEPTH, "depth"),
        Reading("roll", names.ATTITUDE[0], "roll"),
        Reading("speed", names.SPEED, "speed", at.F_SPEED_BIAS),
        Reading("north", names.VELOCITY[0], "velocity"),
        Reading("east", names.VELOCITY[1], "velocity"),
    ),
    inputs=(),
    doubled=(),
    n_state=at.N_X,
    n_error=at.N_ERR,
    n_spectral=at.N_SPECTRAL,
    n_path=2,
    speed=at.X_SPEED,
    speed_errors=slice(at.X_SPEED, at.X_SPEED + 1),
    actuator_errors=slice(0, 0),
    accelerations=slice(0, at.N_SPECTRAL),
    actuator_walks=slice(0, 0),
    disturbance=("walk", "water_rate", "roll_rate", "speed"),
    hold=1.0,
    walks=(),
    inflated_walks=(),
    first_state=_first_state,
    spread=(2.0, 0.1, 0.01, 0.3),
    speeds=(),
    window_speeds=(),
    window_speed_spread=(0.1,),
    model_error_sd=(),
    drift=(0.0,),
    filter_runs=filter_runs,
    follow_runs=follow_runs,
    fly_windows=fly_windows,
    fly_followed=fly_followed,
    read_rows=read_rows,
    simulate_runs=simulate_runs,
    input_table=input_table,
    unread=_unread,
    form_share=WATCH.ocean_form_share,
    odds=ODDS,
    regime=regime,
    one_group=_one_group,
    learned_runs=WATCH.ocean_reference_runs,
    material_growth=WATCH.ocean_growth,
    material=WATCH.ocean_material,
    form=WATCH.ocean_form_error,
)
