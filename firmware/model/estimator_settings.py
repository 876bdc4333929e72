"""The estimator's settings for a vehicle: spectral densities, variances and spreads out of the vehicle file."""

import numpy as np

from glider.firmware.core.layouts import estimator_layout as kf
from glider.firmware.core.vehicle import layout
from glider.firmware.model.vehicle import COEFFICIENTS, DisturbanceTable, SensorsTable, UncertaintyTable

# Errors of parameters stay, but the accelerations they cause turn with the flight: with each dive, climb or turn.
ERROR_TIME = 10.0  # s
# Nothing in a vehicle file says how far actuators are from their model: a tenth of the way they go in a second, and
# what keeps the filter listening to the draw-wires while they stand still.
SPEED_ERROR = 0.1  # share of the speed, over 1 s
SERVO_WALK, SLIDER_WALK, BALLAST_WALK = 0.002, 0.0002, 0.0003  # rad, m, kg, each per square root of a second
UNSEEN_SERVO_WALK = 0.2  # rad per square root of a second: a servo turns where the pilot wants, unannounced

# 1 sigma before the first measurement
POSITION_SPREAD, ATTITUDE_SPREAD = 1.0, 0.3  # m, rad, about the first readings
SPEED_SPREAD = (0.05, 0.02, 0.02)  # m/s
RATE_SPREAD = 0.2  # rad/s
SERVO_SPREAD, SLIDER_SPREAD, BALLAST_SPREAD = 0.005, 0.001, 0.002  # rad, m, kg, about 0 and the first readings
UNKNOWN_SPREAD = 0.5  # share of an actuator's range, where neither command nor reading says where it is


def parameter_sigma(P: np.ndarray, uncertainty: UncertaintyTable) -> np.ndarray:
    """1 sigma of every parameter, absolute, shape (layout.N_P,), from [uncertainty]; 0 where it names none."""
    sigma = np.zeros(layout.N_P)
    for name in COEFFICIENTS:
        index = getattr(layout, name.upper())
        sigma[index] = uncertainty.K * abs(P[index])
    for index in (layout.M_T, layout.M_R, layout.M_S):
        sigma[index] = uncertainty.mass * P[index]
    for index in (layout.A_Y, layout.A_Z, layout.B_Y, layout.B_Z):
        sigma[index] = uncertainty.added * P[index]
    for index in (layout.X_B, layout.R_R, layout.R_S):
        sigma[index] = uncertainty.length * abs(P[index])
    sigma[layout.NET_MASS] = uncertainty.net_mass
    sigma[layout.CG_X : layout.CG_Z + 1] = uncertainty.cg
    return sigma


def estimator_settings(sensors: SensorsTable, disturbance: DisturbanceTable, mode: int = 0) -> np.ndarray:
    """The settings vector of core/estimation/estimator, shape (N_S,); `mode` says which actuators are not commanded."""
    S = np.zeros(kf.N_S)
    S[kf.S_LINEAR] = disturbance.linear**2 * kf.DISTURBANCE_HOLD
    S[kf.S_ANGULAR] = disturbance.angular**2 * kf.DISTURBANCE_HOLD
    S[kf.S_SERVO] = (UNSEEN_SERVO_WALK if mode & kf.SERVO_DRIVEN else SERVO_WALK) ** 2
    S[kf.S_SLIDER] = SLIDER_WALK**2
    S[kf.S_BALLAST] = BALLAST_WALK**2
    S[kf.S_SPEED_ERROR] = SPEED_ERROR**2
    S[kf.S_ERROR_TIME] = ERROR_TIME
    S[kf.S_WALK : kf.S_R] = [walk**2 for _, count, _, walk, _ in kf.WANDERING for _ in range(count)]
    S[kf.S_SLIDER_BIAS] = sensors.slider.bias**2
    S[kf.S_BALLAST_BIAS] = sensors.ballast.bias**2
    noise = (
        *3 * (sensors.attitude,), *3 * (sensors.gyro,), sensors.depth, sensors.slider, sensors.ballast,
        *3 * (sensors.mocap_position,), *3 * (sensors.mocap_attitude,),
    )  # fmt: skip
    # A file may say a sensor has no noise; a filter must not believe that.
    S[kf.S_R :] = [max(sensor.noise, 1e-6) ** 2 for sensor in noise]
    return S


def first_spread(P: np.ndarray, mode: int, seen: tuple[bool, bool, bool]) -> np.ndarray:
    """1 sigma before the first measurement, shape (N_E,); `seen`: servo, slider, ballast have a known start."""
    ranges = [P[layout.SERVO_MAX + 4 * i] - P[layout.SERVO_MIN + 4 * i] for i in range(3)]
    known = (SERVO_SPREAD, SLIDER_SPREAD, BALLAST_SPREAD)
    actuators = [known[i] if seen[i] else UNKNOWN_SPREAD * ranges[i] for i in range(3)]
    if mode & kf.SERVO_DRIVEN:
        actuators[0] = max(actuators[0], 0.1)
    moving = [*3 * [POSITION_SPREAD], *3 * [ATTITUDE_SPREAD], *SPEED_SPREAD, *3 * [RATE_SPREAD], *actuators]
    wandering = [spread for _, count, spread, _, _ in kf.WANDERING for _ in range(count)]
    return np.array([*moving, *6 * [0.0], *wandering])
