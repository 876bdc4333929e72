"""From fits to an answer: which effects earn their place, how probable each label is, and what cannot be told apart."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sim_backend.effects.catalogue import catalogue
from tools.diagnose.doubt import UNCLEAN, clock_label, disorder, doubt, left_share, what_is_left
from tools.diagnose.probes import CLOCK, UNPREDICTABLE, Probed, raised
from tools.diagnose.residuals import Finding, tests, worst
from tools.diagnose.search import Search, run, settle
from tools.diagnose.shrink import Shrinkage, left_out_gap, shrink
from tools.inference.candidates import CLOCK_PLACE
from tools.inference.fit import Course

NONE, UNKNOWN = "none", "unknown"
PRIOR_NONE = 0.5  # before anything was measured; the labels share the rest
SHOWN = 0.3  # of the gap that is left on runs left out: an effect beside another must close as much more
EARNED = 12.0  # nat of evidence that an effect brings, or it is left out (docs/DIAGNOSIS.md, Thresholds)
TIE = 6.0  # nat within which two labels are not told apart: what a change of prior spreads can move
MOST_GROUP = 3
MISTAKEN = 0.03  # answers that named something else altogether, of those to the cases it was developed with: 3 of 104
CERTAIN = 0.9  # of the recalibrated gap: effects beside an unknown one that leave more are not certain
SHAPES = ("variance", "mean", "lag", "spectrum")  # tests of a channel by itself; the others go with something


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
    unexplained: float  # of the squared gap beyond the floor, the share that the selected effects leave
    gained: dict[str, float]  # nat that each selected effect brings
    freed: list[Probed]  # links of the chain, beyond the selected effects; empty where nothing is left
    noise: Probed | None  # turbulence, waves or motion capture's clock, where the search was told of them
    shrinkage: Shrinkage


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


def clock_of(search: Search, course: Course, gained: dict[str, float]) -> Course | None:
    """Of a candidate the effect of motion capture's clock that brings most, as it stands; None where it has none."""
    labels = sorted((label for label in gained if catalogue()[label].place == CLOCK_PLACE), key=lambda n: -gained[n])
    if not labels:
        return None
    kept = np.array([f.label == labels[0] for f in course.free])
    return search.fitter.course((labels[0],), [f for f in course.free if f.label == labels[0]], course.values[kept])


def earned_outside(search: Search, course: Course) -> dict[str, float]:
    """By how much the gap on runs left out grows without each effect, the rest fitted anew, over the gap with it.

    The root of the difference of squares; 0 where it does not grow. An effect below SHOWN is a detail that the data can
    see and nobody needs: the wrong form of another one, a sample's worth of delay.
    """
    whole = left_out_gap(search, course)
    found = {}
    for label in course.labels:
        without = left_out_gap(search, drop(search, course, label))
        found[label] = float(np.sqrt(max(without**2 - whole**2, 0.0)) / max(whole, 1e-6))
    return found


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
            outside = earned_outside(search, course)
            weakest = min(outside, key=lambda label: outside[label])
            if outside[weakest] >= SHOWN:
                return course, gains
        course = drop(search, course, weakest)
    return course, {}


def by_error(search: Search) -> tuple[Course, dict[str, float]]:
    """The candidate of one effect, or of none, with the least gap on runs left out: what evidence is compared with."""
    tried = [search.null, *(course for course in search.courses if len(course.labels) == 1)]
    best = min(tried, key=lambda course: left_out_gap(search, course))
    return best, {label: best.log_evidence(search.fitter) for label in best.labels}


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


def told(search: Search, course: Course, gained: dict[str, float], found: Probed, say: Callable[[str], None]) -> Answer:
    """The answer of a further search, by a filter that knows of the disorder found."""
    problem, clock = search.problem, None
    more, _ = raised(problem, found.probe, found.scale)
    if found.probe.name == CLOCK:
        clock = clock_of(search, course, gained)
    begin = problem.as_recorded if clock is None else problem
    return conclude(run(begin.telling(more), say, clock), say, found)


