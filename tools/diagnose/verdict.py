"""From fits to an answer: which effects are selected, how probable each label is, and which cannot be distinguished."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.diagnose.descent import advance_and_prune, converge, first_step
from glider.tools.diagnose.gates import mixed, opened
from glider.tools.diagnose.materiality import excess_noise_is_material, gap_is_material, movements
from glider.tools.diagnose.noise_probes import CLOCK, TURBULENCE, ProbeResult, inflated
from glider.tools.diagnose.probabilities import (
    answer_first,
    doubt_small,
    grouped,
    mix_in_error_rate,
    softmax,
    to_none,
)
from glider.tools.diagnose.record import NONE, UNKNOWN, FindingRecord
from glider.tools.diagnose.residuals import tests, worst
from glider.tools.diagnose.search import Search, run, screen
from glider.tools.diagnose.shrink import (
    Shrinkage,
    ablation_importance,
    case_noise_floor,
    in_tolerances,
    left_out_squares,
    most_often,
    shrink,
)
from glider.tools.diagnose.unknown import (
    clock_label,
    clock_of,
    disorder,
    left_floors,
    left_share,
    probability_unknown,
    remainder_of,
    turbulence_first,
)
from glider.tools.inference.fit import Hypothesis
from glider.tools.inference.hyperparameters import DIAGNOSIS
from glider.tools.inference.parameters import CLOCK_PLACE

RIVALS = 5  # further labels fitted in the place of the main one, where it stands beside others


@dataclass
class Answer:
    """What the search comes to."""

    search: Search  # the one that the answer rests on
    selected: list[str]  # most of the gap first
    main: str  # label out of `selected`, NONE or UNKNOWN: the most probable
    probabilities: dict[str, float]  # of the main cause; NONE and UNKNOWN among them
    groups: dict[str, list[str]]
    hypothesis: Hypothesis  # the corrected model
    null: Hypothesis  # recalibrated
    findings: list[FindingRecord]
    whiteness: float  # sigma of what is left, corrected for the number of tests
    unexplained: float  # of the squared gap beyond the floor, the share that the selected effects leave
    gained: dict[str, float]  # nat that each selected effect brings
    negligible: dict[str, float]  # nat of effects that are there, but are not material
    probed: list[ProbeResult]  # beyond the selected effects; empty where nothing is left
    noise: ProbeResult | None  # turbulence, waves or motion capture's clock, where the search knew of it
    shrinkage: Shrinkage


def drop(search: Search, hypothesis: Hypothesis, label: str) -> Hypothesis:
    """The hypothesis without one of its effects, fitted."""
    labels = tuple(one for one in hypothesis.labels if one != label)
    for known in search.hypotheses:
        if set(known.labels) == set(labels):
            return known
    if not labels:
        return search.null
    keep = np.array([f.label != label for f in hypothesis.free])
    less = search.fitter.hypothesis(
        labels, [f for f in hypothesis.free if f.label != label], hypothesis.values[keep], hypothesis.nuisance
    )
    search.fitter.measure([less])
    converge(search.fitter, less, 4)
    search.hypotheses.append(less)
    return less


@dataclass(frozen=True)
class HeldOutImportance:
    """What each effect of a hypothesis takes off the gap on runs left out, the rest fitted anew without it."""

    whole: np.ndarray  # (runs,) squared gaps with all of them
    taken: dict[str, np.ndarray]  # by label, (runs,): by how much the squares grow without it

    def tolerances(self, label: str) -> float:
        """The root of the mean; 0 where the gap does not grow."""
        return in_tolerances(self.taken[label])

    def share(self, label: str) -> float:
        """The same over the gap with all of them.

        An effect below `held_out_share` is a detail that the data can see and nobody needs: the wrong form of another
        one, a sample's worth of delay.
        """
        return self.tolerances(label) / max(float(np.sqrt(self.whole.mean())), 1e-6)


def held_out_importance(search: Search, hypothesis: Hypothesis) -> HeldOutImportance:
    """What each effect of a hypothesis is worth on runs left out."""
    whole = left_out_squares(search, hypothesis)
    taken = {
        label: left_out_squares(search, drop(search, hypothesis, label)) - whole for label in hypothesis.labels
    }  # fmt: skip
    return HeldOutImportance(whole, taken)


def rank_by_importance(search: Search, hypothesis: Hypothesis, taken: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """What effects take (`ablation_importance`), by which they are ranked: of one that is worth less, the geometric
    mean.

    What a parameter makes up for nearly, as a drag coefficient does for a drag, is soon believed beside a main cause.
    """
    if len(hypothesis.labels) < 2:
        return taken
    importance = held_out_importance(search, hypothesis)
    found = dict(taken)
    for label in hypothesis.labels:
        size = in_tolerances(taken[label])
        found[label] = taken[label] * min(importance.tolerances(label) / max(size, 1e-9), 1.0)
    return found


def nuisance_prior_cost(hypothesis: Hypothesis, less: Hypothesis) -> float:
    """Nat of prior that what is allowed loses where it has to make up for an effect that another hypothesis lacks."""
    return 0.5 * float((less.nuisance**2).sum() - (hypothesis.nuisance**2).sum())


def prune_effects(search: Search, hypothesis: Hypothesis) -> tuple[Hypothesis, dict[str, float]]:
    """Backward elimination: a hypothesis without what does not earn its place; nat that each effect brings."""
    while hypothesis.labels:
        gains = {
            label: hypothesis.log_evidence(search.fitter) - drop(search, hypothesis, label).log_evidence(search.fitter)
            for label in hypothesis.labels
        }
        weakest = min(gains, key=lambda label: gains[label])
        if gains[weakest] >= DIAGNOSIS.evidence_needed:
            if len(hypothesis.labels) == 1:
                return hypothesis, gains
            outside = held_out_importance(search, hypothesis)
            idle = [
                label for label in hypothesis.labels
                if outside.share(label) < DIAGNOSIS.held_out_share
                and nuisance_prior_cost(hypothesis, drop(search, hypothesis, label)) < DIAGNOSIS.evidence_needed
            ]  # fmt: skip
            if not idle:
                return hypothesis, gains
            weakest = min(idle, key=outside.tolerances)
        hypothesis = drop(search, hypothesis, weakest)
    return hypothesis, {}


def by_held_out_gap(search: Search) -> tuple[Hypothesis, dict[str, float]]:
    """The hypothesis of one effect, or of none, with the least gap on runs left out: what evidence is compared with."""
    tried = [search.null, *(hypothesis for hypothesis in search.hypotheses if len(hypothesis.labels) == 1)]
    best = min(tried, key=lambda hypothesis: float(left_out_squares(search, hypothesis).mean()))
    return best, {label: best.log_evidence(search.fitter) for label in best.labels}


def try_rivals(search: Search, hypothesis: Hypothesis, main: str) -> None:
    """The labels that promise most in the place of the main one, beside the others, fitted."""
    others = drop(search, hypothesis, main)
    search.fitter.linearise([others])
    there = [set(known.labels) for known in search.hypotheses]
    new = [c for c in screen(search, others, RIVALS + 1) if set(c.labels) not in there]
    if new:
        first_step(search.fitter, new)
        search.hypotheses += advance_and_prune(search.fitter, new, others.misfit, RIVALS, 2)


def alternatives(search: Search, hypothesis: Hypothesis, main: str) -> dict[str, Hypothesis]:
    """The hypothesis of every label in the place of the main one, beside the others that were selected."""
    others = tuple(label for label in hypothesis.labels if label != main)
    found = {main: hypothesis} if main else {}
    for known in search.hypotheses:
        if others and not set(others) <= set(known.labels):
            continue
        rest = [label for label in known.labels if label not in others]
        if len(rest) == 1 and len(known.labels) == len(others) + 1:
            rival = found.setdefault(rest[0], known)
            if known.log_evidence(search.fitter) > rival.log_evidence(search.fitter):
                found[rest[0]] = known
    return found


def evidence_of_alternatives(search: Search, hypothesis: Hypothesis, main: str) -> dict[str, float]:
    """Log evidence of every label in the place of the main one."""
    return {label: one.log_evidence(search.fitter) for label, one in alternatives(search, hypothesis, main).items()}


def search_again_with_noise(
    search: Search, hypothesis: Hypothesis, gained: dict[str, float], found: ProbeResult, say: Callable[[str], None]
) -> Answer:
    """The answer of a further search, by a filter that knows of the disorder found.

    Where another effect is the main cause beside rough water, it is none: what nobody knows looks like rough water too,
    in which a known effect is easily believed. The answer is then the one without it. Rough water is looked for beside
    a clock that wanders, too.
    """
    more, _ = inflated(search.problem, found.probe, found.scale)
    clock = clock_of(search, hypothesis, gained, more) if found.probe.name == CLOCK else None
    problem = search.problem.as_recorded if clock is None else clock.aligned(search.problem)
    answer = conclude(run(problem.with_extra_noise(more), say, clock, [search.best, hypothesis]), say, found)
    if found.probe.name == TURBULENCE and answer.main != TURBULENCE:
        say("rough water is not the main cause")
        return conclude(search, say, calm=True)
    water = turbulence_first(answer.probed) if found.probe.name == CLOCK else None
    if water is not None and left_floors(answer.shrinkage) > DIAGNOSIS.own_size:
        more = more + inflated(answer.search.problem, water.probe, water.scale)[0]
        noisy = conclude(run(problem.with_extra_noise(more), say, clock, [answer.search.best]), say, water)
        if noisy.main == TURBULENCE:
            clocks = [label for label in answer.selected if catalogue()[label].place == CLOCK_PLACE]
            gained = noisy.gained | {label: answer.gained[label] for label in clocks}
            return replace(noisy, selected=[*noisy.selected, *clocks], gained=gained)
    return answer


def conclude(
    search: Search, say: Callable[[str], None] = lambda text: None, noise: ProbeResult | None = None,
    calm: bool = False,
) -> Answer:  # fmt: skip
    """The answer of a finished search; its gains are taken anew at the hypothesis with all that is evident.

    `noise` is disorder that the search already knows of: turbulence, waves, or motion capture's clock; calm: none is
    looked for.
    """
    problem = search.problem
    evident, gained = prune_effects(search, search.best) if problem.rules.evidence else by_held_out_gap(search)
    search.hypotheses = [c for c in search.hypotheses if c is not evident] + ([evident] if evident.labels else [])
    search.gains = problem.filter(*search.model(evident), begin=True)
    findings = tests(problem, search.gains)
    whiteness, left = worst(findings), None
    if whiteness >= DIAGNOSIS.residual_sigma and problem.rules.whiteness:
        left = remainder_of(search, evident, noise, whiteness)
        found = disorder(search, evident, left) if noise is None and not calm else None
        if found is not None:
            return search_again_with_noise(search, evident, gained, found, say)
    moved = movements(search, evident)
    small = [label for label in evident.labels if moved[label] < DIAGNOSIS.material]
    selected = evident
    for label in small:
        selected = drop(search, selected, label)
    shrinkage = shrink(search, selected)
    disordered = ""  # its label
    if noise is not None:
        disordered = clock_label(search, evident) if noise.probe.name == CLOCK else noise.probe.name
        gained = gained | {disordered: gained.get(disordered, 0.0) + noise.gain}
        if moved.get(disordered, 0.0) >= DIAGNOSIS.material or excess_noise_is_material(search, selected, shrinkage):
            small = [label for label in small if label != disordered]
        elif disordered not in small:
            small.append(disordered)
    negligible = {label: gained.pop(label) for label in small}
    taken = ablation_importance(search, evident)
    floor = case_noise_floor(search, selected)["total"] if disordered else shrinkage.floor
    if disordered and disordered not in taken:
        taken[disordered] = np.full(len(problem.runs), max(shrinkage.after**2 - floor**2, 0.0))
    ranked = gained or negligible
    sizes = {label: in_tolerances(squares) for label, squares in taken.items()}
    ranking = rank_by_importance(search, evident, taken)
    by_size = sorted(ranked, key=lambda label: -in_tolerances(ranking[label]))
    main = by_size[0] if ranked else ""
    by_search = problem.rules.evidence and not (noise is not None and main == disordered)
    if by_search and len(evident.labels) > 1:
        try_rivals(search, evident, main)
    chances = {main or NONE: 1.0}
    if by_search:
        by_evidence = posterior(search, evident, main)
        by_gap, ahead = with_least_gap(search, evident, main, by_evidence)
        chances = mixed(by_evidence, by_gap, ahead)
    known = {label: moved[label] for label in gained if label in moved and label != disordered}
    chances = to_none(chances, negligible, known)
    if main in gained:
        floors = sizes[main] / max(floor, 1e-6)
        small_ones, alone = (
            doubt_small(chances, main, floors / size) for size in (DIAGNOSIS.own_size, DIAGNOSIS.specified_main_size)
        )
        chances = mixed(small_ones, alone, search.well_specified)
    by_effects = sum(sizes[label] ** 2 for label in gained)
    places = [catalogue()[label].place for label in ranked if label in catalogue()]
    unknown = probability_unknown(search, bool(ranked), shrinkage, left, noise, by_effects, places)
    if not gained:
        unknown = DIAGNOSIS.least_unknown + (unknown - DIAGNOSIS.least_unknown) * gap_is_material(shrinkage)
    chances = {name: value * (1.0 - unknown) for name, value in chances.items()} | {UNKNOWN: unknown}
    likely = main if main in gained else ""
    chances = mix_in_error_rate({label: 0.0 for label in catalogue()} | chances, likely, evident.labels)
    top, chances = answer_first(chances, gained)
    if top == NONE or (top == UNKNOWN and shrinkage.after > DIAGNOSIS.kept_gap_share * shrinkage.recalibrated):
        gained = {label: gain for label, gain in gained.items() if label == disordered and top == UNKNOWN}
        if selected.labels:
            selected, shrinkage = search.null, shrink(search, search.null)
    groups = grouped(log_posteriors(search, evident, main)) if by_search else {main: [main]}
    return Answer(
        search=search, selected=[label for label in by_size if label in gained], main=top,
        probabilities=chances, groups=groups, hypothesis=selected, null=search.null, findings=findings,
        whiteness=whiteness, unexplained=left_share(shrinkage, by_effects), gained=gained, negligible=negligible,
        probed=[] if left is None else left.probed, noise=noise, shrinkage=shrinkage,
    )  # fmt: skip


def with_least_gap(
    search: Search, hypothesis: Hypothesis, main: str, chances: dict[str, float]
) -> tuple[dict[str, float], float]:
    """Probabilities where labels have more evidence than the main one, in its place: as often as each leaves the least.

    The least of the gap on runs left out, by bootstrap over runs. Small effects that are there beside a large one can
    have more nats than it where noise is not what the file says, and take nothing of its gap. And how far they are
    ahead: 0 where they have no more, 1 where as much more as parts two labels.
    """
    found = alternatives(search, hypothesis, main)
    ahead = [label for label in found if chances.get(label, 0.0) > chances.get(main, 0.0)]
    if not main or not ahead:
        return chances, 0.0
    least = most_often({label: -left_out_squares(search, found[label]) for label in (main, *ahead)})
    together = sum(chances.get(label, 0.0) for label in least)
    most = max(chances[label] for label in ahead)
    by_gap = chances | {label: together * share for label, share in least.items()}
    return by_gap, opened(most / max(chances.get(main, 0.0), 1e-300), 1.0, float(np.exp(DIAGNOSIS.confounded_evidence)))


def log_posteriors(search: Search, hypothesis: Hypothesis, main: str) -> dict[str, float]:
    """Log posterior of each label in the place of the main one, up to a constant: that of none is its log evidence."""
    return {
        label: value - DIAGNOSIS.evidence_needed
        for label, value in evidence_of_alternatives(search, hypothesis, main).items()
    }


def posterior(search: Search, hypothesis: Hypothesis, main: str) -> dict[str, float]:
    """Probabilities of the labels and of none, as if there were nothing unknown."""
    logs = log_posteriors(search, hypothesis, main)
    bare = drop(search, hypothesis, main) if main else search.null
    logs[NONE] = bare.log_evidence(search.fitter)
    return softmax(logs)
