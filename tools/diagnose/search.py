"""The search for the cause: every label tried, the likely ones fitted, more than one where one does not do.

The data's weight is let in by degrees. At first the filter expects a disturbance many times the vehicle's, so that
it holds any model to the course flown and the misfit is nearly a parabola however large the effect; then of less, and
at last of what the vehicle file says. Hypotheses that fall behind by far are dropped on the way.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit

from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.diagnose.clock import ClockModel
from glider.tools.diagnose.descent import advance_and_prune, converge, first_step, prune, transfer, try_distant_starts
from glider.tools.diagnose.gates import opened
from glider.tools.diagnose.sensor_consistency import HOLDS_BELOW, inconsistent_sensors
from glider.tools.inference import levels
from glider.tools.inference.fit import THRESHOLD_STEP, Fitter, Hypothesis
from glider.tools.inference.hyperparameters import DIAGNOSIS
from glider.tools.inference.model import effect_vector, nominal_model
from glider.tools.inference.parameters import (
    CLOCK_PLACE,
    FreeParameter,
    effect_parameters,
    model_at,
    nuisance_parameters,
)
from glider.tools.inference.problem import Gains, Problem
from glider.tools.inference.time_alignment import aligned

PROCESS_NOISE_SCALES = (100.0, 10.0)  # times the disturbance, before the vehicle's own
HYPOTHESES_TRIED, KEPT, LEFT = (
    20,
    12,
    8,
)  # hypotheses: after the screen, after the filter with the largest process noise, after the second
SETTLING = 1  # steps of all hypotheses before any is dropped
MOST_EFFECTS = 5
LEADING, PARTNERS_TRIED = 3, 5  # hypotheses beside which a second effect is tried, and how many beside each
FAR_OFF = 10.0  # mean NIS of the best of three effects, beyond which no further one is small, nor explains it
FURTHER_EFFECTS_TRIED = 3  # effects tried as a third or further one, beside the best hypothesis
SHORT_LIST = 3  # hypotheses led on from the third effect on
VISIBLE = 1.0  # squared sigma: a spread of an effect that moves nothing by as much cannot be seen in these runs
PARTNER_EVIDENCE = 5.0  # nat that one step is expected to gain with a further effect, or none is tried
POLISHED = {1: 3, 2: 2}  # times at most, by the number of effects; once with more
LEAST_LOG_LEVEL = 0.1  # logarithm by which a disturbance begins to be another
LEVEL_ROUNDS = 2  # Newton steps at a time
ROUNDS = 3  # of gains at the best label and all labels tried again there, at most
ALIGNED = 3  # times that poses are moved to where the clock found so far says
NEARLY_UNTEMPERED = 1.05  # temperature: the best hypothesis is near the truth


@dataclass
class Search:
    """Where a search stands."""

    problem: Problem
    nuisance: list[FreeParameter]
    parameters: dict[str, list[FreeParameter]]  # by label, of every effect that these runs could show
    fitter: Fitter
    null: Hypothesis
    hypotheses: list[Hypothesis]
    # Of the filter at the hypothesis that stands: floors begin there, what is left is tested. Hypotheses are compared
    # by fitter.gains alone, also where one drops an effect or a run.
    gains: Gains
    clock: ClockModel | None = None
    well_specified: float = 0.0  # probability that the sensors' noise is what the file says

    def entries(self, hypothesis: Hypothesis) -> dict[str, list[int]]:
        """By effect of a hypothesis, the clock's among them, where in F it stands."""
        own = {} if self.clock is None else {self.clock.label: [free.entry for free in self.clock.free]}
        return own | {
            label: [free.entry for free in hypothesis.free if free.label == label] for label in hypothesis.labels
        }

    def without_effect(self, F: np.ndarray, entries: list[int]) -> np.ndarray:
        """F (N_F,) with these entries as the vehicle file has them."""
        without = F.copy()
        without[entries] = effect_vector(nominal_model(self.problem.case))[entries]
        return without

    def free(self, labels: tuple[str, ...]) -> list[FreeParameter]:
        return [f for label in labels for f in self.parameters[label]]

    def model(self, hypothesis: Hypothesis) -> tuple[np.ndarray, np.ndarray]:
        values = np.concatenate([hypothesis.nuisance, hypothesis.values])
        return model_at(self.problem, [*self.nuisance, *hypothesis.free], values)

    def ranked(self) -> list[Hypothesis]:
        return sorted(self.hypotheses, key=lambda c: -c.log_evidence(self.fitter))

    @property
    def best(self) -> Hypothesis:
        return self.ranked()[0]


