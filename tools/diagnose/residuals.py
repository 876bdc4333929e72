"""Whether anything is left: tests on whitened innovations, which the true model leaves white and of unit variance.

Each test is a number of standard deviations, normal under the true model; the largest of them is judged against how
many there are (Bonferroni). Spectrum and correlations are taken run by run and pooled, gaps in the data count as 0.
"""

import itertools

import numpy as np
from scipy.special import ndtr, ndtri

from glider.firmware.core.vehicle.layout import X_ACT, X_BALLAST, X_DOWN, X_NU, X_QUAT, X_SERVO, X_SLIDER
from glider.tools.diagnose.record import FindingRecord
from glider.tools.inference.hyperparameters import DIAGNOSIS
from glider.tools.inference.problem import Gains, Problem

LAGS = ((1, 2), (3, 10), (11, 60))  # samples, in groups
SHAPES = ("variance", "mean", "lag", "spectrum")  # tests of a channel by itself; the others are correlations
FEATURE_UNITS = {
    "speed": "m/s", "depth": "m", "time": "s", "pitch": "rad", "pitch rate": "rad/s", "roll rate": "rad/s",
    "yaw rate": "rad/s", "angle of attack": "rad", "sideslip": "rad", "servo": "rad", "slider": "m", "ballast": "kg",
    "pump running": "", "pump expelling": "",
}  # fmt: skip
SMOOTHED_SECONDS = 2.0  # over which something is averaged, to find where it is largest


def features(problem: Problem, gains: Gains) -> dict[str, np.ndarray]:
    """What something left may go with, each (rows,) in FEATURE_UNITS, by the best model's state."""
    x = gains.X
    speed = np.sqrt((x[:, X_NU : X_NU + 3] ** 2).sum(axis=1))
    moving = pump_speed(problem, gains)
    q0, q1, q2, q3 = x[:, X_QUAT:X_NU].T
    pitch = np.arcsin(np.clip(2.0 * (q0 * q2 - q3 * q1), -1.0, 1.0))
    _, v, w, p, q, r = x[:, X_NU:X_ACT].T
    return {
        "speed": speed, "depth": x[:, X_DOWN], "time": problem.since, "pitch": pitch, "pitch rate": q, "roll rate": p,
        "yaw rate": r, "angle of attack": w / np.maximum(speed, 0.05), "sideslip": v / np.maximum(speed, 0.05),
        "servo": x[:, X_SERVO], "slider": x[:, X_SLIDER], "ballast": x[:, X_BALLAST],
        "pump running": (np.abs(moving) > 0.003).astype(float), "pump expelling": (moving < -0.003).astype(float),
    }  # fmt: skip


