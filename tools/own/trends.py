"""Value and rate of a recorded output at a time, from readings before it and shortly after: a local linear trend.

The rate wanders as white acceleration makes it; how much, and how far the noise is the file's, is what the run's
readings have most likely. A Kalman filter runs over them, a smoother back to the time that is asked for (Harvey 1989,
Forecasting, Structural Time Series Models and the Kalman Filter, 2.3.2, 3.6.2).
"""

import itertools
from dataclasses import dataclass

import numpy as np

ACCELERATIONS = np.geomspace(1e-4, 1e4, 17)  # variance of the rate's change over a second, in noises a second squared
NOISES = np.array([0.1, 0.3, 1.0, 3.0])  # of the file's sigma
UNKNOWN_RATE = 100.0  # noises a second, 1 sigma of the first rate


@dataclass(frozen=True)
class Trend:
    """Readings of one output in a run, filtered."""

    t: np.ndarray  # (readings,) s
    mean: np.ndarray  # (readings, 2) value and rate, by the readings until each
    covariance: np.ndarray  # (readings, 2, 2)
    power: float  # of the acceleration: variance of the rate's change over a second

    def at(self, when: float, until: float) -> tuple[np.ndarray, np.ndarray]:
        """Value and rate (2,) at a time, by the readings until a later one, and their covariance (2, 2); NaN: none."""
        last = int(np.searchsorted(self.t, until, side="right")) - 1
        if last < 0:
            return np.full(2, np.nan), np.full((2, 2), np.nan)
        first = min(max(int(np.searchsorted(self.t, when, side="right")) - 1, 0), last)
        F, Q = _moved(when - self.t[first], self.power)
        if when < self.t[first]:  # before the first reading
            x, P = self.at(self.t[first], until)
            return F @ x, F @ P @ F.T + Q
        steps = [(self.t[k], self.mean[k], self.covariance[k]) for k in range(first, last + 1)]
        steps.insert(1, (when, F @ steps[0][1], F @ steps[0][2] @ F.T + Q))
        t, x, P = steps.pop()
        while t > when:
            later, x_later, P_later = t, x, P
            t, x, P = steps.pop()
            F, Q = _moved(later - t, self.power)
            ahead = F @ P @ F.T + Q
            G = np.linalg.solve(ahead, F @ P).T
            x, P = x + G @ (x_later - F @ x), P + G @ (P_later - ahead) @ G.T
        return x, P


def trend_of(t: np.ndarray, y: np.ndarray, sigma: float, angle: bool) -> Trend:
    """The trend of an output y (rows,; NaN: not read) at t (rows,) s; sigma: its noise, as the file has it."""
    seen = np.flatnonzero(np.isfinite(y))
    if len(seen) == 0:
        return Trend(np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2, 2)), 1.0)
    R, q = np.repeat(NOISES, len(ACCELERATIONS)) ** 2, np.tile(ACCELERATIONS, len(NOISES))
    x, v = np.full(len(R), y[seen[0]] / sigma), np.zeros(len(R))
    P, C, D = R.copy(), np.zeros(len(R)), np.full(len(R), UNKNOWN_RATE**2)  # of value, both, rate
    every, cost = np.empty((len(seen), 5, len(R))), np.zeros(len(R))
    every[0] = x, v, P, C, D
    for n, (before, row) in enumerate(itertools.pairwise(seen), start=1):
        dt = t[row] - t[before]
        x = x + dt * v
        P, C, D = P + 2.0 * dt * C + dt**2 * D + q * dt**3 / 3.0, C + dt * D + q * dt**2 / 2.0, D + q * dt
        innovation = y[row] / sigma - x
        if angle:
            turn = 2.0 * np.pi / sigma
            innovation -= turn * np.round(innovation / turn)
        S = P + R
        cost += innovation**2 / S + np.log(S)
        x, v = x + P / S * innovation, v + C / S * innovation
        P, C, D = P - P * P / S, C - P * C / S, D - C * C / S
        every[n] = x, v, P, C, D
    best = int(np.argmin(cost))
    x, v, P, C, D = every[:, :, best].T
    covariance = sigma**2 * np.array([[P, C], [C, D]]).transpose(2, 0, 1)
    return Trend(t[seen], sigma * np.column_stack([x, v]), covariance, float(q[best]) * sigma**2)


def _moved(dt: float, power: float) -> tuple[np.ndarray, np.ndarray]:
    """Transition (2, 2) of value and rate over a time, and the covariance (2, 2) that acceleration adds."""
    own = abs(dt)
    return np.array([[1.0, dt], [0.0, 1.0]]), power * np.array([[own**3 / 3.0, dt * own / 2.0], [dt * own / 2.0, own]])
