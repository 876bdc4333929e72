"""Hypotheses about the runs of a case, and how they are weighed: which effects there are, or something unknown.

The evidence of a hypothesis is that of its labels (posterior.py). What healthy sessions and runs differ by in a label
is no change; and with each hypothesis stands that more is left than healthy runs leave.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import brentq
from scipy.special import logsumexp

from glider.tools.inference.healthy_level import HealthyLevel
from glider.tools.inference.hyperparameters import HEALTHY
from glider.tools.inference.pooled import Scatter, marginalised
from glider.tools.own.effects import FORM, GROWTH, NOISE, OUTPUT, PARAMETER, PUSH, UNEXPLAINED, Effect
from glider.tools.own.excess_noise import NOISE_SIZES
from glider.tools.own.hierarchy import LEAST_REACH, ChannelErrors, Expansion

NONE, UNKNOWN = "none", "unknown"
WIDTHS = 1e-9, 1e3  # of a parabola that gains what its label does: variances over the squared size, from and to
SIZES = NOISE_SIZES  # tolerances, rms over the windows
# prior odds of a label to one of an input or an output: what is fixed of a vehicle changes less often than what is
# commanded and read; a force that no label has, seldom
FAMILY_ODDS = {PARAMETER: 0.5, NOISE: 0.5, PUSH: 0.1, GROWTH: 0.1}
DRIFT_ODDS = 0.1  # of an output, in one run: instruments drift over days, which in a run is a bias
ANOTHER = 0.1  # that a further effect stands beside one
STRANGE = 0.1  # that more is left than a hypothesis says
FORM_SHARES = (0.0, HEALTHY.form_error)  # as probable before the data
MATERIAL = 0.1  # tolerances: a smaller effect is no gap (docs/reference/gap.md)
GROUP_MASS, MOST_GROUP = 0.9, 3  # of the probability of causes, that a group holds; labels in it that are an answer


@dataclass(frozen=True)
class UsualLabels:
    """What healthy runs show of every label alone, beside what they differ by, in spreads (labels,)."""

    scatter: np.ndarray  # 1 sigma from run to run
    session: np.ndarray  # 1 sigma from session to session, beside it
    mean: np.ndarray  # of all runs
    error: np.ndarray  # 1 sigma of that

    def of_runs(self, k: int, runs: int, within: bool = False) -> tuple[float, float]:
        """Mean and variance of label k over some runs of a session; within: off what the session's other runs have of
        it."""
        mean, variance = (0.0, 0.0) if within else self.of_session(k)
        return mean, variance + float(self.scatter[k] ** 2) / runs

    def of_session(self, k: int) -> tuple[float, float]:
        """Mean and variance of what a session's runs have of label k in common."""
        return float(self.mean[k]), float(self.error[k] ** 2 + self.session[k] ** 2)


@dataclass(frozen=True)
class Healthy:
    """What is known of the vehicle without a change, in the spreads of `effects`."""

    effects: list[Effect]  # every label, then pushes
    V: np.ndarray  # (k, k) covariance of the identified values
    scatter: Scatter  # what runs differ by, integrated out
    session: Scatter  # what sessions differ by beside it
    usual: UsualLabels
    errors: ChannelErrors  # what healthy runs leave
    eta: float
    runs: int  # that it is known from
    level_scatter: float  # 1 sigma of the logarithm of a run's mean square left
    noise_gain: Mapping[str, float] = field(default_factory=dict)  # nat a window, of healthy runs; none: not weighed
    run_inflation: float = 1.0  # of the variance of shared values by the likelihood of runs
    sessions: int = 1  # of these runs

    def at(self, labels: Sequence[str]) -> list[int]:
        known = [one.label for one in self.effects]
        return [known.index(label) for label in labels]


@dataclass(frozen=True)
class Deviations:
    """What runs are off the identified vehicle by: what they have in common, and each its own."""

    V: np.ndarray  # (k, k)
    scatter: Scatter

    def marginal(self, found: Sequence[Expansion]) -> list[Expansion]:
        """Runs with their own deviations integrated out."""
        return [marginalised(one, self.scatter) for one in found]

    def prior(self, shared: np.ndarray, own: np.ndarray, places: Sequence[int]) -> float:
        """-2 log prior of values, sizes of labels left free."""
        free = np.diag(self.V) > 0.0
        free[list(places)] = False
        chosen = np.flatnonzero(free)
        x = shared[chosen]
        within = x @ np.linalg.solve(self.V[np.ix_(chosen, chosen)], x)
        return float(self.scatter.distance(own - shared).sum() + within)