def smoothed(values: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Values (rows,) averaged over SMOOTHED_SECONDS about each sample at t (rows,)."""
    width = int(SMOOTHED_SECONDS / max(float(np.median(np.diff(t))), 1e-3)) if len(t) > 1 else 1
    width = min(max(width, 1), len(values))
    return np.convolve(values, np.full(width, 1.0 / width), mode="same")


def pump_speed(problem: Problem, gains: Gains) -> np.ndarray:
    """Speed of the ballast, kg/s, where the filter stands, (rows,)."""
    speed = np.zeros(len(gains.X))
    for a, b in itertools.pairwise(problem.recording.bounds):
        if b - a > 1:
            speed[a:b] = np.gradient(gains.X[a:b, X_BALLAST], problem.recording.t[a:b])
    return speed


def tests(problem: Problem, gains: Gains) -> list[FindingRecord]:
    """Every test of every channel, the strongest first."""
    found = []
    E = gains.E
    bounds = problem.recording.bounds
    with_what = features(problem, gains)
    for m, channel in enumerate(reading.name for reading in problem.kind.readings):
        e = E[:, m]
        ok = np.isfinite(e)
        count = int(ok.sum())
        if count < 100:
            continue
        filled = np.where(ok, e, 0.0)
        found.append(FindingRecord(channel, "variance", float(((filled**2).sum() - count) / np.sqrt(2.0 * count))))
        # mean of each run: N(0, 1) each
        means = [filled[a:b].sum() / np.sqrt(max(1, ok[a:b].sum())) for a, b in itertools.pairwise(bounds)]
        found.append(FindingRecord(channel, "mean", chi(np.array(means))))
        for low, high in LAGS:
            z = np.array([lagged(filled, ok, bounds, lag) for lag in range(low, high + 1)])
            found.append(FindingRecord(channel, f"lag {low}-{high}", chi(z)))
        found.append(FindingRecord(channel, "spectrum", peak(filled, bounds)))
        for name, values in with_what.items():
            found.append(FindingRecord(channel, name, goes_with(filled, ok, values, bounds)))
    return sorted(found, key=lambda f: -abs(f.sigma))


def chi(z: np.ndarray) -> float:
    """A sum of squared normals as one normal deviate (Wilson and Hilferty)."""
    k = len(z)
    return float((np.cbrt((z**2).sum() / k) - (1.0 - 2.0 / (9.0 * k))) / np.sqrt(2.0 / (9.0 * k)))


def lagged(e: np.ndarray, ok: np.ndarray, bounds: np.ndarray, lag: int) -> float:
    """Correlation with itself `lag` samples before, within runs, as a normal deviate."""
    total, pairs = 0.0, 0
    for a, b in itertools.pairwise(bounds):
        if b - a > lag:
            total += float(e[a + lag : b] @ e[a : b - lag])
            pairs += int((ok[a + lag : b] & ok[a : b - lag]).sum())
    return total / np.sqrt(max(1, pairs))


def peak(e: np.ndarray, bounds: np.ndarray) -> float:
    """The highest line of the periodogram of all runs, as a normal deviate of the same probability (Fisher)."""
    highest, lines = 0.0, 0
    for a, b in itertools.pairwise(bounds):
        power = np.abs(np.fft.rfft(e[a:b])[1:]) ** 2 / max(1.0, float((e[a:b] ** 2).sum()))
        highest, lines = max(highest, float(power.max(initial=0.0))), lines + len(power)
    chance = -np.expm1(lines * np.log1p(-np.exp(-min(highest, 700.0)))) if highest < 700.0 else 0.0
    return -float(ndtri(min(max(chance, 1e-300), 1.0 - 1e-12)))


def goes_with(e: np.ndarray, ok: np.ndarray, values: np.ndarray, bounds: np.ndarray) -> float:
    """Correlation with a feature, each run's means taken off, as a normal deviate."""
    total, weight = 0.0, 0.0
    for a, b in itertools.pairwise(bounds):
        part = values[a:b][ok[a:b]]
        if len(part) < 2:
            continue
        part = part - part.mean()
        total += float(e[a:b][ok[a:b]] @ part)
        weight += float(part @ part)
    return total / np.sqrt(weight) if weight > 1e-12 else 0.0


def worst(found: list[FindingRecord]) -> float:
    """The strongest finding, corrected for how many were looked at: normal under the true model."""
    if not found:
        return 0.0
    chance = 2.0 * ndtr(-max(abs(f.sigma) for f in found)) * len(found)
    return -float(ndtri(min(max(chance, 1e-300), 1.0 - 1e-9)))


def strongest_left(findings: list[FindingRecord]) -> tuple[FindingRecord | None, FindingRecord | None]:
    """The strongest finding, and the strongest that is a correlation, in the same channel if that has one.

    None where they are too weak.
    """
    strong = [f for f in findings if abs(f.sigma) >= DIAGNOSIS.residual_sigma]
    if not strong:
        return None, None
    correlated = sorted(
        (f for f in strong if not f.test.startswith(SHAPES)),
        key=lambda f: (f.channel != strong[0].channel, -abs(f.sigma)),
    )
    return strong[0], correlated[0] if correlated else None
