"""Where each unmodelled effect stands in the effect vector F, and what the state has beside the plant's.

F of zeros is the nominal vehicle. A label of the catalogue sets one or more entries; entries go together in any number.
The names of the first entries (ef.DRAG_0 and so on) are those that the catalogue's rows give them
(sim_backend/core/effects/catalogue), where units and meanings stand.
"""

from glider.firmware.core.vehicle.layout import N_X
from glider.sim_backend.core.effects.catalogue import ENTRIES

globals().update({name: number for number, name in enumerate(ENTRIES)})


def __getattr__(name: str) -> int:
    """For readers of types only: a name that no row has is an error."""
    raise AttributeError(f"no entry {name} in the effect vector: no row of the catalogue names it")


# --- F: what is in it beside the catalogue's entries ----------------------------------------------------------------
# allowed: a constant error of each onboard reading, in the order of y below
BIAS = len(ENTRIES)
N_BIASES = 9
# m/kg: a pressure gauge vented into the hull reads the hull's pressure, too, which goes with the water in the tank
GAUGE_TANK = BIAS + N_BIASES
# a data-driven correction (tools/diagnose/correction): the link at which it enters, and its coefficients
LINK, SHAPE = GAUGE_TANK + 1, GAUGE_TANK + 2  # SHAPE and behind it in the link's unit
ACTUATOR_LINKS = 9  # links 1-6: X Y Z K M N (N, N m); 7-9: servo, slider, ballast; then the readings
SHAPES = (
    "constant", "speed squared", "depth", "angle of attack", "sideslip", "roll rate", "pitch rate", "yaw rate",
    "pump running", "time", "climb or dive",
)  # fmt: skip
N_SHAPES = 11
N_F = SHAPE + N_SHAPES

# --- x: behind the plant's state, what effects remember --------------------------------------------------------------
X_GEAR_SERVO, X_GEAR_SLIDER = N_X, N_X + 1  # behind the backlash: rad, m
X_LAG = N_X + 2  # roll, pitch, yaw, depth: how far the reading is behind, rad, m
X_LAG_DEPTH = X_LAG + 3
X_LATE = N_X + 6  # s; motion capture behind its delay, as the diagnosis models it: constant
N_XF = N_X + 7

# --- y: what is read ------------------------------------------------------------------------------------------------
Y_ROLL, Y_PITCH, Y_YAW, Y_P, Y_Q, Y_R, Y_DEPTH, Y_SLIDER, Y_BALLAST = 0, 1, 2, 3, 4, 5, 6, 7, 8
Y_ONBOARD = 9
Y_MOCAP_X, Y_MOCAP_Y, Y_MOCAP_Z, Y_MOCAP_ROLL, Y_MOCAP_PITCH, Y_MOCAP_YAW = 9, 10, 11, 12, 13, 14
N_Y = 15

TAIL, TAIL_TOP = -0.5, 0.06  # m, body x and above the axis: where a line is tied at the tail
REST_PITCH = 0.05  # rad, about level, over which a climb becomes a dive
