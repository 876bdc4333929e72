"""A data-driven correction: what an unknown gap does, learned at the link of the chain where it enters.

Where no effect of the catalogue explains a gap, the link whose probe gains most is given an error of its own: a sum
of shapes (constant, speed, depth, angles of flow, rates, running pump, time, climb or dive) with coefficients fitted as
those of an effect are. It is no cause, but says what the gap is correlated with, and by how much the gap would shrink.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.correction import shapes
from glider.tools.diagnose.descent import converge
from glider.tools.diagnose.noise_probes import UNPREDICTABLE, NoiseProbe, ProbeResult
from glider.tools.diagnose.residuals import pump_speed
from glider.tools.diagnose.search import Search
from glider.tools.inference.corrected import LINKS
from glider.tools.inference.fit import Fitter, Hypothesis
from glider.tools.inference.model import effect_vector
from glider.tools.inference.parameters import FreeParameter

LABEL = "correction"
LINKS_TRIED = 3
REFITS, STEPS = 3, 4
TELLING = 0.1  # of the correction's size that a shape must carry to be named

UNITS = ("N", "N", "N", "N m", "N m", "N m", "rad", "m", "kg", *3 * ("rad",), *3 * ("rad/s",), "m", "m", "kg")
SPREADS = (0.5, 0.5, 0.5, 0.2, 0.2, 0.1, 0.1, 0.005, 0.02, *3 * (0.05,), *3 * (0.03,), 0.2, 0.005, 0.02)
OF_PROBE = {"attitude": ("roll", "pitch", "yaw"), "gyro": ("roll rate", "pitch rate", "yaw rate")}
BY_PUMP = ef.SHAPES.index("pump running")


@dataclass
class Correction:
    """A link with the error that these runs ask for there."""

    link: str
    unit: str
    search: Search  # its problem knows of the link
    hypothesis: Hypothesis
    carried: dict[str, float]  # by shape: rms of its part over the runs, in the unit; those that tell, largest first

    @property
    def coefficients(self) -> dict[str, float]:
        """By shape, in the link's unit."""
        return {
            free.name: float(value * free.spread)
            for free, value in zip(self.hypothesis.free, self.hypothesis.values, strict=True)
            if free.label == LABEL
        }

    def plain(self) -> dict[str, Any]:
        return {"link": self.link, "unit": self.unit, "goes_with": self.carried, "coefficients": self.coefficients}


def links_of(probe: NoiseProbe) -> tuple[str, ...]:
    """The links that a probe stands for; none for the water and for motion capture."""
    if probe.name in UNPREDICTABLE:
        return ()
    return tuple(link for link in OF_PROBE.get(probe.name, (probe.name,)) if link in LINKS)


def free_of(link: str) -> list[FreeParameter]:
    """The coefficients of a correction at a link."""
    number = LINKS.index(link)
    shapes = list(enumerate(ef.SHAPES))
    if number >= ef.ACTUATOR_LINKS:  # a sensor does not feel the pump
        shapes.pop(BY_PUMP)
    return [
        FreeParameter(LABEL, name, "F", ef.SHAPE + k, SPREADS[number] * (0.3 if k else 1.0), unit=UNITS[number])
        for k, name in shapes
    ]


def fitted(search: Search, hypothesis: Hypothesis, link: str) -> tuple[Search, Hypothesis]:
    """A correction at a link beside a candidate's effects, fitted with gains of its own."""
    F = effect_vector(search.problem.model)
    F[ef.LINK] = 1.0 + LINKS.index(link)
    problem = replace(search.problem, model=replace(search.problem.model, F=F))
    own = replace(search, problem=problem, hypotheses=[])
    free = [*hypothesis.free, *free_of(link)]
    values = np.concatenate([hypothesis.values, np.zeros(len(free) - len(hypothesis.free))])
    found = Hypothesis((*hypothesis.labels, LABEL), free, values, hypothesis.nuisance)
    for _ in range(REFITS):
        own.gains = problem.filter(*own.model(found), begin=True)
        own.fitter = Fitter(problem, own.gains, own.nuisance, found, temper=True)
        found = own.fitter.hypothesis(found.labels, free, found.values, found.nuisance)
        own.fitter.measure([found])
        converge(own.fitter, found, STEPS)
    own.gains = problem.filter(*own.model(found), begin=True)
    own.hypotheses = [found]
    return own, found


def shapes_flown(search: Search) -> np.ndarray:
    """The shapes along the runs where the filter stands, (rows, N_SHAPES)."""
    pump = pump_speed(search.problem, search.gains)
    rows = zip(search.gains.X, search.problem.since, pump, strict=True)
    return np.array([shapes(x, since, speed) for x, since, speed in rows])


def carried_by(search: Search, hypothesis: Hypothesis) -> dict[str, float]:
    """How much of the correction each shape carries over these runs (rms), the largest first, what tells only."""
    table = shapes_flown(search)
    parts = {
        free.name: float(abs(value) * free.spread * np.sqrt(np.mean(table[:, free.entry - ef.SHAPE] ** 2)))
        for free, value in zip(hypothesis.free, hypothesis.values, strict=True)
        if free.label == LABEL
    }
    whole = np.sqrt(sum(part**2 for part in parts.values()))
    ranked = sorted(parts.items(), key=lambda item: -item[1])
    return {name: part for name, part in ranked if part >= TELLING * whole}


def correct(
    search: Search, hypothesis: Hypothesis, probed: list[ProbeResult], say: Callable[[str], None] = lambda text: None
) -> Correction | None:
    """The correction that explains most, of those at the links whose probes gain most; None where none may be."""
    probes = [found.probe for found in probed if found.gain > 0.0 and links_of(found.probe)][:LINKS_TRIED]
    best: tuple[float, str, Search, Hypothesis] | None = None
    for probe in probes:
        for link in links_of(probe):
            say(f"correction: {link}")
            own, found = fitted(search, hypothesis, link)
            misfit = float(own.gains.misfit.sum())
            if np.isfinite(misfit) and (best is None or misfit < best[0]):
                best = misfit, link, own, found
    if best is None:
        return None
    _, link, own, found = best
    return Correction(link, UNITS[LINKS.index(link)], own, found, carried_by(own, found))
