"""The margin of k2 over what is left of (29), before anything flies, by a vehicle's [uncertainty] and [disturbance].

Looked for in glides of every pitch the law may be sent to, at the speeds such vehicles have;
docs/explanation/control.md.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from glider.firmware.core.control.control import pitch_feedforward
from glider.firmware.core.control.error_bound import model_error_bound
from glider.firmware.core.control.input_forms import exact_form
from glider.firmware.core.control.law import k2_to_cover
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.mass import roll_pendulum_moment
from glider.firmware.model.estimator_settings import parameter_sigma
from glider.firmware.model.gains import Control, LawGains
from glider.firmware.model.vehicle import Vehicle

PITCHES = tuple(math.radians(angle) for angle in (-45.0, -30.0, -15.0, 0.0, 15.0, 30.0, 45.0))
SPEEDS = (0.2, 0.35, 0.5)  # m/s
ATTACK = math.radians(4.0)  # lift against net weight: above the path in a climb, below it in a dive
BALLAST_SHARE = 0.75  # of the tank's range, heavy where the nose is down


@dataclass(frozen=True)
class K2Margin:
    """One axis: the k2 that is set, the largest that the glides ask for at one sigma and at three, its unit."""

    axis: str
    unit: str
    k2: float
    asked: float
    asked_3_sigma: float

    @property
    def covered(self) -> bool:
        """True where k2 covers one sigma of everything, all at its worst together."""
        return self.k2 >= self.asked

    def __str__(self) -> str:
        k2, unit, word = self.k2, self.unit, "covered" if self.covered else "NOT covered"
        return (
            f"k2 of {self.axis} {k2:g} {unit}, (29) asks {self.asked:.2g} {unit} "
            f"({self.asked_3_sigma:.2g} at 3 sigma): {word}, margin {k2 - self.asked:+.2g} {unit}"
        )


def glides(P: np.ndarray) -> Iterator[tuple[tuple, tuple]]:
    """k, nu and actuators of each glide, and the actuators' speeds: at rest."""
    sr = roll_pendulum_moment(P)
    for pitch in PITCHES:
        end = P[layout.BALLAST_MAX] if pitch < 0.0 else P[layout.BALLAST_MIN]
        ballast = BALLAST_SHARE * end if pitch else 0.0
        slider = pitch_feedforward(
            sr, P[layout.M_S], P[layout.X_B], pitch, ballast, P[layout.SLIDER_MIN], P[layout.SLIDER_MAX]
        )
        attack = -math.copysign(ATTACK, pitch) if pitch else 0.0
        for speed in SPEEDS:
            nu = (speed * math.cos(attack), 0.0, speed * math.sin(attack), 0.0, 0.0, 0.0)
            yield (-math.sin(pitch), 0.0, math.cos(pitch), *nu), (0.0, slider, ballast, 0.0, 0.0, 0.0)


def k2_asked(vehicle: Vehicle, eps: tuple[float, float], sigmas: float) -> np.ndarray:
    """Largest k2 of pitch (m) and depth (kg) over the glides, shape (2,); inf where no k2 covers `sigmas` of it all."""
    P, scratch = vehicle.vector(), np.empty(layout.N_P)
    spread = sigmas * parameter_sigma(P, vehicle.uncertainty)
    disturbance = sigmas * vehicle.disturbance.angular, sigmas * vehicle.disturbance.linear
    asked = np.zeros(2)
    for flow, actuators in glides(P):
        _, _, g_ts, _, _, g_zb = exact_form(P, *flow, *actuators)
        off = model_error_bound(P, spread, scratch, *flow, *actuators)
        k2 = [k2_to_cover(*numbers) for numbers in zip(off, disturbance, (g_ts, g_zb), eps, strict=True)]
        asked = np.maximum(asked, k2)
    return asked


def k2_margins(vehicle: Vehicle, control: Control) -> tuple[K2Margin, K2Margin]:
    """Pitch and depth of a vehicle under the law of `control`."""
    tables: tuple[LawGains, LawGains] = (control.law_flown.pitch, control.law_flown.depth)
    eps = (tables[0].eps, tables[1].eps)
    one, three = (k2_asked(vehicle, eps, sigmas) for sigmas in (1.0, 3.0))
    pitch, depth = (
        K2Margin(axis, unit, gains.k2, float(one[i]), float(three[i]))
        for i, (axis, unit, gains) in enumerate(zip(("pitch", "depth"), ("m", "kg"), tables, strict=True))
    )
    return pitch, depth
