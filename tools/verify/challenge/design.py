"""What the pilot of a blind case flies: starts, legs and lengths of its runs, at a pool or a lake."""

from dataclasses import dataclass
from math import radians

import numpy as np

from glider.firmware.core.maths.rotations import quaternion_from_euler
from glider.firmware.core.vehicle.layout import X_ACT, X_NU, X_POS, X_QUAT
from glider.sim_backend.foreign import foreign_layout as fo

FITTED, HELD = 6, 3
LEGS = 24
NEVER = 1e9  # s
STYLES = ("glide", "spiral", "steps", "fixed", "glide", "steps")


@dataclass(frozen=True)
class DesignSite:
    """Where the case is flown: depths in m, lengths in s."""

    name: str
    start: tuple[float, float]
    upper: tuple[float, float]  # where climbs end
    lower: tuple[float, float]  # where dives end
    limits: tuple[float, float]  # true depths that no run may leave
    seconds: tuple[float, float]
    mocap: bool

    @property
    def depths(self) -> tuple[float, float]:
        """Shallow and deep ends of the flights, on average."""
        return sum(self.upper) / 2.0, sum(self.lower) / 2.0


POOL = DesignSite("pool", (1.6, 2.6), (2.0, 2.8), (3.0, 4.0), (0.05, 8.0), (60.0, 85.0), True)
LAKE = DesignSite("lake", (1.5, 4.0), (3.0, 5.0), (7.0, 12.0), (0.05, 30.0), (90.0, 150.0), False)


@dataclass
class RunDesign:
    """One run before it is flown."""

    start: np.ndarray  # (N_FX,)
    legs: np.ndarray  # (LEGS, N_L)
    rows: int
    seed: np.uint64
    waves: np.ndarray  # (components, N_W)


def _servo(rng: np.random.Generator, style: str) -> float:
    if style == "spiral":
        return rng.choice([-1.0, 1.0]) * rng.uniform(0.4, 0.9)
    return 0.0 if rng.random() < 0.35 else rng.uniform(-0.85, 0.85)


def _leg(rng: np.random.Generator, site: DesignSite, style: str, dive: bool, servo: float) -> np.ndarray:
    leg, sign = np.zeros(fo.N_L), 1.0 if dive else -1.0
    leg[fo.L_PITCH] = -sign * radians(rng.uniform(18.0, 42.0))
    leg[fo.L_BALLAST] = sign * rng.uniform(0.08, 0.19)
    leg[fo.L_SERVO] = servo
    leg[fo.L_DEPTH] = rng.uniform(*(site.lower if dive else site.upper))
    leg[fo.L_TIME] = 120.0
    leg[fo.L_STEP_TIME] = NEVER
    if style == "fixed":
        leg[fo.L_FIXED] = 1.0
        leg[fo.L_SLIDER] = sign * rng.uniform(-0.006, 0.008)
    if style in ("steps", "fixed"):
        leg[fo.L_STEP_TIME] = rng.uniform(6.0, 12.0 if site.mocap else 25.0)
        leg[fo.L_STEP_PITCH] = radians(rng.uniform(-14.0, 14.0))
        leg[fo.L_STEP_SLIDER] = rng.uniform(-0.008, 0.008)
        leg[fo.L_STEP_SERVO] = rng.uniform(-0.5, 0.5) if style == "steps" else 0.0
    return leg


def draw_run(rng: np.random.Generator, site: DesignSite, style: str, waves: np.ndarray) -> RunDesign:
    """A run in a style of STYLES: start, legs, length, seed, phases of the waves."""
    servo, legs = _servo(rng, style), []
    for number in range(LEGS):
        if style != "spiral" and rng.random() < 0.7:
            servo = _servo(rng, style)
        legs.append(_leg(rng, site, style, number % 2 == 0, servo))
    x = np.zeros(fo.N_FX)
    x[X_POS + 2] = rng.uniform(*site.start)
    x[X_QUAT : X_QUAT + 4] = quaternion_from_euler(0.0, rng.uniform(0.3, 0.8) * legs[0][0], rng.uniform(-np.pi, np.pi))
    x[X_NU], x[X_NU + 2] = rng.uniform(0.1, 0.3), rng.uniform(0.0, 0.02)
    x[X_ACT : X_ACT + 3] = 0.0
    own = waves.copy()
    own[:, fo.FW_PHASE] = rng.uniform(0.0, 2.0 * np.pi, len(own))
    rows = int(rng.uniform(*site.seconds) / fo.ROW_S)
    return RunDesign(x, np.array(legs), rows, np.uint64(rng.integers(0, 2**63)), own)


def draw_runs(rng: np.random.Generator, site: DesignSite, waves: np.ndarray) -> list[RunDesign]:
    """The fitted runs, one of each style in any order, then the held ones."""
    styles = [*rng.permutation(STYLES), *rng.choice(STYLES, HELD)]
    return [draw_run(rng, site, str(style), waves) for style in styles]