def screen(search: Search, beside: Hypothesis, most: int) -> list[Hypothesis]:
    """The labels that should gain most beside a hypothesis, were everything linear: as hypotheses before a step.

    What begins only beyond some size (a limit that the commands never reached) gets a larger difference step.
    """
    fitter, tried = search.fitter, []
    for label, free in search.parameters.items():
        if label in beside.labels or {f.entry for f in free} & {f.entry for f in beside.free}:
            continue
        values = np.concatenate([beside.values, np.zeros(len(free))])
        hypothesis = fitter.hypothesis((*beside.labels, label), [*beside.free, *free], values, beside.nuisance)
        hypothesis.set_innovations(beside.e, fitter.prior_weight)
        hypothesis.known = beside.columns if len(beside.free) else hypothesis.known
        tried.append(hypothesis)
    fitter.linearise(tried, coarse=True)
    new = len(beside.free)
    away = [one for one in tried if one.runs_away(new)]
    for hypothesis in away:
        hypothesis.shorter = 0.1
        hypothesis.known = hypothesis.columns[:new]
    if away:
        fitter.linearise(away, coarse=True)

    def shows(hypothesis: Hypothesis) -> bool:
        return (hypothesis.columns[new:] ** 2).sum() > VISIBLE

    hidden = [c for c in tried if not shows(c) and all(f.one_sided for f in c.free[new:])]
    for hypothesis in hidden:
        hypothesis.bound_step = THRESHOLD_STEP
        hypothesis.known = hypothesis.columns[:new]
    if hidden:
        fitter.linearise(hidden, coarse=True)
    shown = [c for c in tried if shows(c)]
    return sorted(shown, key=lambda hypothesis: -hypothesis.expected_evidence())[:most]


def start_at_inconsistent_sensor(search: Search) -> bool:
    """A sensor or clock that is inconsistent with the others, fitted before all else; False where there is none.

    A filter that expects a rough disturbance leans on the readings, and with gyros that turn twice as far as the
    attitude, or with poses that are a second late, it holds no model to the course flown. Of a clock both labels are
    fitted: a constant between two that were tried looks like a line.
    """
    if search.fitter.prior_weight <= HOLDS_BELOW:
        return False
    found = inconsistent_sensors(search.problem, search.nuisance, search.parameters)
    if not found:
        return False
    first = catalogue()[found[0][0].label].place
    same = [one for one in found if catalogue()[one[0].label].place == first == CLOCK_PLACE]
    begun = [begun_at(search, free, value) for free, value in same or found[:1]]
    best = min(begun, key=lambda one: one.fitter.temperature)
    search.problem, search.fitter, search.gains = best.problem, best.fitter, best.gains
    search.null, search.hypotheses = best.null, best.hypotheses
    return True


def begun_at(search: Search, free: FreeParameter, value: float) -> Search:
    """The search at one effect alone, one of its parameters begun at a value (spreads); a clock's with poses moved."""
    own = search.parameters[free.label]
    begun = replace(search, hypotheses=[])
    values = np.array([value * (one is free) for one in own])
    begun.hypotheses = [begun.fitter.hypothesis((free.label,), own, values)]
    for _ in range(ALIGNED if catalogue()[free.label].place == CLOCK_PLACE else 1):
        if catalogue()[free.label].place == CLOCK_PLACE:
            begun.problem = aligned(begun.problem, begun.model(begun.hypotheses[0])[1])
        recompute_gains(begun, begun.hypotheses[0], 1.0)
        converge(begun.fitter, begun.hypotheses[0])
    return begun


def without_extra_noise(search: Search) -> Search:
    """A search that knows of disorder, with the case's own disturbance again."""
    problem = search.problem
    recorded = None if problem.recorded is None else replace(problem.recorded, extra_noise=None)
    return replace(search, problem=replace(problem, extra_noise=None, recorded=recorded))


def gains_of(problem: Problem, model: tuple[np.ndarray, np.ndarray], process_noise_scale: float) -> Gains:
    """Gains of a filter with a model."""
    gains = problem.filter(*model, process_noise_scale=process_noise_scale, begin=True)
    return gains if problem.rules.splice else problem.open_loop_gains(gains)


def recompute_gains(search: Search, at: Hypothesis, process_noise_scale: float) -> None:
    """New gains and a new fitter at a hypothesis; all hypotheses are taken over."""
    problem = search.problem
    search.gains = gains_of(problem, search.model(at), process_noise_scale)
    search.fitter = Fitter(problem, search.gains, search.nuisance, at, temper=True)
    search.hypotheses = transfer(search.fitter, search.hypotheses)
    search.null = transfer(search.fitter, [search.null])[0]
    search.fitter.measure(search.hypotheses)
    converge(search.fitter, search.null, 1 if len(at.labels) > 1 else 6)


