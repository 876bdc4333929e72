"""From fits to an answer: which effects earn their place, how probable each label is, and what cannot be told apart."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from sim_backend.effects.base import catalogue
from tools.gap.fit import Course
from tools.gap.measure import root_mean_square, run_gap
from tools.gap.probes import TURBULENCE, WAVES, Probed, probe_model, probes, raised
from tools.gap.problem import Gains, Problem, Scored, cut, fly_on
from tools.gap.residuals import Finding, tests, worst
from tools.gap.search import Search, run, settle

NONE, UNKNOWN = "none", "unknown"
PRIOR_NONE = 0.5  # before anything was measured; the labels share the rest
UNCLEAN = 6.0  # sigma, corrected for the number of tests
LEFT_OVER, LEFT_WIDTH = 0.2, 0.8  # share left at which unknown is as likely as not, and the width in e-folds
ONE_AXIS = 0.65  # of what all axes bring together: where one alone brings as much, it is no turbulence
MOSTLY = 0.9  # of all that can be explained, for turbulence or waves to be the cause
SHOWN = 0.3  # of the gap that is left: an effect beside another must move predictions by as much
EARNED = 12.0  # nat of evidence that an effect brings, or it is left out (docs/DIAGNOSIS.md, Thresholds)
TIE = 6.0  # nat within which two labels are not told apart: what a change of prior spreads can move
MOST_GROUP = 3


@dataclass
class Answer:
    """What the search comes to."""

    search: Search  # the one that the answer rests on
    selected: list[str]  # most of the gap first
    main: str  # label, NONE or UNKNOWN
    probabilities: dict[str, float]  # of the main cause; NONE and UNKNOWN among them
    groups: dict[str, list[str]]
    course: Course  # the corrected model
    null: Course  # recalibrated
    findings: list[Finding]
    unclean: float  # sigma of what is left, corrected for the number of tests
    unexplained: float  # share of what can be explained that the selected effects leave to an unknown one
    gained: dict[str, float]  # nat that each selected effect brings
    freed: list[Probed]  # links of the chain, beyond the selected effects; empty where nothing is left
    noise: Probed | None  # turbulence or waves, where they are the cause


def drop(search: Search, course: Course, label: str) -> Course:
    """The candidate without one of its effects, fitted."""
    labels = tuple(one for one in course.labels if one != label)
    for known in search.courses:
        if set(known.labels) == set(labels):
            return known
    if not labels:
        return search.null
    keep = np.array([f.label != label for f in course.free])
    less = search.fitter.course(
        labels, [f for f in course.free if f.label != label], course.values[keep], course.allowed
    )
    search.fitter.measure([less])
    settle(search.fitter, less, 4)
    search.courses.append(less)
    return less


def shown(search: Search, course: Course) -> dict[str, float]:
    """How far dropping each effect, and fitting the rest anew, moves the windows' predictions, over what gap is left.

    Both in tolerances, root mean square over channels and runs, from the same starts. An effect below SHOWN is a
    detail that the data can see and nobody needs: the wrong form of another one, a sample's worth of delay.
    """
    problem = search.problem
    scored = cut(problem)
    P, F = search.model(course)
    gains = problem.filter(P, F, begin=True)
    whole = flight(problem, scored, P, F, gains)
    left = max(apart(problem, scored, whole, problem.z), 1e-6)
    found = {}
    for label in course.labels:
        without = flight(problem, scored, *search.model(drop(search, course, label)), gains)
        found[label] = apart(problem, scored, whole, without) / left
    return found


def flight(problem: Problem, scored: Scored, P: np.ndarray, F: np.ndarray, gains: Gains) -> np.ndarray:
    """The windows flown by a model from where the gains' filter stands; (rows, N_Y), NaN outside."""
    Y = np.full_like(problem.z, np.nan)
    fly_on(problem, scored, P, F, gains, Y)
    return Y


def apart(problem: Problem, scored: Scored, a: np.ndarray, b: np.ndarray) -> float:
    """The total gap between two tables (rows, N_Y), over the runs."""
    bounds = problem.recording.bounds
    totals = [
        run_gap(run, a[bounds[n] : bounds[n + 1]], scored.listed[n], b[bounds[n] : bounds[n + 1]]).total
        for n, run in enumerate(problem.runs)
    ]
    return root_mean_square(totals)


def thin(search: Search) -> tuple[Course, dict[str, float]]:
    """The best candidate without what does not earn its place, and what each of its effects brings."""
    course = search.best
    while course.labels:
        gains = {
            label: course.log_evidence(search.fitter) - drop(search, course, label).log_evidence(search.fitter)
            for label in course.labels
        }
        weakest = min(gains, key=lambda label: gains[label])
        if gains[weakest] >= EARNED:
            if len(course.labels) == 1:
                return course, gains
            visible = shown(search, course)
            weakest = min(visible, key=lambda label: visible[label])
            if visible[weakest] >= SHOWN:
                return course, gains
        course = drop(search, course, weakest)
    return course, {}


