"""Whether what the selected effects leave is an effect that nobody knows, or disorder: of the water, or of a clock."""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.diagnose.clock import ClockModel
from glider.tools.diagnose.gates import opened
from glider.tools.diagnose.noise_probes import (
    CLOCK,
    TURBULENCE,
    WAVES,
    NoiseProbe,
    ProbeResult,
    inflated,
    probes,
    run_probes,
)
from glider.tools.diagnose.search import Search
from glider.tools.diagnose.shrink import Shrinkage, shrink
from glider.tools.diagnose.waves import line_share
from glider.tools.inference.fit import Hypothesis
from glider.tools.inference.hyperparameters import DIAGNOSIS
from glider.tools.inference.parameters import CLOCK_PLACE
from glider.tools.inference.problem import Problem


def probability(share: float, middle: float, width: float) -> float:
    """Probability that what is left is a gap of its own (docs/explanation/diagnosis.md, Thresholds)."""
    z = (np.log(max(share, 1e-6)) - np.log(middle)) / width
    return float(np.clip(ndtr(z), DIAGNOSIS.least_unknown, 1.0 - DIAGNOSIS.least_unknown))


def left_share(shrinkage: Shrinkage, taken: float) -> float:
    """Of the squared gap beyond the floor without the selected effects, the share that they leave.

    taken: by how much squared gaps grow with a model that lacks them, all else as fitted. What they leave is held
    against that, or against what the file's model misses, recalibrated or not, whichever is less: what is allowed may
    take up much of a large effect, and fitted to one that nobody knows it may miss more than before.
    """
    left = shrinkage.after**2 - shrinkage.floor**2
    beyond = min(max(shrinkage.before, shrinkage.recalibrated) ** 2 - shrinkage.floor**2, left + taken)
    return float(np.clip(left / beyond, 0.0, 1.0)) if beyond > 0.0 else 0.0


def left_floors(shrinkage: Shrinkage) -> float:
    """What is left of the gap beyond the floor, in floors."""
    return left_beyond(shrinkage) / max(shrinkage.floor, 1e-6)


def left_beyond(shrinkage: Shrinkage) -> float:
    """What is left of the gap beyond the floor, in tolerances."""
    return float(np.sqrt(max(shrinkage.after**2 - shrinkage.floor**2, 0.0)))


def unfit(shrinkage: Shrinkage, noise: ProbeResult | None) -> float:
    """Probability that the vehicle is not its file's, by what the best explanation leaves; beyond disorder's floor."""
    return opened(
        shrinkage.after if noise is None else left_beyond(shrinkage), DIAGNOSIS.far_gap, DIAGNOSIS.far_full_gap
    )


def place_alone(probed: Iterable[tuple[NoiseProbe, float]]) -> tuple[tuple[str, str], float]:
    """Subsystem and element whose noise gains most, and how surely it alone does; of probes and their gains (nat)."""
    gains: dict[tuple[str, str], float] = {}
    for probe, gain in probed:
        place = probe.subsystem, probe.element
        gains[place] = max(gains.get(place, 0.0), gain)
    ranked = sorted(gains, key=lambda place: -gains[place])
    next_gain = gains[ranked[1]] if len(ranked) > 1 else 0.0
    alone = opened(gains[ranked[0]] / max(next_gain, 1e-9), DIAGNOSIS.alone_ratio) if ranked else 0.0
    return (ranked[0], alone) if ranked else (("", ""), 0.0)


@dataclass
class Remainder:
    """What the selected effects leave, in nat of likelihood that inflating one link's noise gains."""

    explained: float  # by the selected effects over none
    left: float  # by the probe that gains most
    probed: list[ProbeResult]
    shows: float = 1.0  # how far it counts: it is hardly beyond chance, or far

    @property
    def alone(self) -> tuple[tuple[str, str], float]:
        """Where most of it enters, and how surely all: not where the noise of others would explain it, too."""
        return place_alone((found.probe, found.gain) for found in self.probed)

    @property
    def share(self) -> float:
        return float(np.clip(self.left / max(self.left + self.explained, 1e-9), 0.0, 1.0))


def remainder_of(
    search: Search, hypothesis: Hypothesis, noise: ProbeResult | None, whiteness: float = np.inf
) -> Remainder:
    """The probes at a hypothesis, beside what its effects, and `noise`, explain; whiteness: sigma of what is left."""
    problem = search.problem
    null = float(problem.filter(*search.model(search.null), begin=True).misfit.sum())
    own = float(search.gains.misfit.sum())
    probed = run_probes(problem, *search.model(hypothesis), probes(problem))
    explained = max(0.5 * (null - own), 0.0) + (noise.gain if noise is not None else 0.0)
    return Remainder(
        explained,
        probed[0].gain,
        probed,
        opened(whiteness, DIAGNOSIS.residual_sigma),
    )


