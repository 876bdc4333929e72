"""The pitch and depth loops opened at the actuator's command: frequency responses and margins, with exact delays.

Both loops are linear in their gains, L = kp T_p + ki T_i + kd T_d, so the three terms of a loop are worked out once. In
them: the plant with its actuators' lag, the samples' age, the hold of the command, and the observer of depth rate
(core/sensing.track_depth, as its continuous counterpart of the same two poles). The rate of pitch is the gyro's. That
is the loop on samples as they come (estimator = "measured"); the Kalman filter predicts over the samples' age.

The depth loop is opened with the pitch loop closed, ballast fed forward to the slider.
"""

import math
from dataclasses import dataclass

import numpy as np

from glider.firmware.core.vehicle.layout import M_S, X_B
from glider.firmware.model.gains import DepthGains, PitchGains
from glider.sim_backend.board import SimBoardFile
from glider.sim_backend.world import SampledSensor
from glider.tools.study.tuning.linear_plant import Plant

OMEGA = np.geomspace(1e-3, 100.0, 3000)  # rad/s
OUT_PITCH, OUT_PITCH_RATE, OUT_DEPTH, OUT_BALLAST = range(4)  # plant.OUTPUTS


@dataclass(frozen=True)
class Delays:
    """From a quantity to the command it moves, s: the sample's way to the tick and half the time it is held."""

    imu: float
    beacon: float
    plunger: float

    @classmethod
    def of(cls, board: SimBoardFile) -> "Delays":
        tick = 1.0 / board.loop_hz

        def delay(sensor: SampledSensor) -> float:
            period = 1.0 / sensor.rate_hz
            # a tick takes the newest sample that has arrived; that stays in force until the next one, or the next tick
            step = min(period, tick)
            return math.ceil(sensor.delay_s / step - 1e-9) * step + 0.5 * max(period, tick)

        return cls(*(delay(getattr(board.sensors, name)) for name in ("imu", "beacon", "plunger_wire")))


def _held(omega: np.ndarray, delay: float) -> np.ndarray:
    return np.exp(-1j * omega * delay)


def pitch_terms(plant: Plant, delays: Delays, omega: np.ndarray = OMEGA) -> np.ndarray:
    """T_p, T_i, T_d of the pitch loop, shape (3, n): slider (m) by pitch (rad); the slider forward lowers the nose."""
    slider = plant.response(omega)[:, :, 0]
    pitch, rate = -slider[:, OUT_PITCH], -slider[:, OUT_PITCH_RATE]
    return np.array([pitch, pitch / (1j * omega), rate]) * _held(omega, delays.imu)


def depth_terms(
    P: np.ndarray, plant: Plant, delays: Delays, pitch: PitchGains, observer: float, omega: np.ndarray = OMEGA
) -> np.ndarray:
    """T_p, T_i, T_d of the depth loop, shape (3, n): ballast (kg) by depth (m), the observer's bandwidth in rad/s."""
    response, s = plant.response(omega), 1j * omega
    by_pitch = (pitch.kp + pitch.ki / s) * _held(omega, delays.imu)
    by_rate = pitch.kd * _held(omega, delays.imu)
    forward = -P[X_B] / P[M_S] * _held(omega, delays.plunger)

    def asked(column: int) -> np.ndarray:
        """Slider that the pitch loop asks for, for one unit of an input."""
        return by_pitch * response[:, OUT_PITCH, column] + by_rate * response[:, OUT_PITCH_RATE, column]

    slider = (asked(1) + forward * response[:, OUT_BALLAST, 1]) / (1.0 - asked(0))
    depth = (response[:, OUT_DEPTH, 1] + response[:, OUT_DEPTH, 0] * slider) * _held(omega, delays.beacon)
    seen = depth * observer * (2.0 * s + observer) / (s + observer) ** 2
    return np.array([seen, seen / s, depth * observer**2 * s / (s + observer) ** 2])


def open_loop(gains: PitchGains | DepthGains, terms: np.ndarray) -> np.ndarray:
    """L of the terms (3, n), or of those of many trims (trims, 3, n)."""
    return np.tensordot([gains.kp, gains.ki, gains.kd], terms, axes=(0, -2))


@dataclass(frozen=True)
class Margins:
    """How far a loop is from its end. Infinite or nan where the curve never comes by."""

    crossover: float  # rad/s, the fastest |L| = 1
    phase: float  # deg, the smallest at any crossover
    gain: float  # least factor above 1 by which the gain may not grow
    gain_down: float  # greatest factor below 1 by which it may not shrink
    delay: float  # s, the least further delay that may not be added
    peak: float  # greatest |1 / (1 + L)|


def _zeros(values: np.ndarray) -> np.ndarray:
    """Where a curve on the grid passes zero, as fractions of an index."""
    i = np.nonzero(values[:-1] * values[1:] < 0.0)[0]
    return i + values[i] / (values[i] - values[i + 1])


def margins(L: np.ndarray, omega: np.ndarray = OMEGA) -> Margins:
    """Margins of a loop's frequency response L (n,) under negative feedback."""
    size, angle = np.log(np.abs(L)), np.unwrap(np.angle(L))
    index = np.arange(len(omega), dtype=float)
    crossings = _zeros(size)
    crossover = np.exp(np.interp(crossings, index, np.log(omega)))
    phase = np.interp(crossings, index, angle) % (2.0 * math.pi) - math.pi  # distance from -180 deg
    turns = np.arange(math.floor(angle.min() / (2.0 * math.pi)) - 1, math.ceil(angle.max() / (2.0 * math.pi)) + 1)
    straight = np.concatenate([_zeros(angle - (2.0 * turn + 1.0) * math.pi) for turn in turns])
    factors = np.exp(-np.interp(straight, index, size))
    late = np.where(phase > 0.0, phase, phase + 2.0 * math.pi) / crossover
    return Margins(
        crossover=float(crossover.max(initial=0.0)) or math.nan,
        phase=math.degrees(phase[np.argmin(np.abs(phase))]) if len(phase) else math.nan,
        gain=float(factors[factors > 1.0].min(initial=math.inf)),
        gain_down=float(factors[factors < 1.0].max(initial=0.0)),
        delay=float(late.min(initial=math.inf)),
        peak=float((1.0 / np.abs(1.0 + L)).max()),
    )
