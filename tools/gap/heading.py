"""Does the current turn with the glider's heading? Then it is the model's error (docs/explanation/ocean.md, Heading).

Between two fixes at the surface a glider moves by what it swims and what the water moves. What the model's velocity
leaves of that, over the time, is the current. A speed that is too small by a share of it leaves a current that turns
with the heading; a compass that reads turned leaves one across it. The water's own does neither:

    c_i = C(t_i) + share s_i + turned J s_i,    s_i the mean velocity through the water of leg i, J a quarter turn

C is a mean, an Ornstein-Uhlenbeck process and white noise, north and east apart and alike. Its size, time and share of
white noise are integrated out over a grid (Jeffreys' prior for the size), so that intervals hold what a few legs leave
open (Kitanidis 1986, universal kriging with uncertain covariance).
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.data.errors import MissingExtra, need
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.origin import FIXES_FILE, Origin, read_fixes, read_origins
from glider.tools.data.runs.run import Run
from glider.tools.inference.hyperparameters import GAP

WET_M = 5.0  # deeper than this it dives: pressure at the surface is off by up to 3 m
COVERED = 0.8  # share of the time between two fixes that has to be logged in dives
MIN_LEGS = 8  # legs, for four numbers and the size of the current
AXIS, FLATTENING = 6378137.0, 1.0 / 298.257223563  # WGS84
TIMES_H = (3.0, 6.0, 12.0, 24.0, 48.0, 96.0, 192.0, 384.0)  # in which a current decorrelates
WHITE = (0.02, 0.1, 0.25, 0.5, 0.75, 0.98)  # share of its variance that is of one leg alone


@dataclass
class HeadingLeg:
    """From fix to fix."""

    hours: float  # of its middle, since 1970-01-01 UTC
    seconds: float
    over_ground: np.ndarray  # (2,) north, east, m
    through_water: np.ndarray  # (2,) by the model


@dataclass
class Posterior:
    """One coefficient: Student distributions about means with scales and weights, each (K,), of one `freedom`."""

    means: np.ndarray
    scales: np.ndarray
    weights: np.ndarray
    freedom: int

    def below(self, x: float) -> float:
        """Probability of less than x."""
        from scipy.special import stdtr

        return float(self.weights @ stdtr(self.freedom, (x - self.means) / self.scales))

    def quantile(self, p: float) -> float:
        """Where a share p lies below."""
        from scipy.optimize import brentq
        from scipy.special import stdtrit

        ends = self.means + np.outer([stdtrit(self.freedom, p)], self.scales)
        low, high = float(ends.min()) - 1e-9, float(ends.max()) + 1e-9
        return float(brentq(lambda x: self.below(x) - p, low, high))


def heading_test(folder: Path, runs: Sequence[Run], speeds: Sequence[tuple[np.ndarray, np.ndarray]]) -> dict[str, Any]:
    """What a case's fixes say of its velocities (vn, ve by row, m/s, of each run); `why` where they say nothing.

    `along_m_s` is what the speed lacks along the heading, `across_m_s` what points to starboard of it, at the mean
    speed, each with `ci90`; `turned_rad` the latter as an angle of the compass, + to starboard. InputError where
    `fixes.csv` or `origin.csv` cannot be used.
    """
    found = read_fixes(folder)
    if found is None:
        return {"legs": 0, "why": f"no {FIXES_FILE} beside the runs: no position at the surface"}
    legs, left_out = legs_between(found, read_origins(folder, runs), runs, speeds)
    said: dict[str, Any] = {"legs": len(legs), "left_out": left_out}
    if len(legs) < MIN_LEGS:
        return said | {"why": f"{len(legs)} dives from fix to fix, of {MIN_LEGS} at least"}
    if np.linalg.matrix_rank(_design(legs)) < 4:
        return said | {"why": "all dives on one heading"}
    try:
        need("analysis")
    except MissingExtra as missing:  # velocities do without
        return said | {"why": str(missing)}
    share, turned = coefficients(legs)
    speed = float(np.mean([np.linalg.norm(leg.through_water) / leg.seconds for leg in legs]))
    said |= {"speed_m_s": speed}
    for name, one in (("along", share), ("across", turned)):
        said |= {f"{name}_m_s": speed * one.quantile(0.5)}
        said |= {f"{name}_ci90": [speed * one.quantile(p) for p in (0.05, 0.95)]}
    said |= {"turned_rad": turned.quantile(0.5), "turned_ci90": [turned.quantile(p) for p in (0.05, 0.95)]}
    return said | {"says": _sentence(said, share, turned)}


def coefficients(legs: Sequence[HeadingLeg]) -> tuple[Posterior, Posterior]:
    """Share of the speed that is missing, and angle (rad) that the heading is turned by; of MIN_LEGS at least."""
    t = np.array([leg.hours for leg in legs])
    X = _design(legs)
    current = np.concatenate([(leg.over_ground - leg.through_water) / leg.seconds for leg in legs])
    current = current.reshape(-1, 2).T.ravel()
    freedom = len(current) - X.shape[1]
    apart = np.abs(t[:, None] - t[None, :])
    weights, means, scales = [], [], []
    for time in TIMES_H:
        for white in WHITE:
            L = np.linalg.cholesky((1.0 - white) * np.exp(-apart / time) + white * np.eye(len(legs)))
            whitened = [np.linalg.solve(L, part) for part in np.split(np.column_stack([X, current]), 2)]
            A, y = np.vstack(whitened)[:, :-1], np.concatenate(whitened)[:, -1]
            information = A.T @ A
            beta = np.linalg.solve(information, A.T @ y)
            rest = float(np.sum((y - A @ beta) ** 2))
            logdet = 4.0 * float(np.log(np.diag(L)).sum()) + np.linalg.slogdet(information)[1]
            weights.append(-0.5 * logdet - 0.5 * freedom * np.log(rest))
            means.append(beta[2:])
            scales.append(np.sqrt(rest / freedom * np.diag(np.linalg.inv(information))[2:]))
    weight = np.exp(np.array(weights) - max(weights))
    weight /= weight.sum()
    share, turned = (Posterior(np.array(means)[:, n], np.array(scales)[:, n], weight, freedom) for n in (0, 1))
    return share, turned


def _design(legs: Sequence[HeadingLeg]) -> np.ndarray:
    """Of a leg's current: mean north, mean east, the velocity through the water, and that turned; (2 legs, 4)."""
    north, east = np.array([leg.through_water / leg.seconds for leg in legs]).T
    ones, none = np.ones(len(legs)), np.zeros(len(legs))
    return np.column_stack([np.r_[ones, none], np.r_[none, ones], np.r_[north, east], np.r_[-east, north]])


