"""Flights of the independent model: scipy's eighth-order Runge-Kutta method, restarted at every kink.

Two attitudes: Euler angles, as the interface has them, and a rotation matrix, for flights through theta = +-90 deg.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

from .nominal import Glider, body_to_ned, euler_angle_rates, skew

RTOL, ATOL = 1e-10, 1e-12
Water = Callable[[float], np.ndarray]  # velocity of the water, NED, m/s, at a time


def still(t: float) -> np.ndarray:
    return np.zeros(3)


def _euler_rates(glider: Glider, state: np.ndarray, command: np.ndarray, water: np.ndarray) -> np.ndarray:
    eta, nu, act = state[:6], state[6:12], state[12:15]
    R, act_rate = body_to_ned(*eta[3:]), glider.actuator_speed(act, command)
    turn = euler_angle_rates(eta[3], eta[4], nu[3:])
    return np.concatenate([R @ nu[:3] + water, turn, glider.acceleration(R, nu, act, act_rate), act_rate])


def _matrix_rates(glider: Glider, state: np.ndarray, command: np.ndarray, water: np.ndarray) -> np.ndarray:
    R, nu, act = state[3:12].reshape(3, 3), state[12:18], state[18:21]
    act_rate = glider.actuator_speed(act, command)
    turn = (R @ skew(nu[3:])).ravel()
    return np.concatenate([R @ nu[:3] + water, turn, glider.acceleration(R, nu, act, act_rate), act_rate])


def _fly(rates, glider, start, times, commands, water) -> np.ndarray:
    """States at `times`; the last three of a state are the actuators, each command holds from its time on."""
    states = [np.asarray(start, dtype=float)]
    for begin, end, command in zip(times[:-1], times[1:], commands[:-1], strict=True):
        state = states[-1]
        kinks = [begin + wait for wait in glider.end_of_rate_limit(state[-3:], command)]
        # a kink so close to a row's time that rounding decides on which side it falls needs no restart
        marks = [begin, *(kink for kink in kinks if begin + 1e-9 < kink < end - 1e-9), end]
        for a, b in pairwise(marks):
            flown = solve_ivp(
                lambda t, y, c=command: rates(glider, y, c, water(t)), (a, b), state, "DOP853", rtol=RTOL, atol=ATOL
            )
            if not flown.success:
                raise RuntimeError(f"integration stopped at t = {flown.t[-1]} s: {flown.message}")
            state = flown.y[:, -1]
        states.append(state)
    return np.array(states)


def fly(glider: Glider, start, times, commands, water: Water = still) -> np.ndarray:
    """(n, 15): eta, nu, servo, slider, ballast at `times`, from `start` (15,), commands (n, 3). |theta| < 90 deg."""
    return _fly(_euler_rates, glider, start, times, commands, water)


def fly_matrix(glider: Glider, start, times, commands, water: Water = still) -> np.ndarray:
    """(n, 21): position, R row by row, nu, actuators, through any attitude; `start` as in `fly`."""
    start = np.asarray(start, dtype=float)
    begin = np.concatenate([start[:3], body_to_ned(*start[3:6]).ravel(), start[6:]])
    return _fly(_matrix_rates, glider, begin, times, commands, water)