def waves_beside(search: Search, hypothesis: Hypothesis, left: Remainder) -> ProbeResult | None:
    """Waves, where they gain beside a hypothesis, and what they move has a sea's line.

    Other links may gain more: what effects leave that the windows do not ask for.
    """
    found = next((one for one in left.probed if one.probe.name == WAVES), None)
    if found is None or found.gain < DIAGNOSIS.evidence_needed:
        return None
    more, doubt = inflated(search.problem, found.probe, found.scale)
    gains = search.problem.filter(*search.model(hypothesis), begin=True, more=more, doubt=doubt)
    return found if line_share(search.problem, gains) >= DIAGNOSIS.wave_share else None


def turbulence_first(probed: list[ProbeResult]) -> ProbeResult | None:
    """Turbulence, where no other link gains nearly as much beside a hypothesis."""
    first = probed[0] if probed else None
    if first is None or first.probe.name != TURBULENCE or probed[1].gain > DIAGNOSIS.single_axis_share * first.gain:
        return None
    return first


def clock_first(probed: list[ProbeResult]) -> ProbeResult | None:
    """Motion capture's clock, where its probe gains more than any other link's, its poses' noise apart."""
    clock = next((found for found in probed if found.probe.name == CLOCK), None)
    if (
        clock is None
        or clock.gain <= DIAGNOSIS.clock_share * probed[0].gain
        or probed[0].probe.element != CLOCK_PLACE[1]
    ):
        return None
    return clock


def wandering_clock(search: Search, hypothesis: Hypothesis, left: Remainder) -> ProbeResult | None:
    """A clock that gains most of all links, or would beside the rough water that does: it takes the clock's place.

    Water that shakes every axis goes wherever poses say, at whatever time they were taken, and gains for that, too.
    """
    if not any(found.probe.name == CLOCK and found.gain > DIAGNOSIS.clock_share * left.left for found in left.probed):
        return None
    if left.probed[0].probe.name != TURBULENCE:
        return clock_first(left.probed)
    more, _ = inflated(search.problem, left.probed[0].probe, left.probed[0].scale)
    noisy = search.problem.with_extra_noise(more)
    found = clock_first(run_probes(noisy, *search.model(hypothesis), probes(noisy)))
    return found if found is not None and found.gain > DIAGNOSIS.evidence_needed else None


def disorder(search: Search, hypothesis: Hypothesis, left: Remainder) -> ProbeResult | None:
    """The noise that the search has to know of, to see what is beside it; None where there is nothing of the kind.

    Motion capture's clock where it wanders; waves where they show beside the hypothesis, turbulence where nothing else
    does.
    """
    clock = wandering_clock(search, hypothesis, left)
    if clock is not None:
        return clock
    beside = waves_beside(search, hypothesis, left)
    if beside is not None:
        return beside
    water = turbulence_first(left.probed)  # a sensor's small error may have more nats than it: windows show it
    return water if water is not None and left_floors(shrink(search, hypothesis)) > DIAGNOSIS.own_size else None


def clock_of(search: Search, hypothesis: Hypothesis, gained: dict[str, float], more: np.ndarray) -> ClockModel | None:
    """Of a hypothesis the effect of motion capture's clock that brings most, None where it has none.

    Its size is the mean over runs of the course of a clock that wanders by `more` (n_spectral,), its spread what the
    runs differ by. Where that course is drawn better by the other label, a constant or a line from 0, it is that one:
    of two clocks of one hypothesis elimination may have left the wrong one.
    """
    labels = sorted((label for label in gained if catalogue()[label].place == CLOCK_PLACE), key=lambda n: -gained[n])
    if not labels:
        return None
    own = [k for k, free in enumerate(hypothesis.free) if free.label == labels[0]]
    free, values = [hypothesis.free[k] for k in own], hypothesis.values[own]
    sd = np.sqrt(np.diag(np.linalg.inv(hypothesis.precision)))[own]
    problem, model = search.problem, search.model(hypothesis)
    late = problem.filter(*model, begin=True, more=more).X[:, ef.X_LATE]
    whole = late + model[1][ef.MOCAP_DELAY] + model[1][ef.CLOCK_SKEW] * problem.since
    drawn = {label: run_sizes(problem, whole, label) for label in ("mocap_delay", "clock_skew")}
    other = "mocap_delay" if labels[0] == "clock_skew" else "clock_skew"
    better = len(problem.runs) > 1 and drawn[other][1] < DIAGNOSIS.other_clock_share * drawn[labels[0]][1]
    if better and other in search.parameters:
        free, sizes = search.parameters[other], drawn[other][0]
        values, spread = np.zeros(len(free)), sizes.std(ddof=1) / np.sqrt(len(sizes))
        values[0] = sizes.mean() / free[0].spread
        return ClockModel(other, free, values, np.full(len(free), spread / free[0].spread))
    sizes = run_sizes(problem, late, labels[0])[0]
    values[0] += sizes.mean() / free[0].spread
    if len(sizes) > 1:
        sd[0] = max(sd[0], sizes.std(ddof=1) / np.sqrt(len(sizes)) / free[0].spread)
    return ClockModel(labels[0], free, values, sd)