def legs_between(
    fixes: np.ndarray,
    origins: Sequence[Origin],
    runs: Sequence[Run],
    speeds: Sequence[tuple[np.ndarray, np.ndarray]],
) -> tuple[list[HeadingLeg], dict[str, int]]:
    """Legs in their order, and of how many runs none is made by the reason; fixes as read_fixes has them.

    Runs between the same two fixes are one leg. Headings are turned by the magnetic variation that is to be added.
    """
    left_out: Counter[str] = Counter()
    members: dict[tuple[int, int], list[tuple[float, np.ndarray]]] = {}
    for run, origin, (vn, ve) in zip(runs, origins, speeds, strict=True):
        wet = np.flatnonzero(run.columns[names.DEPTH] > WET_M)
        if wet.size < 2:
            left_out["no dive"] += 1
            continue
        rows = slice(int(wet[0]), int(wet[-1]) + 1)
        t = run.t[rows]
        before = int(np.searchsorted(fixes[:, 0], origin.start + t[0])) - 1
        after = int(np.searchsorted(fixes[:, 0], origin.start + t[-1]))
        if before < 0 or after == len(fixes):
            left_out["no fix before or behind"] += 1
            continue
        north, east = float(np.trapezoid(vn[rows], t)), float(np.trapezoid(ve[rows], t))
        c, s = np.cos(origin.variation), np.sin(origin.variation)
        moved = np.array([north * c - east * s, north * s + east * c])
        members.setdefault((before, after), []).append((float(t[-1] - t[0]), moved))
    legs = []
    for (before, after), parts in members.items():
        seconds = float(fixes[after, 0] - fixes[before, 0])
        if sum(logged for logged, _ in parts) < COVERED * seconds:
            left_out["fixes too far from the dive"] += len(parts)
            continue
        middle = 0.5 * float(fixes[after, 0] + fixes[before, 0]) / 3600.0
        through = np.sum([moved for _, moved in parts], axis=0)
        legs.append(HeadingLeg(middle, seconds, moved_between(fixes[before, 1:], fixes[after, 1:]), through))
    return sorted(legs, key=lambda leg: leg.hours), dict(left_out)


def moved_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """North and east from a to b, (2,) deg each, m: by WGS84's radii at the mean latitude, to 1e-4 within 30 km."""
    phi = np.radians(0.5 * (a[0] + b[0]))
    squared = FLATTENING * (2.0 - FLATTENING)
    short = 1.0 - squared * np.sin(phi) ** 2
    meridian, normal = AXIS * (1.0 - squared) / short**1.5, AXIS / np.sqrt(short)
    turn = (b[1] - a[1] + 180.0) % 360.0 - 180.0
    return np.array([meridian * np.radians(b[0] - a[0]), normal * np.cos(phi) * np.radians(turn)])


def _sentence(said: dict[str, Any], share: Posterior, turned: Posterior) -> str:
    """What a pilot should know."""
    texts = []
    if _shown(share, said["along_m_s"]):
        which = "small" if said["along_m_s"] > 0.0 else "large"
        texts.append(f"the current turns with the heading, {_size(said, 'along')} along it: the speed is too {which}")
    else:
        texts.append(f"no current along the heading is shown: {_size(said, 'along')}")
    if _shown(turned, said["across_m_s"]):
        side = "starboard" if said["turned_rad"] > 0.0 else "port"
        degrees = abs(np.degrees(said["turned_rad"]))
        texts.append(f"it flies {degrees:.1f} deg to {side} of its heading ({_size(said, 'across')} to starboard)")
    return f"{'; '.join(texts)}; {said['legs']} dives from fix to fix"


def _shown(one: Posterior, size: float) -> bool:
    """Whether a coefficient has its sign for sure and its speed (m/s) matters."""
    below = one.below(0.0)
    return max(below, 1.0 - below) > 0.5 * (1.0 + GAP.heading_confidence) and abs(size) >= GAP.heading_speed


def _size(said: dict[str, Any], name: str) -> str:
    low, high = said[f"{name}_ci90"]
    return f"{100.0 * said[f'{name}_m_s']:+.1f} cm/s ({100.0 * low:+.1f} to {100.0 * high:+.1f})"