def instead(search: Search, course: Course, main: str) -> dict[str, float]:
    """Log evidence of every label in the place of the main one, beside the others that were selected."""
    others = tuple(label for label in course.labels if label != main)
    found = {main: course.log_evidence(search.fitter)} if main else {}
    for known in search.courses:
        if others and not set(others) <= set(known.labels):
            continue
        rest = [label for label in known.labels if label not in others]
        if len(rest) == 1 and len(known.labels) == len(others) + 1:
            value = known.log_evidence(search.fitter)
            found[rest[0]] = max(value, found.get(rest[0], -np.inf))
    return found


def softmax(logs: dict[str, float]) -> dict[str, float]:
    top = max(logs.values())
    weights = {name: float(np.exp(value - top)) for name, value in logs.items()}
    total = sum(weights.values())
    return {name: weight / total for name, weight in weights.items()}


def unknown_chance(unclean: float, unexplained: float) -> float:
    """Probability that what is left is a gap of its own (docs/DIAGNOSIS.md, Thresholds)."""
    if unclean < UNCLEAN:
        return 0.002
    z = (np.log(max(unexplained, 1e-6)) - np.log(LEFT_OVER)) / LEFT_WIDTH
    return float(np.clip(norm.cdf(z), 0.005, 0.995))


def gaps_left(search: Search, course: Course) -> tuple[float, float, list[Probed]]:
    """Nat that the selected effects bring over no effect, that a freed link would bring beyond them, and all links."""
    problem = search.problem
    null = float(problem.filter(*search.model(search.null), begin=True).misfit.sum())
    own = float(search.gains.misfit.sum())
    freed = probe_model(problem, *search.model(course), probes(problem))
    return 0.5 * (null - own), freed[0].gain, freed


def scatter(search: Search) -> Probed | None:
    """Turbulence or waves, where water in disorder explains the recalibrated model's misfit better than any one link.

    Turbulence shakes every axis: where one alone brings most of it, something else shakes that axis.
    """
    freed = probe_model(search.problem, *search.model(search.null), probes(search.problem))
    first = freed[0]
    if first.probe.name == WAVES:
        return first
    axes = sorted((p.gain for p in freed if p.probe.stage == "force" and p.probe.name != TURBULENCE), reverse=True)
    return first if first.probe.name == TURBULENCE and axes[0] < ONE_AXIS * first.gain else None


def conclude(search: Search, say: Callable[[str], None] = lambda text: None, noise: Probed | None = None) -> Answer:
    """The answer of a finished search; its gains are taken anew at the selected model.

    `noise` is turbulence or waves that the search was already told of.
    """
    course, gained = thin(search)
    search.courses = [c for c in search.courses if c is not course] + ([course] if course.labels else [])
    search.gains = search.problem.filter(*search.model(course), begin=True)
    findings = tests(search.problem, search.gains)
    unclean = worst(findings)
    freed: list[Probed] = []
    unexplained = 0.0
    if unclean >= UNCLEAN:
        brought, left, freed = gaps_left(search, course)
        brought = max(brought, 0.0) + (noise.gain if noise is not None else 0.0)
        unexplained = float(np.clip(left / max(left + brought, 1e-9), 0.0, 1.0))
        if noise is None and unexplained > LEFT_OVER:
            found = scatter(search)
            if found is not None and found.gain > MOSTLY * (brought + left):
                more, _ = raised(search.problem, found.probe, found.scale)
                rough = replace(search.problem, spectral=search.problem.spectral + more)
                return conclude(run(rough, say), say, found)
    main = max(gained, key=lambda label: gained[label]) if gained else ""
    chances = posterior(search, course, main)
    if noise is not None:
        main = noise.probe.name
        chances = {name: 0.0 for name in chances} | {main: 1.0}
    unknown = unknown_chance(unclean, unexplained)
    chances = {name: value * (1.0 - unknown) for name, value in chances.items()} | {UNKNOWN: unknown}
    for label in catalogue():
        chances.setdefault(label, 0.0)
    top = max(chances, key=lambda name: chances[name])
    selected = sorted(gained, key=lambda label: -gained[label])
    groups = grouped(rivals(search, course, main))
    if noise is not None:
        selected, groups = [main, *selected], {main: [main]}
    return Answer(
        search,
        selected,
        top,
        chances,
        groups,
        course,
        search.null,
        findings,
        unclean,
        unexplained,
        gained,
        freed,
        noise,
    )


def rivals(search: Search, course: Course, main: str) -> dict[str, float]:
    """Log posterior of each label in the place of the main one, up to a constant."""
    prior = np.log((1.0 - PRIOR_NONE) / len(search.candidates))
    return {label: value + prior for label, value in instead(search, course, main).items()}


def posterior(search: Search, course: Course, main: str) -> dict[str, float]:
    """Probabilities of the labels and of none, as if there were nothing unknown."""
    logs = rivals(search, course, main)
    bare = drop(search, course, main) if main else search.null
    logs[NONE] = bare.log_evidence(search.fitter) + np.log(PRIOR_NONE)
    return softmax(logs)


def grouped(logs: dict[str, float]) -> dict[str, list[str]]:
    """For every label, those whose evidence these data cannot part from its own."""
    labels = sorted(logs, key=lambda name: -logs[name])
    return {
        label: [label, *(o for o in labels if o != label and abs(logs[o] - logs[label]) < TIE)][:MOST_GROUP]
        for label in labels
    }
