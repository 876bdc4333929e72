"""The hypothesis about the runs of a case that is most probable, and those beside it: labels, their sizes, evidence.

A hypothesis is a set of labels with sizes common to the case's runs, beside what an identified vehicle allows for: its
shared values, what sessions and runs differ by. The size of a label is normal with a sigma of v tolerances, rms over
the windows' channels, v over a grid of equal chances: labels of all units are as probable before the data. Beside the
labels stand constant forces that no label has. What is concluded from all of them: decision.py.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from scipy.special import logsumexp
from scipy.stats import norm

from glider.tools.inference.pooled import Pooled, Scatter, run_values
from glider.tools.own.decision import (
    FORM_SHARES,
    SIZES,
    Deviations,
    Healthy,
    Hypothesis,
    log_odds,
    log_prior,
    strangeness,
    usual_share,
    with_usual,
)
from glider.tools.own.effects import FORM, NOISE, PUSH, UNEXPLAINED, moved
from glider.tools.own.evidence import Place, alone, size_evidence, under_priors
from glider.tools.own.hierarchy import LEAST_REACH, Expansion, RunLevel, expand, followed, room, shortened
from glider.tools.own.observer import Observer
from glider.tools.own.sessions import each_of_times
from glider.tools.own.strong import STRONG_LEFT, strong_sizes

BEAM, MOST_EFFECTS = 6, 3
ROUNDS, FIRST_ROUNDS = 5, 20  # of a hypothesis at most; of that from which all others begin
BEHIND = 8.0  # nat that the best is ahead of a hypothesis that is not led on
WAY, AT_REST = 4, 0.25  # steps along the derivatives of one expansion; nat of the posterior that one has to gain
SHORTER_WAY = 0.25  # of a step at most, after a way that ended worse


class Engine:
    """Hypotheses about the runs of one observer."""

    def __init__(self, observer: Observer, healthy: Healthy, say: Callable[[str], None] = lambda text: None):
        self.observer, self.healthy, self.say = observer, healthy, say
        self.k, self.count = len(healthy.effects), len(observer.runs)
        self.horizon = observer.horizon
        self.low = np.array([one.low for one in healthy.effects])
        self.high = np.array([one.high for one in healthy.effects])
        self.active = (np.diag(healthy.V) > 0.0) | (healthy.scatter.sizes > 0.0)
        # runs of one session, or each of another, and how far these differ: which, their evidence says
        self.deviations = list[tuple[Deviations, float]]()
        for session, prior in each_of_times(healthy.session, healthy.sessions):
            apart = Deviations(healthy.V, Scatter.of(healthy.scatter.covariance + session.covariance))
            together = Deviations(healthy.V + session.covariance, healthy.scatter)
            self.deviations += [(together, prior), (apart, prior)]
        self.together = self.deviations[0][0]
        # constant numbers that a hypothesis may add; noises are weighed beside them (excess_noise.py)
        self.candidate = np.array([one.family not in (FORM, NOISE) and one.odds > 0.0 for one in healthy.effects])
        self.forces = np.array([k for k, one in enumerate(healthy.effects) if one.family == PUSH], dtype=int)
        self.reach = np.zeros(self.k)
        self.level = RunLevel(healthy.errors, healthy.eta, healthy.level_scatter)
        self.ahead = -np.inf  # log evidence of the best so far

    def columns(self, places: Sequence[int] = ()) -> np.ndarray:
        """Numbers that every hypothesis leaves open, and labels at some places."""
        return np.unique(np.append(np.flatnonzero(self.active), np.array(places, dtype=int)))

    def expansions(self, own: np.ndarray, columns: np.ndarray, keep: bool = False) -> list[Expansion]:
        """Every run about its values (runs, k) in some columns, tempered; the others' rows are 0."""
        return self.observer.each_run(lambda n: self.expansion_of(n, own[n], columns, keep))

    def expansion_of(
        self, n: int, own: np.ndarray, columns: np.ndarray, keep: bool = False, leveled: bool = True,
        keep_filter: bool = False,
    ) -> Expansion:  # fmt: skip
        """Run n about its values (k,) in some columns, tempered; the others' rows are 0.

        keep, keep_filter: as in `expand`; leveled: at its own level of errors.
        """
        chosen, observer = [self.healthy.effects[k] for k in columns], self._observer_at(own, columns)
        one = expand(
            observer, n, chosen, own[columns], self.healthy.errors, self.horizon, keep, keep_filter, scores=False
        )
        one = one.tempered(self.healthy.eta)
        return self._widened(self.level.of(one) if leveled else one, columns, own)

    def followed(self, n: int, own: np.ndarray, columns: np.ndarray, one: Expansion) -> Expansion:
        """Run n at other values (k,), with the derivatives of an expansion."""
        chosen, observer = [self.healthy.effects[k] for k in columns], self._observer_at(own, columns)
        assert one.derivatives is not None
        kept = replace(one, derivatives=one.derivatives[columns])
        there = followed(observer, n, chosen, own[columns], self.healthy.errors, self.horizon, kept)
        there, slope = self.level.of(there.tempered(self.healthy.eta)), np.zeros(self.k)
        slope[columns] = there.slope
        return replace(one, at=own.copy(), value=there.value, slope=slope, squares=there.squares)

    def _all_followed(self, own: np.ndarray, columns: np.ndarray, found: Sequence[Expansion]) -> list[Expansion]:
        return self.observer.each_run(lambda n: self.followed(n, own[n], columns, found[n]))

    def _observer_at(self, own: np.ndarray, columns: np.ndarray) -> Observer:
        """The observer about a run's values in all other columns."""
        others = own.copy()
        others[columns] = 0.0
        if not others.any():
            return self.observer
        return self.observer.about(moved(self.observer.declared, self.observer.point, self.healthy.effects, others))

    def _widened(self, one: Expansion, columns: np.ndarray, own: np.ndarray) -> Expansion:
        slope, curvature, reach = np.zeros(self.k), np.zeros((self.k, self.k)), np.zeros(self.k)
        slope[columns], reach[columns] = one.slope, one.reach
        curvature[np.ix_(columns, columns)] = one.curvature
        derivatives = None
        if one.derivatives is not None:
            derivatives = np.zeros((self.k, *one.derivatives.shape[1:]))
            derivatives[columns] = one.derivatives
        return replace(one, at=own.copy(), slope=slope, curvature=curvature, reach=reach, derivatives=derivatives)

    def fit(self, labels: tuple[str, ...], begin: Hypothesis | None = None, every: bool = False) -> Hypothesis:
        """Labels led to where they are most probable; evidence by the expansion there.

        On the way the derivatives of the last expansion serve. A place is expanded anew where a way along them ends,
        unless it gained what they had said: then they hold there too. Where it is worse by its own filter, the way is
        taken back, and the next is shorter. What stays far behind the best even if it gains as much again is left.
        """
        places = self.healthy.at(labels)
        columns = self.columns(places)
        shared = np.zeros(self.k) if begin is None else begin.shared.copy()
        own = np.tile(shared, (self.count, 1)) if begin is None else begin.own.copy()
        rounds = ROUNDS if labels else FIRST_ROUNDS
        known = [one.only(columns) for one in begin.found] if begin is not None and begin.everywhere else []
        by, last, odds = self.together, None, log_prior(self.healthy, labels)
        rooms, longest = room(self.reach), 1.0
        for round_ in range(rounds):
            here = Place(shared, own, known or self.expansions(own, columns, keep=round_ < rounds - 1))
            if last is not None and here.cost(by, places) > last.cost(by, places) + 2.0 * AT_REST:
                way = np.abs([here.shared - last.shared, *(here.own - last.own)]) / rooms
                here, longest = last, SHORTER_WAY * min(longest, float(way.max()))
            last, shared, own, found = here, here.shared, here.own, here.found
            by, pooled, evidence, _, sd, off = self.best_sizes(found, places, shared)
            values = replace(pooled, V=by.V).mean()
            led = np.array([run_values(one, values, by.scatter) for one in found])
            predicted_gain = sum(one.value - one.at_place(x) for one, x in zip(found, led, strict=True))
            predicted_gain += by.prior(shared, own, places) - by.prior(values, led, places)
            if predicted_gain < 2.0 * AT_REST:
                shared, own = np.clip(values, self.low, self.high), np.clip(led, self.low, self.high)
                break
            gained = 0.0
            if round_ and evidence + odds + 0.5 * predicted_gain < self.ahead - BEHIND:
                break
            if round_ < rounds - 1:
                shared, own, gained, there = self._along(here, by, places, longest * rooms)
                known = there if abs(gained - predicted_gain) < AT_REST else []
            if gained == 0.0:
                break
        # what the parabola says of a place that the likelihood was not led to is no evidence
        evidence -= 0.5 * max(0.0, predicted_gain)
        if every:
            found = self.expansions(own, np.arange(self.k), keep=True)
        left = np.array([one.squares.sum() / max(1, one.samples.sum()) for one in found])
        evidence += odds
        self.ahead = max(self.ahead, evidence)
        fitted = Hypothesis(labels, evidence, shared[places], sd, shared, own, left, 0.0, found, True, off)
        if not every:
            fitted.forget()
        return fitted

    def _along(
        self, here: Place, by: Deviations, places: Sequence[int], most: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, float, list[Expansion]]:
        """Values led on from where runs are expanded by the derivatives there, a step at most `most` (k,) spreads:
        shared (k,), own (runs, k), by how much -2 log posterior fell, flown at every place, and the runs there by these
        derivatives."""
        columns, shared, own, found = self.columns(places), here.shared, here.own, here.found
        cost, gained, share = here.cost(by, places), 0.0, 1.0
        for _ in range(WAY):
            target = np.clip(Pooled.of(by.marginal(found), by.V).mean(), self.low, self.high)
            step = shortened(target - shared, most)
            of_runs = np.array([run_values(one, shared + step, by.scatter) for one in found])
            of_runs = shortened(np.clip(of_runs, self.low, self.high) - own, most)
            tried, theirs = shared + share * step, own + share * of_runs
            there = self._all_followed(theirs, columns, found)
            gain = cost - sum(one.value for one in there) - by.prior(tried, theirs, places)
            if gain < 2.0 * AT_REST:
                share *= 0.5
            else:
                shared, own, found, cost, gained = tried, theirs, there, cost - gain, gained + gain
        return shared, own, gained, list(found)

    def variance(
        self, V: np.ndarray, places: Sequence[int], sizes: Sequence[float], shared: np.ndarray, form: float
    ) -> np.ndarray:
        """Prior covariance (k, k): V, labels of 1 sigma `sizes` (tolerances), and what of them is not as they have it.

        That is a force at the noises, all together `form` of what labels do to the windows where they are (shared: k,).
        """
        found, reach, forces = V.copy(), np.maximum(self.reach, LEAST_REACH), self.forces
        for k, size in zip(places, sizes, strict=True):
            found[k, k] += (size / reach[k]) ** 2
            if self.healthy.effects[k].family not in UNEXPLAINED and len(forces):
                found[forces, forces] += (form * shared[k] * reach[k] / reach[forces]) ** 2 / len(forces)
        return found

    def best_sizes(
        self, found: Sequence[Expansion], places: Sequence[int], shared: np.ndarray
    ) -> tuple[Deviations, Pooled, float, np.ndarray, np.ndarray, np.ndarray]:
        """Deviations with the most probable prior without form errors, runs pooled with the most probable of all, log
        evidence over all, sizes with their sd, and what of them the vehicle's own numbers are off.

        Priors of the grid differ in a few variances, d: with W = (1 + V H)^-1, Q = (H W) and q = W' r at these,
        they add to the evidence what `under_priors` says (Woodbury).
        """
        sided = np.array([self.healthy.effects[k].one_sided for k in places], dtype=bool)
        forms = FORM_SHARES if places else FORM_SHARES[:1]
        grid = list(product(*[SIZES.tolist()] * len(places), forms))
        varied = np.array([*places, *(k for k in self.forces if places and k not in places)], dtype=int)
        added = [self.variance(np.zeros((self.k, self.k)), places, sizes, shared, form)[varied, varied]
                 for *sizes, form in grid]  # fmt: skip
        d = np.array(added).reshape(len(grid), len(varied))
        table = []
        for by, prior in self.deviations:
            pooled = Pooled.of(by.marginal(found), by.V)
            W = np.linalg.inv(np.eye(self.k) + by.V @ pooled.H)
            M, Q, q = W @ by.V, (pooled.H @ W)[np.ix_(varied, varied)], (W.T @ pooled.r)[varied]
            gained, S = under_priors(q, Q, d)
            G = W[np.ix_(np.array(places, dtype=int), varied)]
            mean = (M @ pooled.r)[places] + np.einsum("pa,nab,b->np", G, S, q)
            variance = np.diag(M)[places] + np.einsum("pa,nab,pb->np", G, S, G)
            sd = np.sqrt(np.maximum(variance, 1e-30))
            halves = (np.log(2.0) + norm.logcdf(mean / sd))[:, sided].sum(axis=1)
            table.append((prior + pooled.log_evidence() + gained + halves, mean, sd, by, pooled))
        evidence = float(logsumexp([row[0] for row in table]) - np.log(2 * len(grid)))
        nat, mean, sd, by, pooled = max(table, key=lambda row: row[0].max())
        best = int(np.argmax(nat))
        *sizes, form = grid[best]
        at = replace(pooled, V=self.variance(by.V, places, sizes, shared, form))
        *sizes, form = grid[max((n for n, one in enumerate(grid) if not one[-1]), key=lambda n: nat[n])]
        led = replace(by, V=self.variance(by.V, places, sizes, shared, form))
        # with x = s + c pooled, s is V (r - H x) where x is most probable, and c the change
        off = by.V[places] @ (at.r - at.H @ at.mean())
        return led, at, evidence, np.clip(mean[best], self.low[places], self.high[places]), sd[best], off

    def label_gains(self, slope: np.ndarray, precision: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Log evidence (k,) that each label gains by its parabola, beside what is integrated out, and its size there.

        slope, precision (k,): of -2 log likelihood in the size of each label, halved (`alone`).
        """
        effects, reach = self.healthy.effects, np.maximum(self.reach, LEAST_REACH)
        gain = size_evidence(slope, precision, reach, np.array([one.one_sided for one in effects]))
        gain = np.where(
            (self.reach > LEAST_REACH) & self.candidate, gain + np.array([log_odds(one) for one in effects]), -np.inf
        )
        tau2 = (SIZES[-1] / reach) ** 2
        return gain, np.clip(slope * tau2 / (1.0 + tau2 * precision), self.low, self.high)

    def screen(self, begin: Hypothesis) -> list[tuple[float, str]]:
        """Every other label beside a hypothesis by its parabola: log evidence gained, best first."""
        places = self.healthy.at(begin.labels)
        _, pooled, *_ = self.best_sizes(begin.found, places, begin.shared)
        gain, _ = self.label_gains(*alone(pooled))
        gain[places] = -np.inf
        return [(float(gain[k]), self.healthy.effects[k].label) for k in np.argsort(-gain) if np.isfinite(gain[k])]

    def swaps(self, begin: Hypothesis, tried: Mapping[tuple[str, ...], Hypothesis]) -> list[tuple[str, Hypothesis]]:
        """Labels in the place of a hypothesis' last one that come nearest to it where it leads, with their starts; of
        those that were tried, such as are more probable from here than from where they began."""
        places = self.healthy.at(begin.labels[:-1])
        _, pooled, *_ = self.best_sizes(begin.found, places, begin.shared)
        gain, size = self.label_gains(*alone(pooled))
        (replaced,), starts = self.healthy.at(begin.labels[-1:]), []
        predicted = begin.evidence + gain - gain[replaced]
        for labels, known in tried.items():
            (k,) = self.healthy.at(labels[-1:])
            if k == replaced or predicted[k] < max(known.evidence + AT_REST, begin.evidence - BEHIND):
                gain[k] = -np.inf
        for k in np.argsort(-gain)[:BEAM]:
            if not np.isfinite(gain[k]):
                break
            shared, own = begin.shared.copy(), begin.own.copy()
            for row in (shared, *own):
                row[k] += size[k]
                row[replaced] -= begin.shared[replaced]
            starts.append((self.healthy.effects[k].label, replace(begin, shared=shared, own=own, everywhere=False)))
        return starts

    def with_swaps(self, singles: Sequence[Hypothesis], nothing: Hypothesis) -> list[Hypothesis]:
        """Single labels and those that may stand in the place of the most probable one, until that stays.

        A label may have no size: one that ends far behind `nothing` is lost, and begins there again.
        """
        best, led = {one.labels: one for one in sorted(singles, key=lambda one: one.evidence)}, tuple[str, ...]()
        for _ in range(BEAM):
            leading = max(best.values(), key=lambda one: one.evidence)
            if leading.labels == led or leading.evidence <= nothing.evidence:
                break
            led = leading.labels
            best[led] = leading = self.fit(led, leading, every=True)
            for label, begin in self.swaps(leading, best):
                one = self.fit((label,), begin)
                if one.evidence < nothing.evidence - BEHIND:
                    one = max(one, self.fit((label,), self.bare), key=lambda one: one.evidence)
                if one.labels not in best or best[one.labels].evidence < one.evidence:
                    best[one.labels] = one
        return list(best.values())

    def strong_starts(self) -> list[tuple[str, Hypothesis]]:
        """Hypotheses of single labels that begin there."""
        starts = []
        for k, size in strong_sizes(self.observer, self.healthy, self.reach, range(self.count))[:BEAM]:
            shared = np.zeros(self.k)
            shared[k] = size
            own = np.tile(shared, (self.count, 1))
            starts.append((self.healthy.effects[k].label, replace(self.bare, shared=shared, own=own, everywhere=False)))
        return starts

    def hypotheses(self) -> list[Hypothesis]:
        """Hypotheses found by a beam: none, the best single labels, pairs beside the best, triples."""
        begin = self.expansions(np.zeros((self.count, self.k)), np.arange(self.k))
        self.reach = np.sqrt(np.mean([one.reach for one in begin], axis=0))
        untouched = np.sqrt(np.mean([one.squares.sum() / max(1, one.samples.sum()) for one in begin]))
        nothing = self.fit((), every=True)
        nothing.strange = strangeness(self.healthy, nothing, nothing)
        every, front, self.bare = [nothing], [nothing], nothing
        self.say(f"no change: {np.sqrt(nothing.left.mean()):.2f} times what healthy runs leave")
        for depth in range(MOST_EFFECTS):
            wanted: dict[frozenset[str], tuple[float, Hypothesis, tuple[str, ...]]] = {}
            for one in front:
                for gain, label in self.screen(one)[: BEAM if depth == 0 else 3]:
                    labels = (*one.labels, label)
                    key, score = frozenset(labels), one.evidence + gain
                    if key not in wanted or wanted[key][0] < score:
                        wanted[key] = (score, one, labels)
            new = [
                self.fit(labels, begin) for _, begin, labels in sorted(wanted.values(), key=lambda one: -one[0])[:BEAM]
            ]
            if depth == 0 and untouched > STRONG_LEFT:
                again = [self.fit((label,), begin) for label, begin in self.strong_starts()]
                best_of = {one.labels: one for one in sorted([*new, *again], key=lambda one: one.evidence)}
                new = list(best_of.values())
            if depth == 0 and new:
                new = self.with_swaps(new, nothing)
            best = max(one.evidence for one in every)
            for one in new:
                one.strange = strangeness(self.healthy, one, nothing)
                gain, left = one.evidence - nothing.evidence, np.sqrt(one.left.mean())
                self.say(f"{' + '.join(one.labels)}: {gain:.1f} nat, {left:.2f} left")
            every += new
            front = sorted(new, key=lambda one: -one.evidence)[:2]
            if not front or front[0].evidence < best + (0.0 if depth else -3.0):
                break
            front = [one if one.everywhere else self.fit(one.labels, one, every=True) for one in front]
            for one in front:
                one.strange = strangeness(self.healthy, one, nothing)
            for one in every:
                if all(one is not kept for kept in front):
                    one.forget()
        logs = with_usual(every, self.healthy, self.reach, self.count)
        for one, log in zip(every, logs, strict=True):
            if log > logs.max() - BEHIND:
                one.usual = self.usual_beside(one)
        return every

    def usual_beside(self, one: Hypothesis) -> float:
        """Nat that a usual deviation of one label more brings a hypothesis, by its parabola: few pairs are fitted."""
        places, every = self.healthy.at(one.labels), np.arange(self.k)
        found = one.found if one.everywhere else self.expansions(one.own, every)
        _, pooled, *_ = self.best_sizes(found, places, one.shared)
        slope, precision = alone(pooled)
        sided = np.array([effect.one_sided for effect in self.healthy.effects], dtype=bool)
        asked = self.candidate & (self.reach > LEAST_REACH) & (precision > 0.0) & ~(sided & (slope < 0.0))
        asked[places] = False
        shares = [usual_share(self.healthy, k, float(self.reach[k]), float(slope[k] / precision[k]),
                              float(precision[k] ** -0.5), self.count) for k in every[asked]]  # fmt: skip
        return max(shares, default=0.0)