def run_sizes(problem: Problem, late: np.ndarray, label: str) -> tuple[np.ndarray, float]:
    """Of a clock's course `late` (rows,) s the constant, or for clock_skew the slope, of each run; and what is left.

    That is of the squares about the mean of the runs, s^2.
    """
    shape = problem.since if label == "clock_skew" else np.ones_like(late)
    runs = itertools.pairwise(problem.recording.bounds)
    sizes = np.array([shape[a:b] @ late[a:b] / (shape[a:b] @ shape[a:b]) for a, b in runs])
    left = late - sizes.mean() * shape
    return sizes, float(left @ left)


def clock_label(search: Search, hypothesis: Hypothesis) -> str:
    """The label of a clock that wanders: one that was selected; else whether it is late, or ever later.

    The clock's error where the filter stands is drawn by a constant and by a line from 0, over all runs at once.
    """
    for label in search.entries(hypothesis):
        if catalogue()[label].place == CLOCK_PLACE:
            return label
    since, late = search.problem.since, search.gains.X[:, ef.X_LATE]
    slope = float(since @ late) / max(float(since @ since), 1e-9)
    left = {"mocap_delay": late - late.mean(), "clock_skew": late - slope * since}
    return min(left, key=lambda label: float(left[label] @ left[label]))


def probability_unknown(
    search: Search, evident: bool, shrinkage: Shrinkage, left: Remainder | None, noise: ProbeResult | None,
    taken: float, places: Sequence[tuple[str, str]] = (),
) -> float:  # fmt: skip
    """Probability that the gap is none of the catalogue's, or that there is one where none shows otherwise.

    evident: whether any effect is there, if negligible; noise: disorder that the search knows of, which no window's
    floor has; taken: as in left_share; places: of the effects. What is left at the sensor of one of them, and nowhere
    else, is no small effect beside it: something there has another form, however narrow the gap it leaves.
    """
    off = unfit(shrinkage, noise) if search.problem.rules.whiteness else 0.0
    known = DIAGNOSIS.least_unknown
    if left is not None:
        kinds = ((search.well_specified, True), (1.0 - search.well_specified, False))
        shown = sum(
            share * unknown_beside(well_specified, evident, shrinkage, left, noise, taken, places)
            for share, well_specified in kinds if share > 0.0
        )  # fmt: skip
        known += (shown - known) * left.shows
    return known + (1.0 - DIAGNOSIS.least_unknown - known) * off


def unknown_beside(
    well_specified: bool, evident: bool, shrinkage: Shrinkage, left: Remainder, noise: ProbeResult | None, taken: float,
    places: Sequence[tuple[str, str]],
) -> float:  # fmt: skip
    """The same of something left, where every sensor's noise is what the file says (well specified), or is not.

    Then what is left is no small effect beside the main one, and the misfit says enough. A wandering clock moves no
    vehicle: windows say as much as with a clock that is right.
    """
    if noise and noise.probe.name != CLOCK:
        return probability(left.share, DIAGNOSIS.misfit_share, DIAGNOSIS.misfit_share_width)
    as_said = well_specified and not noise
    middle = DIAGNOSIS.specified_unknown_size if as_said else DIAGNOSIS.own_size
    wide = probability(left_floors(shrinkage), middle, DIAGNOSIS.unknown_width)
    if not evident:
        return wide
    share = left.share if as_said else left_share(shrinkage, taken)
    form = probability(share, DIAGNOSIS.misfit_share, DIAGNOSIS.unknown_width)
    beside = max(form * wide, DIAGNOSIS.least_unknown)
    place, alone = left.alone
    if place[0] == "sensing" and place in places:
        beside += (
            max(form, probability(left.share, DIAGNOSIS.sensor_misfit_share, DIAGNOSIS.misfit_share_width)) - beside
        ) * alone
    return beside
