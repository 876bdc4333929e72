"""Runs of a watch about their most probable values, given sessions, events, and what the reference says of all.

A run's own values lie where the exact likelihood is largest about those that it is thought to have: its session's and
its events'. A label over a span, and another session, are led to where both are most probable.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from glider.tools.inference.pooled import Pooled, learn_scatter, run_values
from glider.tools.own.decision import Healthy
from glider.tools.own.hierarchy import Expansion, room, shortened
from glider.tools.own.observer import Observer
from glider.tools.own.posterior import AT_REST, Engine
from glider.tools.own.runs_fit import CONVERGED_GAIN, MIN_SCATTER_RUNS, SCATTER_ROUNDS, LineSearch
from glider.tools.own.sessions import Session, SessionRuns, of_another, split
from glider.tools.own.watched import Event

OWN_ROUNDS, CONVERGED_OWN = 5, 0.1  # of a run's own values, spreads
LED_ROUNDS, SESSION_ROUNDS, PREPARED = 8, 4, 20

Warm = dict[int, tuple[np.ndarray, np.ndarray]]  # run: most probable values (k,) last, and those about which


@dataclass(frozen=True)
class Led:
    """Where a label over a span, and another session, are most probable."""

    sessions: Sequence[Session]
    pooled: Sequence[SessionRuns]  # their runs expanded there
    size: float  # spreads
    log_density: float  # of the posterior there


class WatchedRuns(Engine):
    """Runs of one observer in sessions: the first `learned` are the reference's."""

    def __init__(
        self, observer: Observer, healthy: Healthy, learned: int, say: Callable[[str], None] = lambda text: None
    ):
        super().__init__(observer, healthy, say)
        self.learned = learned

    def prepare(self) -> None:
        """Every run about where it lies, with what the reference says of all; how runs differ, learned from it too.

        Of what runs share they say less than their likelihood has it, by `run_inflation`: for where the shared values
        are most probable that is as good as a prior so much narrower.
        """
        every, columns, healthy = np.arange(self.k), self.columns(), self.healthy
        known_from = healthy.runs if healthy.runs >= MIN_SCATTER_RUNS else 0
        V = self.together.V / healthy.run_inflation
        shared, own = np.zeros(self.k), np.zeros((self.learned, self.k))
        for round_ in range(PREPARED):
            about = partial(self._with_filter, own=own, columns=columns)
            found = self.observer.each(about, range(self.learned))
            if self.learned > 2 and round_ < SCATTER_ROUNDS:
                scatter = learn_scatter(found, self.together.V, healthy.scatter, learned_from=known_from)
                self.together = replace(self.together, scatter=scatter)
            pooled = Pooled.of(self.together.marginal(found), V)
            search = LineSearch(self.observer, healthy.effects, found, self.together.scatter, healthy.eta, V,
                                (self.low, self.high), healthy.errors, self.horizon, 0, self.level)  # fmt: skip
            shared, own, gain = search.along(shared, own, pooled)
            if gain < CONVERGED_GAIN and round_ >= SCATTER_ROUNDS:
                break
        later = self.observer.each(lambda n: self.about(n, shared, shared, columns).at, range(self.learned, self.count))
        self.found = self.expansions(np.array([*own, *later]), every)
        self.reach = np.sqrt(np.mean([one.reach for one in self.found], axis=0))
        self.runs = self.of_shared(self.found)
        known = self.runs[: self.learned]
        M = Pooled.of(known, self.together.V).covariance()
        self.events, self.sessions = list[Event](), [Session(self.learned, self.count, shared, M, shared)]
        self.another = of_another(known, healthy.V, healthy.session, healthy.sessions)
        self.instead = dict[int, dict[str, float]]()  # by first run of a session: probabilities of labels in its place

    def of_shared(self, found: Sequence[Expansion]) -> list[Expansion]:
        """What runs say of values that runs share, their own deviations integrated out: less than their likelihood has
        it, by `run_inflation`."""
        return [one.tempered(self.healthy.run_inflation) for one in self.together.marginal(found)]

    def _with_filter(self, n: int, own: np.ndarray, columns: np.ndarray) -> Expansion:
        return self.expansion_of(n, own[n], columns, keep_filter=True)

    def about(
        self, n: int, around: np.ndarray, begin: np.ndarray, columns: np.ndarray, keep: bool = False
    ) -> Expansion:
        """Run n expanded in some columns about its most probable values by the exact likelihood, led from `begin` (k,);
        around: those that it is thought to have; keep: with its derivatives."""
        healthy, scatter, own = self.healthy, self.together.scatter, np.clip(begin, self.low, self.high)
        free = scatter.free
        for _ in range(OWN_ROUNDS):
            found = self.expansion_of(n, own, free, keep_filter=True)
            search = LineSearch(self.observer, healthy.effects, [found], scatter, healthy.eta, self.together.V,
                                (self.low, self.high), healthy.errors, self.horizon, n, self.level)  # fmt: skip
            _, (moved_own,), _ = search.along(around, own[None], None)
            if np.abs(moved_own - own).max() < CONVERGED_OWN:
                break
            own = moved_own
        return self.expansion_of(n, own, columns, keep)

    def near(self, n: int, around: np.ndarray, begin: np.ndarray, columns: np.ndarray, one: Expansion) -> Expansion:
        """The same by the derivatives of an expansion that has kept them, errors flown at every place."""
        own, best, share = np.clip(begin, self.low, self.high), None, 1.0
        for _ in range(OWN_ROUNDS):
            found = self.followed(n, own, columns, one)
            cost = found.value + float(self.together.scatter.distance(own - around))
            if best is not None and cost > best[0]:
                share *= 0.5
            else:
                best = cost, found
                step = shortened(run_values(found, around, self.together.scatter) - own, room(np.sqrt(found.reach)))
                if np.abs(step).max() < CONVERGED_OWN:
                    break
            own = np.clip(best[1].at + share * step, self.low, self.high)
        assert best is not None
        return best[1]

    def session_of(self, n: int, sessions: Sequence[Session]) -> Session:
        return next(one for one in sessions if one.first <= n < one.end)

    def of_events(self, n: int) -> np.ndarray:
        """What events add to the values (k,) of run n."""
        x = np.zeros(self.k)
        for one in self.events:
            if one.first <= n < one.end:
                x[self.healthy.at([one.label])[0]] += one.size
        return x

    def at_run(self, n: int, sessions: Sequence[Session]) -> np.ndarray:
        """Values (k,) that run n is thought to have: its session's and its events'."""
        return self.session_of(n, sessions).values + self.of_events(n)

    def again(
        self, n: int, sessions: Sequence[Session], span: tuple[int, int], label: int, size: float, warm: Warm,
        kept: dict[int, Expansion] | None = None, every: bool = False,
    ) -> Expansion:  # fmt: skip
        """Run n expanded again where it is, or was last, with a label of a size (spreads) over a span, and its events.

        kept: runs' last expansions with derivatives, which serve for another place; every: in all columns.
        """
        around, columns = self.at_run(n, sessions), np.arange(self.k) if every else self.columns()
        if span[0] <= n < span[1]:
            around[label] = np.clip(around[label] + size, self.low[label], self.high[label])
            columns = columns if every else self.columns([label])
        at, before = warm.get(n) or (self.found[n].at, self.at_run(n, self.sessions))
        begin = at + around - before
        if kept is not None and n in kept:
            found = self.near(n, around, begin, columns, kept[n])
        else:
            found = self.about(n, around, begin, columns, keep=kept is not None)
            if kept is not None:
                kept[n] = found
        warm[n] = found.at, around
        return found

    def with_usual(self, sessions: Sequence[Session], label: int) -> list[Session]:
        """The same where the reference's has of a label, and of events', what sessions have of it in common, as far as
        its runs have it."""
        (first, *others), V, mean = sessions, self.together.V.copy(), np.zeros(self.k)
        for k in {label, *self.healthy.at([one.label for one in self.events])}:
            mean[k], more = self.healthy.usual.of_session(k)
            V[k, k] += more
        known = Pooled.of([replace(one, at=one.at - mean) for one in self.runs[: self.learned]], V)
        return [replace(first, mean=mean + known.mean(), V=known.covariance()), *others]

    def pooled(self, sessions: Sequence[Session], runs: dict[int, Expansion] | None = None) -> list[SessionRuns]:
        """Runs by session, what events add taken off; runs: others than those that are known, deviations in them."""
        runs, found = runs or {}, []
        for session in sessions:
            own = [runs.get(n, self.runs[n]) for n in range(session.first, session.end)]
            own = [replace(one, at=one.at - self.of_events(session.first + n)) for n, one in enumerate(own)]
            found.append(SessionRuns.of(session, own))
        return found

    def begun(self, sessions: Sequence[Session]) -> int | None:
        """The run from which on there is another session than those that are known."""
        known = [one.first for one in self.sessions[1:]]
        return next((one.first for one in sessions[1:] if one.first not in known), None)

    def with_another(self, first: int) -> Sequence[Session]:
        """Sessions with another one from run `first` on, which differs as far as is most probable by the parabola;
        those that are known where one begins there."""
        tried = [split(self.sessions, first, one) for one in self.another]
        if len(tried[0]) == len(self.sessions):
            return tried[0]
        new = [next(one for one in reversed(each) if one.first == first) for each in tried]
        gains = [self.pooled([one])[0].pooled.log_evidence() + one.log_prior for one in new]
        return tried[int(np.argmax(gains))]

    def expanded(self, sessions: Sequence[Session]) -> Sequence[Session]:
        """Sessions, the new one of them about what its runs say of it by the parabola."""
        new = self.begun(sessions)
        return [replace(one, values=self.pooled([one])[0].given(0, 0, 0, 0.0))
                if new is not None and one.first == new and one.end > new else one for one in sessions]  # fmt: skip

    def led(
        self, span: tuple[int, int], sessions: Sequence[Session], label: int = 0, size: float = 0.0,
        target: Callable[[Sequence[SessionRuns], float], tuple[float, float]] = lambda pooled, size: (0.0, 1.0),
        leading: int | None = None,
    ) -> Led:  # fmt: skip
        """A label over a span, and what runs of its sessions share, led to where both are most probable; the new one of
        sessions too, or that which begins with run `leading`.

        size: where the label begins; target: mean and 1 sigma of it by the parabola about a place. A step is halved
        until the posterior does not fall: the parabola says where to go, the likelihood whether it is better there.
        """
        new = self.begun(sessions) if leading is None else leading
        moving = {one.first for one in sessions if one.first == new or max(one.first, span[0]) < min(one.end, span[1])}
        moved = [n for n in range(self.learned, self.count)
                 if span[0] <= n < span[1] or self.session_of(n, sessions).first == new]  # fmt: skip
        begun: Led | None = None
        best, warm, of_best, kept, at_rest = begun, Warm(), Warm(), dict[int, Expansion](), False
        for round_ in range(LED_ROUNDS):
            if at_rest or round_ == LED_ROUNDS - 1:  # derivatives serve on the way, evidence is taken where they are
                if best is not None:
                    sessions, size, warm = best.sessions, best.size, dict(of_best)
                best, kept = None, {}
            anew = not kept
            if size == 0.0 and new is None:
                runs = {}
            else:
                with_it = partial(
                    self.again, sessions=sessions, span=span, label=label, size=size, warm=warm, kept=kept
                )
                again = self.observer.each(with_it, moved)
                runs = dict(zip(moved, self.of_shared(again), strict=True))
            pooled = self.pooled(sessions, runs)
            density = sum(one.log_density(*span, label, size) for one in pooled)
            gain = np.inf if best is None else density - best.log_density
            if best is not None and gain < -AT_REST:
                size, warm = 0.5 * (size + best.size), dict(of_best)
                sessions = [replace(one, values=0.5 * (one.values + other.values)) if one.first in moving else one
                            for one, other in zip(sessions, best.sessions, strict=True)]  # fmt: skip
                continue
            best, of_best = Led(sessions, pooled, size, density), dict(warm)
            begun = begun or best
            mean, sd = target(pooled, size)
            most = room(self.reach)[label]
            step = float(np.clip(np.clip(mean, self.low[label], self.high[label]) - size, -most, most))
            at_rest = abs(step) < sd if at_rest or gain < AT_REST else new is None and abs(step) < 0.1 * sd
            if at_rest and anew:
                break
            if not at_rest and round_ < LED_ROUNDS - 1:
                size += step
                sessions = [replace(one, values=each.given(*span, label, size)) if one.first in moving else one
                            for one, each in zip(sessions, pooled, strict=True)]  # fmt: skip
        assert best is not None
        assert begun is not None
        return max(best, begun, key=lambda one: one.log_density)

    def left(self, n: int) -> float:
        """Mean square that a run leaves about where it was expanded, in units of what healthy runs leave."""
        return float(self.found[n].squares.sum() / max(1, self.found[n].samples.sum()))

    def converge(self) -> None:
        """Every session that is known led to where it is most probable, events being what they are: what further labels
        and sessions are compared with."""
        for first in [one.first for one in self.sessions if one.end > one.first]:
            before = -np.inf
            for _ in range(SESSION_ROUNDS):
                found = self.led((0, 0), self.sessions, leading=first)
                self.take(found.sessions)
                if found.log_density < before + CONVERGED_GAIN:
                    break
                before = found.log_density

    def take(self, sessions: Sequence[Session], event: Event | None = None) -> None:
        """Sessions and an event into what is known: runs that they move are expanded again where they are now."""
        moved = [n for n in range(self.learned, self.count)
                 if self.session_of(n, sessions).values is not self.session_of(n, self.sessions).values
                 or (event is not None and event.first <= n < event.end)]  # fmt: skip
        before = {n: self.at_run(n, self.sessions) for n in moved}
        self.sessions = list(sessions)
        if event is not None:
            self.events.append(event)

        def again(n: int) -> Expansion:
            around = self.at_run(n, self.sessions)
            return self.about(n, around, self.found[n].at + around - before[n], np.arange(self.k))

        for n, found in zip(moved, self.observer.each(again, moved), strict=True):
            self.found[n] = found
            (self.runs[n],) = self.of_shared([found])