def first_round(search: Search) -> None:
    """Every label tried in the filter with the largest process noise, and the likely ones led on to the vehicle's own
    disturbance.
    """
    fitter, null = search.fitter, search.null
    fitter.linearise([null])
    tried = screen(search, null, HYPOTHESES_TRIED)
    converge(fitter, null)
    fitter.move(tried)
    try_distant_starts(fitter, tried)
    for _ in range(SETTLING):
        fitter.advance(tried)
    kept = prune(tried, null.misfit, KEPT, KEPT)
    search.hypotheses = advance_and_prune(fitter, kept, null.misfit, KEPT, 3 - SETTLING)
    recompute_gains(search, min([*search.hypotheses, search.null], key=lambda c: c.misfit), PROCESS_NOISE_SCALES[1])
    search.hypotheses = advance_and_prune(search.fitter, search.hypotheses, search.null.misfit, LEFT, 3)


def take_over(search: Search, before: Sequence[Hypothesis]) -> None:
    """Hypotheses of another search over the same runs, kept and fitted here; less what stands in the model.

    Gains are made anew at the one that a filter of its own misses least with, where that is none of this search's: far
    from it they say nothing of it.
    """
    found: list[Hypothesis] = []
    for known in before:
        kept = [k for k, free in enumerate(known.free) if free.label in search.parameters]
        labels = tuple(label for label in known.labels if label in search.parameters)
        if labels and not any(set(labels) == set(c.labels) for c in [*search.hypotheses, *found]):
            free, values = [known.free[k] for k in kept], known.values[kept]
            found.append(search.fitter.hypothesis(labels, free, values, known.nuisance))
    if not found:
        return
    alone = search.best
    missed = [search.problem.filter(*search.model(one), begin=True).misfit.sum() for one in (alone, *found)]
    search.hypotheses += found
    search.fitter.measure(found)
    if np.argmin(missed) > 0:
        recompute_gains(search, found[int(np.argmin(missed)) - 1], 1.0)
        search.hypotheses = advance_and_prune(search.fitter, search.hypotheses, search.null.misfit, 2 * LEFT, 3)
    else:
        for one in found:
            converge(search.fitter, one)
    if search.best.labels != alone.labels:
        relinearise(search, 1)


def run(
    problem: Problem, say: Callable[[str], None] = lambda text: None, clock: ClockModel | None = None,
    before: Sequence[Hypothesis] = (),
) -> Search:  # fmt: skip
    """The search over a problem's runs.

    clock: the effect of motion capture's clock, where that is certain; before: what another search over these runs came
    to, by a filter that knew less of disorder. Allowed parameters driven to their limits may hide it from the screen.
    """
    noise = levels.sensor_noise(problem, 1.0 / DIAGNOSIS.noise_factor, DIAGNOSIS.noise_factor)
    well_specified = noise_matches_file(problem, noise)
    problem = noise.believed(well_specified).applied(problem)
    problem = problem if clock is None else clock.within(problem)
    free, known = nuisance_parameters(problem), effect_parameters(problem)
    if clock is not None:
        del known[clock.label]
    P, F = model_at(problem, free, np.zeros(len(free)))
    gains = gains_of(problem, (P, F), PROCESS_NOISE_SCALES[0])
    fitter = Fitter(problem, gains, free, temper=True)
    null = fitter.hypothesis((), [])
    fitter.measure([null])
    search = Search(problem, free, known, fitter, null, [], gains, clock, well_specified)
    if clock is None and start_at_inconsistent_sensor(search):
        say(f"sensors inconsistent: {search.hypotheses[0].labels[0]}")
    else:
        first_round(search)
        say(f"screened {len(known)} labels")
    for _ in range(ROUNDS):
        relinearise(search, POLISHED[1])
        first = search.best.labels
        rescreen(search)
        if search.best.labels == first:
            break
    say(f"best candidate with one effect: {' '.join(search.best.labels) or 'none'}")
    take_over(search, before)
    grow(search, say)
    if level_disturbance(search):
        grow(search, say)
    converge(search.fitter, search.null)
    return search


def grow(search: Search, say: Callable[[str], None]) -> None:
    """Effects added one by one to the best hypothesis, as long as each brings the evidence that is needed."""
    for count in range(max(2, len(search.best.labels) + 1), MOST_EFFECTS + 1):
        before = search.best
        if count > 3 and search.fitter.temperature > FAR_OFF:
            break
        if len(before.labels) < count - 1 or not add_effects(search, count):
            break
        if count > 2:
            listed = [c for c in search.ranked() if len(c.labels) >= count - 1][:SHORT_LIST]
            search.hypotheses = listed if any(c is before for c in listed) else [*listed, before]
        relinearise(search, POLISHED.get(count, 1))
        say(f"best candidate with up to {count} effects: {' '.join(search.best.labels)}")
        fewer = [c.log_evidence(search.fitter) for c in search.hypotheses if len(c.labels) < count]
        least = max(fewer, default=-np.inf)
        if search.best.log_evidence(search.fitter) < least + DIAGNOSIS.evidence_needed:
            break


