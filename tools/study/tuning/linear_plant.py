"""The plant linearised about steady glides: what a loop's margins are worked out from.

In the vertical plane a glide has the states [Z, theta, u, w, q, slider, ballast]; roll, yaw and sway stay zero there
and do not act back in the first order. Differences of the nominal flight's own derivative, so that no equation is
written twice; the actuators' lag is in it, their limits in rate and range are not.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import fsolve

from glider.firmware.core.maths.rotations import quaternion_from_euler
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.flight import nominal_derivative
from glider.firmware.core.vehicle.mass import roll_pendulum_moment
from glider.tools.data.errors import InputError

LIN_DEPTH, LIN_PITCH, LIN_U, LIN_W, LIN_Q, LIN_SLIDER, LIN_BALLAST = range(7)
OUTPUTS = ("pitch", "pitch_rate", "depth", "ballast")  # rad, rad/s, m, kg
# the same states in x; pitch has no place of its own there and is put in as a quaternion
_PLACES = (2, None, layout.X_NU, layout.X_NU + 2, layout.X_NU + 4, layout.X_ACT + 1, layout.X_ACT + 2)
_STEP = 1e-5  # SI; truncation and rounding both far below what a margin needs


@dataclass(frozen=True)
class Trim:
    """A steady glide: pitch (rad) and ballast (kg); both zero is the vehicle at rest."""

    pitch: float
    ballast: float

    @property
    def name(self) -> str:
        if self.ballast == 0.0:
            return "rest"
        return f"{'dive' if self.ballast > 0.0 else 'climb'} {math.degrees(self.pitch):+.0f} deg"


def _glide(degrees: float) -> Trim:
    return Trim(math.radians(degrees), -math.copysign(0.1, degrees))


# The glides that the rule tunes about, and the others that its margins are stated at: the paper's pitch targets, and
# the vehicle at rest, where every manoeuvre begins and a change of depth ends.
DESIGN_TRIMS = (_glide(-20.0), _glide(20.0))
OTHER_TRIMS = (Trim(0.0, 0.0), *(_glide(degrees) for degrees in (-10.0, 10.0, -30.0, 30.0, -45.0, 45.0)))


@dataclass(frozen=True)
class Plant:
    """dx/dt = A x + B u, y = C x about a trim; u = slider and ballast commands (m, kg), y as in OUTPUTS."""

    trim: Trim
    A: np.ndarray  # (7, 7)
    B: np.ndarray  # (7, 2)
    C: np.ndarray  # (4, 7)

    def response(self, omega: np.ndarray) -> np.ndarray:
        """Frequency response at omega (n,) in rad/s, shape (n, 4, 2)."""
        s = 1j * omega[:, None, None] * np.eye(len(self.A))
        return self.C @ np.linalg.solve(s - self.A, np.broadcast_to(self.B, (len(omega), *self.B.shape)))


def derivative(P: np.ndarray, state: np.ndarray, slider_cmd: float, ballast_cmd: float) -> np.ndarray:
    """d/dt of the seven states (7,), from the nominal flight's kernel in still water."""
    x, out = np.zeros(layout.N_X), np.zeros(layout.N_X)
    x[layout.X_QUAT : layout.X_QUAT + 4] = quaternion_from_euler(0.0, float(state[LIN_PITCH]), 0.0)
    for value, place in zip(state, _PLACES, strict=True):
        if place is not None:
            x[place] = value
    nominal_derivative(P, x, 0.0, slider_cmd, ballast_cmd, 0.0, 0.0, 0.0, out)
    # at roll = 0 pitch turns by q alone
    return np.array([state[LIN_Q] if place is None else out[place] for place in _PLACES])


def steady_glide(P: np.ndarray, trim: Trim) -> np.ndarray:
    """The seven states (7,) of a glide in which nothing changes but depth; InputError where the vehicle has none."""
    state = np.zeros(7)
    state[LIN_PITCH], state[LIN_BALLAST] = trim.pitch, trim.ballast
    if trim.ballast == 0.0 and trim.pitch == 0.0:
        return state

    def unrest(unknown: np.ndarray) -> np.ndarray:
        state[LIN_U], state[LIN_W], state[LIN_SLIDER] = unknown
        return derivative(P, state, state[LIN_SLIDER], trim.ballast)[[LIN_U, LIN_W, LIN_Q]]

    # slow, a little along the flow, the slider where gravity alone holds the pitch
    sr = roll_pendulum_moment(P)
    slider = -(sr * math.tan(trim.pitch) + trim.ballast * P[layout.X_B]) / P[layout.M_S]
    found, _, good, _ = fsolve(unrest, [0.3, 0.03 * math.copysign(1.0, trim.ballast), slider], full_output=True)
    unrest(found)
    if good != 1 or state[LIN_U] <= 0.0 or not P[layout.SLIDER_MIN] <= state[LIN_SLIDER] <= P[layout.SLIDER_MAX]:
        raise InputError(f"no steady glide at {trim.name}, ballast {trim.ballast:+g} kg: nothing to tune about")
    return state


def linearise(P: np.ndarray, trim: Trim) -> Plant:
    """The plant of a parameter vector P (N_P,) about a trim, by central differences."""
    state = steady_glide(P, trim)
    commands = state[[LIN_SLIDER, LIN_BALLAST]]
    A, B = np.zeros((7, 7)), np.zeros((7, 2))
    for column, step in enumerate(_STEP * np.eye(7)):
        A[:, column] = derivative(P, state + step, *commands) - derivative(P, state - step, *commands)
    for column, step in enumerate(_STEP * np.eye(2)):
        B[:, column] = derivative(P, state, *(commands + step)) - derivative(P, state, *(commands - step))
    C = np.zeros((len(OUTPUTS), 7))
    for row, place in enumerate((LIN_PITCH, LIN_Q, LIN_DEPTH, LIN_BALLAST)):
        C[row, place] = 1.0
    return Plant(trim, A / (2.0 * _STEP), B / (2.0 * _STEP), C)
