"""The likelihood gained by inflating the noise of one link of the chain.

A probe inflates the noise of one link (an actuator's motion, a force or moment along one axis, the water, a sensor) so
that the filter gives the model no weight there; the likelihood it gains says how much of the misfit enters at that
link, whatever its cause. Two probes are effects of the catalogue by themselves: turbulence, a disturbance stronger on
every axis, and waves, water that moves the vehicle without turning it.
"""

from dataclasses import dataclass

import numpy as np

from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.ocean.core import layout as ocean
from glider.tools.inference.hyperparameters import DIAGNOSIS
from glider.tools.inference.problem import Problem

TURBULENCE, WAVES, CLOCK = "turbulence", "waves", "motion capture's clock"
VERTICAL_WATER = "vertical_water"
UNPREDICTABLE = (TURBULENCE, WAVES, VERTICAL_WATER)  # labels whose time history is unpredictable


@dataclass(frozen=True)
class NoiseProbe:
    """A link and how its noise is inflated: densities by index of `spectral`, variances by index of y."""

    name: str
    stage: str  # of the chain: actuator, force, water, sensor
    subsystem: str
    element: str
    spectral: tuple[int, ...] = ()
    reading: tuple[int, ...] = ()
    unit: float = 1.0  # 1 sigma, or density's root, at scale 1: about what the vehicle file allows for


def probes(problem: Problem) -> list[NoiseProbe]:
    """The probes that these runs can answer."""
    if problem.kind.input_table is not None:
        return ocean_probes(problem)
    d, s = problem.case.disturbance, problem.case.sensors
    linear, angular = np.sqrt(0.1) * d.linear, np.sqrt(0.1) * d.angular
    every = [
        NoiseProbe(TURBULENCE, "force", "environment", "water", (0, 1, 2, 3, 4, 5)),
        NoiseProbe(WAVES, "water", "environment", "water", (9, 10, 11), unit=0.003),
        NoiseProbe("surge force", "force", "hydrodynamics", "surge", (0,), unit=linear),
        NoiseProbe("sway force", "force", "hydrodynamics", "sway", (1,), unit=linear),
        NoiseProbe("heave force", "force", "hydrodynamics", "heave", (2,), unit=linear),
        NoiseProbe("roll moment", "force", "hydrodynamics", "roll", (3,), unit=angular),
        NoiseProbe("pitch moment", "force", "hydrodynamics", "pitch", (4,), unit=angular),
        NoiseProbe("yaw moment", "force", "hydrodynamics", "yaw", (5,), unit=angular),
        NoiseProbe("servo", "actuator", "actuation", "servo", (6,), unit=0.003),
        NoiseProbe("slider", "actuator", "actuation", "slider", (7,), unit=0.00005),
        NoiseProbe("ballast", "actuator", "actuation", "ballast", (8,), unit=0.0001),
        NoiseProbe("attitude", "sensor", "sensing", "attitude", (), (0, 1, 2), s.attitude.noise),
        NoiseProbe("gyro", "sensor", "sensing", "gyro", (), (3, 4, 5), s.gyro.noise),
        NoiseProbe("depth", "sensor", "sensing", "depth", (), (6,), s.depth.noise),
        NoiseProbe("slider wire", "sensor", "actuation", "slider", (), (7,), s.slider.noise),
        NoiseProbe("ballast wire", "sensor", "actuation", "ballast", (), (8,), s.ballast.noise),
        NoiseProbe("motion capture", "sensor", "timing", "mocap", (), (9, 10, 11, 12, 13, 14), s.mocap_position.noise),
        NoiseProbe(CLOCK, "sensor", "timing", "mocap", (12,), unit=0.01),
    ]
    seen = problem.seen
    mocap = seen[ef.Y_ONBOARD :].any()
    return [p for p in every if (mocap or p.name != CLOCK) and (not p.reading or seen[list(p.reading)].any())]


def ocean_probes(problem: Problem) -> list[NoiseProbe]:
    """Those of an ocean glider."""
    d, s = problem.case.disturbance, problem.case.sensors
    every = [
        NoiseProbe(VERTICAL_WATER, "water", "environment", "water", (ocean.Q_WATER,), unit=d.water_rate),
        NoiseProbe("speed", "force", "hydrodynamics", "surge", (ocean.Q_SPEED,), unit=d.speed),
        NoiseProbe("roll", "force", "hydrodynamics", "roll", (ocean.Q_ROLL,), unit=d.roll_rate),
        NoiseProbe("depth", "sensor", "sensing", "depth", (), (ocean.Y_DEPTH,), s.depth.noise),
    ]
    return [p for p in every if problem.seen[ocean.Y_ROLL] or p.name != "roll"]


SCALES = (2.0, 6.0, 20.0, 60.0)  # of a probe's unit; the best of them counts
FINER = (0.6, 1.6)  # and then about that


@dataclass
class ProbeResult:
    """A probe's answer: nat gained over the same model without it, at the best scale."""

    probe: NoiseProbe
    gain: float
    scale: float


def inflated(problem: Problem, probe: NoiseProbe, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """What a probe adds to the spectral densities (n_spectral,) and to the measurements' variances (N_Y,)."""
    more, doubt = np.zeros(problem.kind.n_spectral), np.zeros(len(problem.kind.readings))
    if probe.name == TURBULENCE:
        axes = problem.kind.accelerations
        more[axes] = problem.densities[axes] * (scale**2 - 1.0)
    else:
        more[list(probe.spectral)] = (probe.unit * scale) ** 2
        doubt[list(probe.reading)] = (probe.unit * scale) ** 2
    return more, doubt


def run_probes(
    problem: Problem, P: np.ndarray, F: np.ndarray, wanted: list[NoiseProbe], scales=SCALES, finer=FINER
) -> list[ProbeResult]:
    """Every probe of a model, the one that gains most first."""
    own = problem.filter(P, F, begin=True)
    bare = float(own.misfit.sum())
    found = []
    for probe in wanted:
        best, scale = 0.0, 1.0
        tried = {1.0: 0.0}

        def gain(s: float, probe: NoiseProbe = probe, tried: dict[float, float] = tried) -> float:
            more, doubt = inflated(problem, probe, s)
            noisy = problem.filter(P, F, more=more, doubt=doubt, starts=own.starts)
            tried[s] = 0.5 * (bare - float(noisy.misfit.sum()))
            return tried[s]

        for s in scales:
            value = gain(s)
            if not np.isfinite(value) or (value < best and probe.name != CLOCK):
                break
            if value > best:
                best, scale = value, s
        if best > 0.0:
            for s in (scale * step for step in finer):
                value = gain(s)
                if np.isfinite(value) and value > best:
                    best, scale = value, s
        if probe.name == CLOCK:
            scale = max(s for s, value in tried.items() if value >= DIAGNOSIS.clock_scale_share * best)
            best = tried[scale]
        found.append(ProbeResult(probe, best, scale))
    return sorted(found, key=lambda p: -p.gain)