def conclude(search: Search, say: Callable[[str], None] = lambda text: None, noise: Probed | None = None) -> Answer:
    """The answer of a finished search; its gains are taken anew at the selected model.

    `noise` is disorder that the search was already told of: turbulence, waves, or motion capture's clock.
    """
    problem = search.problem
    course, gained = thin(search) if problem.rules.evidence else by_error(search)
    search.courses = [c for c in search.courses if c is not course] + ([course] if course.labels else [])
    search.gains = problem.filter(*search.model(course), begin=True)
    findings = tests(problem, search.gains)
    unclean, left = worst(findings), None
    if unclean >= UNCLEAN and problem.rules.whiteness:
        left = what_is_left(search, course, noise)
        found = disorder(search, left) if noise is None else None
        if found is not None:
            return told(search, course, gained, found, say)
    disordered = ""  # its label
    if noise is not None:
        disordered = clock_label(search, course) if noise.probe.name == CLOCK else noise.probe.name
        gained = gained | {disordered: gained.get(disordered, 0.0) + noise.gain}
    main = max(gained, key=lambda label: gained[label]) if gained else ""
    if disordered in UNPREDICTABLE:
        main = disordered
    by_search = problem.rules.evidence and not (noise is not None and main == disordered)
    chances = posterior(search, course, main) if by_search else {main or NONE: 1.0}
    shrinkage = shrink(search, course)
    unknown = doubt(search, main, shrinkage, left, noise is not None)
    chances = {name: value * (1.0 - unknown) for name, value in chances.items()} | {UNKNOWN: unknown}
    chances = admit_mistakes({label: 0.0 for label in catalogue()} | chances, main)
    # A label that has not earned its place is none.
    top = max((NONE, UNKNOWN, *gained), key=lambda name: chances.get(name, 0.0))
    groups = grouped(rivals(search, course, main)) if by_search else {main: [main]}
    if top == UNKNOWN and course.labels and shrinkage.after > CERTAIN * shrinkage.recalibrated:
        course, shrinkage = search.null, shrink(search, search.null)
        gained = {label: gain for label, gain in gained.items() if label == disordered}
    return Answer(
        search=search, selected=sorted(gained, key=lambda label: (label != main, -gained[label])), main=top,
        probabilities=chances, groups=groups, course=course, null=search.null, findings=findings, unclean=unclean,
        unexplained=left_share(shrinkage), gained=gained, freed=[] if left is None else left.freed, noise=noise,
        shrinkage=shrinkage,
    )  # fmt: skip


def admit_mistakes(chances: dict[str, float], main: str) -> dict[str, float]:
    """Probabilities of which MISTAKEN goes to all labels: the search may have lost the true one on its way.

    Half of it to those at the place of the main one, which an effect in another form is taken for soonest.
    """
    labels = catalogue()
    beside = [name for name, effect in labels.items() if main and effect.place == labels[main].place and name != main]
    shares = dict.fromkeys(labels, (0.5 if beside else 1.0) * MISTAKEN / len(labels))
    for name in beside:
        shares[name] += 0.5 * MISTAKEN / len(beside)
    return {name: (1.0 - MISTAKEN) * value + shares.get(name, 0.0) for name, value in chances.items()}


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


def strongest_left(findings: list[Finding]) -> tuple[Finding | None, Finding | None]:
    """The strongest finding, and the strongest that says what it goes with, in the same channel if that has one.

    None where they are too weak.
    """
    strong = [f for f in findings if abs(f.sigma) >= UNCLEAN]
    if not strong:
        return None, None
    goes = sorted(
        (f for f in strong if not f.test.startswith(SHAPES)),
        key=lambda f: (f.channel != strong[0].channel, -abs(f.sigma)),
    )
    return strong[0], goes[0] if goes else None