def noise_matches_file(problem: Problem, noise: levels.Levels) -> float:
    """Probability that the noise of all sensors is what the file says, as likely as not before they are looked at.

    One whose noise cannot be found says against it what one that is found exactly as the file says speaks for it.
    """
    silent = sum(problem.seen[part].any() for part in levels.SENSORS.values()) - len(noise.names)
    return float(expit(noise.odds.sum() - silent * np.log(DIAGNOSIS.noise_free / DIAGNOSIS.noise_accurate)))


def level_disturbance(search: Search) -> bool:
    """The disturbance's level at the best hypothesis, and all taken over to it; whether it is another than before.

    The level is found only here: a model that lacks an effect would have it in its disturbance. Of an effect that
    nobody knows it has that also then: as far as every sensor's noise is what the file says, the disturbance is too.
    Nothing jumps: a small change, and one beyond what is believed, count by degrees.
    """
    problem = search.problem
    if (1.0 - search.well_specified) * np.log(DIAGNOSIS.noise_factor) < LEAST_LOG_LEVEL:
        return False
    plain = replace(problem, spectral=levels.as_said(problem).spectral)
    now = levels.disturbance(plain)
    if not now.names:
        return False
    factors = levels.factors(problem)
    before = np.log([factors[name] for name in now.names])
    model = search.model(min([search.null, search.best], key=lambda c: c.misfit))
    found = levels.estimate(plain, lambda p: p.filter(*model, begin=True), now.moved(before), LEVEL_ROUNDS)
    most = DIAGNOSIS.noise_factor
    log = np.clip(found.log, np.log(1.0 / most), np.log(most)) * (1.0 - search.well_specified)
    log *= [1.0 - opened(one, most, DIAGNOSIS.noise_factor_rejected**2 / most) for one in np.exp(found.log)]
    change = log - before
    change *= opened(float(np.abs(change).max()), LEAST_LOG_LEVEL)
    if not change.any():
        return False
    search.problem = now.moved(change).applied(problem)
    recompute_gains(search, search.best, 1.0)
    search.hypotheses = advance_and_prune(search.fitter, search.hypotheses, search.null.misfit, 2 * LEFT, 1)
    return True


def rescreen(search: Search) -> None:
    """Labels tried again at full weight beside no effect: a filter that expects a rough disturbance hides weak ones."""
    if search.fitter.prior_weight > HOLDS_BELOW or search.null.misfit / len(search.null.e) > HOLDS_BELOW:
        return
    search.fitter.linearise([search.null])
    there = {c.labels for c in search.hypotheses}
    new = [c for c in screen(search, search.null, LEFT) if c.labels not in there]
    if not new:
        return
    first_step(search.fitter, new)
    search.hypotheses = advance_and_prune(search.fitter, [*search.hypotheses, *new], search.null.misfit, 2 * LEFT, 3)


def relinearise(search: Search, times: int) -> None:
    """Gains and columns at the best hypothesis, and all led on; again while that one is far away."""
    for _ in range(times):
        recompute_gains(search, min([*search.hypotheses, search.null], key=lambda c: c.misfit), 1.0)
        search.hypotheses = advance_and_prune(search.fitter, search.hypotheses, search.null.misfit, 2 * LEFT, 3)
        if search.fitter.prior_weight < NEARLY_UNTEMPERED:
            break


def add_effects(search: Search, count: int) -> bool:
    """Further effects beside the leading hypotheses of one effect less; False where none is expected to gain."""
    leading = [c for c in search.ranked() if len(c.labels) == count - 1][: LEADING if count == 2 else 1]
    search.fitter.linearise(leading)
    more: dict[tuple[str, ...], Hypothesis] = {}
    for n, hypothesis in enumerate(leading):
        tried = screen(search, hypothesis, PARTNERS_TRIED if count == 2 else FURTHER_EFFECTS_TRIED)
        if n == 0 and (not tried or tried[0].expected_evidence() - hypothesis.expected_evidence() < PARTNER_EVIDENCE):
            return False
        more |= {tuple(sorted(c.labels)): c for c in tried}
    found = list(more.values())
    first_step(search.fitter, found)
    worst = min(c.misfit for c in leading)
    few = count > 2  # the best one only is led further, with gains of its own
    search.hypotheses += advance_and_prune(search.fitter, found, worst, SHORT_LIST if few else LEFT, 1 if few else 3)
    return True