@dataclass
class Hypothesis:
    """Labels fitted to the runs."""

    labels: tuple[str, ...]
    evidence: float  # log, with the prior of its labels
    sizes: np.ndarray  # (labels,) spreads
    sd: np.ndarray
    shared: np.ndarray  # (k,) values of all runs, labels' sizes in them
    own: np.ndarray  # (runs, k)
    left: np.ndarray  # (runs,) mean squares, in units of what healthy runs leave
    strange: float = 0.0  # probability that more is left than it says
    found: list[Expansion] = field(default_factory=list)
    everywhere: bool = False  # whether runs are expanded in all columns there, with their derivatives
    off: np.ndarray = field(default_factory=lambda: np.zeros(0))  # (labels,) of sizes, what the vehicle's own are off
    usual: float = 0.0  # nat that a usual deviation of one label more brings, by its parabola

    @property
    def changes(self) -> np.ndarray:
        """Sizes (labels,) beside what the vehicle's own numbers are off: what changed."""
        return self.sizes - self.off if len(self.off) else self.sizes

    def forget(self) -> None:
        """Nothing begins here any more: the derivatives, most of what is kept, go."""
        self.found = [replace(one, derivatives=None, filtered=None) for one in self.found]
        self.everywhere = False


@dataclass
class Posterior:
    """The answer."""

    hypotheses: list[Hypothesis]
    weights: np.ndarray  # of each, with nothing beside it
    chances: dict[str, float]  # none, unknown, labels: of the main cause
    reach: np.ndarray  # (k,) tolerances a spread
    healthy: Healthy

    @property
    def best(self) -> Hypothesis:
        return self.hypotheses[int(np.argmax(self.weights))]


def log_odds(effect: Effect) -> float:
    """Log prior odds of a label to one of an input or an output."""
    drifts = effect.family == OUTPUT and effect.kind == "drift"
    odds = effect.odds * (DRIFT_ODDS if drifts else FAMILY_ODDS.get(effect.family, 1.0))
    return float(np.log(odds)) if odds > 0.0 else -np.inf


def form_variance(healthy: Healthy, reach: float, moved: float) -> float:
    """Variance (spreads squared) of what a label seems to have, where the equations of effects beside it are not as
    they have it: of their mean square `moved` (tolerances squared) the share that a force at one noise has (`variance`
    in posterior.py), whichever label that looks like.

    reach: tolerances that a spread of the label moves the channels.
    """
    forces = sum(one.family == PUSH for one in healthy.effects)
    return HEALTHY.form_error**2 * moved / max(1, forces) / max(reach, LEAST_REACH) ** 2


def usual_share(
    healthy: Healthy, k: int, reach: float, size: float, sd: float, runs: int, moved: float = 0.0, gain: float = np.inf,
    within: bool = False,
) -> float:  # fmt: skip
    """Nat of the evidence of label k, its size known to sd, that a deviation as healthy runs have it, and the form of
    effects beside it, bring too, by a parabola: one that gains `gain` nat, as the label does (none given: one of sd).

    reach: tolerances that a spread of it moves the channels; moved: mean square that those effects move them by;
    within: what other runs of the session have in common of the label is no part of its size.
    """
    mean, usual = healthy.usual.of_runs(k, runs, within)
    usual += form_variance(healthy, reach, moved)

    def odds(mean: float, scatter: float, variance: float) -> float:
        narrow, beyond = scatter + variance, (size - mean) ** 2
        wide = (SIZES / max(reach, LEAST_REACH)) ** 2 + narrow
        change = logsumexp(-0.5 * (beyond / wide + np.log(wide))) - np.log(len(SIZES))
        return float(change + 0.5 * (beyond / narrow + np.log(narrow)))

    if gain <= 0.0 or size == 0.0:
        return 0.0
    variance, ends = sd**2, np.log(size**2 * np.array(WIDTHS))
    if odds(0.0, 0.0, float(np.exp(ends[0]))) > gain:
        variance = float(np.exp(brentq(lambda log: odds(0.0, 0.0, float(np.exp(log))) - gain, *ends, rtol=1e-6)))
    return max(0.0, odds(0.0, 0.0, variance) - odds(mean, usual, variance))


def with_usual(every: Sequence[Hypothesis], healthy: Healthy, reach: np.ndarray, runs: int) -> np.ndarray:
    """Log evidence of hypotheses (hypotheses,), each with what usual deviations of further labels bring it, and
    without what the form of some of its effects would bring that another has.

    What healthy runs show of a label is no change: a hypothesis without it explains that much, too, and so on with a
    label more. Far from what is usual the likelihood is no parabola: one that gains what a label really does is taken.
    """
    best = {frozenset(one.labels): one for one in sorted(every, key=lambda one: one.evidence)}  # of labels fitted twice
    gained = {labels: one.evidence - log_prior(healthy, one.labels) for labels, one in best.items()}
    most, by_form = {labels: one.usual for labels, one in best.items()}, dict.fromkeys(gained, 0.0)
    for one in sorted(every, key=lambda one: -len(one.labels)):  # of one with a label more it is known what that has
        own = frozenset(one.labels)
        moves = (one.sizes * reach[healthy.at(one.labels)]) ** 2
        for n, (label, k) in enumerate(zip(one.labels, healthy.at(one.labels), strict=True)):
            if own - {label} not in gained:
                continue
            about = healthy, k, float(reach[k]), float(one.sizes[n]), float(one.sd[n]), runs
            gain = gained[own] - gained[own - {label}]
            usual = usual_share(*about, gain=gain)
            # one that is worse by itself, but brings another, costs what it is worse by
            most[own - {label}] = max(most[own - {label}], most[own] + (usual if gain > 0.0 else gain))
            by_form[own] = max(by_form[own], usual_share(*about, float(moves.sum() - moves[n]), gain) - usual)
    return np.array([one.evidence + most[frozenset(one.labels)] - by_form[frozenset(one.labels)] for one in every])


def log_prior(healthy: Healthy, labels: Sequence[str]) -> float:
    """Of a hypothesis: that something changed, which label, and that another stands beside it."""
    if not labels:
        return float(np.log1p(-HEALTHY.changed))
    named = sum(one.family not in (*UNEXPLAINED, FORM) for one in healthy.effects)
    each = [log_odds(healthy.effects[k]) - np.log(named) for k in healthy.at(labels)]
    return float(np.log(HEALTHY.changed) + sum(each) + (len(labels) - 1) * np.log(ANOTHER))


def strangeness(healthy: Healthy, one: Hypothesis, nothing: Hypothesis) -> float:
    """Probability that more is left than a hypothesis says: its mean square against healthy runs', Student's t."""
    odds = strange_odds(healthy, one, nothing) + np.log(STRANGE) - np.log1p(-STRANGE)
    return float(1.0 / (1.0 + np.exp(-np.clip(odds, -500.0, 500.0))))


def strange_odds(healthy: Healthy, one: Hypothesis, nothing: Hypothesis) -> float:
    """Log evidence that more is left than a hypothesis says, over that it is what healthy runs leave."""
    level = HealthyLevel(healthy.runs, 0.0, healthy.level_scatter)
    scale, at = level.scale(len(one.left)), float(np.log(max(one.left.mean(), 1e-9)))
    if one.labels:
        scale = float(
            np.hypot(scale, np.log1p(HEALTHY.form_error**2 * max(nothing.left.mean() - one.left.mean(), 0.0)))
        )
    usual, more = level.unchanged(at, scale)
    return more - usual


def decide(every: list[Hypothesis], healthy: Healthy, reach: np.ndarray, runs: int) -> Posterior:
    """Probabilities of the main cause, from the evidence of hypotheses about some runs.

    reach: tolerances (k,) that a spread of each label moves the channels.
    """
    logs = with_usual(every, healthy, reach, runs)
    known = {one.label: one for one in healthy.effects}
    noisy = np.array([any(known[label].family == NOISE for label in one.labels) for one in every])
    # noise is excess only if more is left without it than healthy runs leave; else those with it are out
    without = np.where(noisy, -np.inf, logs)
    strange = every[int(np.argmax(without))].strange
    weights = strange * np.exp(logs - logsumexp(logs)) + (1.0 - strange) * np.exp(without - logsumexp(without))
    chances: dict[str, float] = {NONE: 0.0, UNKNOWN: 0.0}
    for one, weight in zip(every, weights, strict=True):
        moves = moves_of(one, healthy, reach)
        chances[UNKNOWN] += weight * one.strange
        main = max(moves, key=lambda label: moves[label], default=NONE)
        if moves.get(main, 0.0) < MATERIAL:
            name = NONE
        else:
            name = UNKNOWN if known[main].family in UNEXPLAINED else main
        chances[name] = chances.get(name, 0.0) + weight * (1.0 - one.strange)
    return Posterior(every, weights, chances, reach, healthy)


def moves_of(one: Hypothesis, healthy: Healthy, reach: np.ndarray) -> dict[str, float]:
    """By how much each label of a hypothesis moves the channels, tolerances; reach (k,): what a spread of each does."""
    return {label: float(abs(size) * reach[k])
            for label, size, k in zip(one.labels, one.sizes, healthy.at(one.labels), strict=True)}  # fmt: skip


def group_of(chances: Mapping[str, float]) -> list[str]:
    """The smallest set of labels that holds most of the probability of the causes, most probable first."""
    known = sorted(((p, label) for label, p in chances.items() if label not in (NONE, UNKNOWN)), reverse=True)
    total, group = sum(p for p, _ in known), list[str]()
    for _, label in known:
        if total <= 0.0 or sum(chances[one] for one in group) >= GROUP_MASS * total:
            break
        group.append(label)
    return group


def confounded(group: Sequence[str], what: str) -> list[str]:
    """A caution, where more labels than are an answer explain what is named."""
    return [f"{len(group)} labels explain {what} confounded: {', '.join(group)}"] if len(group) > MOST_GROUP else []


def from_one_session(sessions: int) -> list[str]:
    """A caution, where it is not known what sessions differ by."""
    said = "identified from one session: what sessions differ by is assumed, and may be called a cause; identify from "
    return [f"{said}several, or watch with healthy runs of the same one as reference"] if sessions == 1 else []
