"""Sessions: what they differ by is learned number by number; a label is weighed with what they share left open."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from glider.tools.inference.pooled import Parabola, Pooled, Scatter, marginalised
from glider.tools.own.decision import UsualLabels
from glider.tools.own.evidence import size_posterior
from glider.tools.own.identify import USUAL_SESSION_SHARE, learn_sessions
from glider.tools.own.sessions import TIMES, Another, Session, SessionRuns, of_another, split, times_log_prior
from glider.tools.own.watched_runs import WatchedRuns

K = 3


def parabola(random: np.random.Generator, place: np.ndarray, precision: float = 30.0) -> Parabola:
    """A run whose likelihood is a normal one about a place (K,), its numbers not independent."""
    root = random.normal(size=(K, K))
    H = precision * (np.eye(K) + 0.3 * root @ root.T)
    return Parabola(np.zeros(K), float(place @ H @ place), -H @ place, H)


@dataclass
class OneChannel(Parabola):
    """A run of which all is seen by one channel."""

    @property
    def by_channel(self) -> np.ndarray:
        return self.curvature[None]


def session(first: int, end: int, random: np.random.Generator) -> Session:
    root = random.normal(size=(K, K))
    return Session(first, end, random.normal(size=K), 0.5 * np.eye(K) + 0.2 * root @ root.T, np.zeros(K))


def test_each_number_has_its_own_spread_of_sessions():
    random, counts = np.random.default_rng(4), [10] * 12
    within, between = np.array([0.0, 0.3, 0.3]), np.array([0.0, 0.1, 2.0])
    places = [between * random.normal(size=K) for _ in counts]
    runs = [OneChannel(**vars(parabola(random, place + within * random.normal(size=K), 400.0)))
            for place, count in zip(places, counts, strict=True) for _ in range(count)]  # fmt: skip
    total = Scatter(np.hypot(within, between))
    own, other = (np.sqrt(np.diag(one.covariance))
                  for one in learn_sessions(runs, np.zeros((K, K)), total, counts, np.zeros(K)))  # fmt: skip
    assert own == pytest.approx([0.0, 0.3, 0.3], rel=0.15)
    assert other[0] == 0.0
    assert other[1] == pytest.approx(0.1, abs=0.06)
    assert other[2] == pytest.approx(2.0, rel=0.4)


def test_one_session_leaves_what_is_usual():
    random, scatter = np.random.default_rng(4), Scatter(np.array([0.0, 0.2, 0.4]))
    own, other = learn_sessions([parabola(random, np.zeros(K))], np.eye(K), scatter, [1], np.array([1.0, 0.0, 0.0]))
    assert own is scatter
    assert other.sizes == pytest.approx([1.0, *np.sqrt(USUAL_SESSION_SHARE) * scatter.sizes[1:]])


@pytest.mark.parametrize("n", range(len(TIMES)))
def test_another_session_is_known_by_what_the_reference_says_of_the_vehicle_alone(n):
    random, spread = np.random.default_rng(2), np.array([0.5, 0.0, 3.0])
    runs, V = [parabola(random, np.array([1.0, 1.0, 1.0])) for _ in range(5)], 0.7 * np.eye(K)
    found = of_another(runs, V, Scatter(spread), 2)[n]
    # all of it written out: s and the reference's t, both in every run
    H, r = sum(one.curvature for one in runs), -sum(one.offset for one in runs)
    T = np.diag((TIMES[n] * spread) ** 2)
    joint = np.block([[V + T, V], [V, V + T]])  # of the reference's values, and another session's
    gain = joint[K:, :K] @ np.linalg.inv(np.eye(K) + H @ joint[:K, :K])
    assert found.mean == pytest.approx(gain @ r)
    np.testing.assert_allclose(found.V, joint[K:, K:] - gain @ H @ joint[:K, K:])
    assert found.log_prior == times_log_prior(2)[n]


def test_how_far_sessions_differ_is_known_the_better_the_more_there_are():
    one, three, many = (np.exp(times_log_prior(sessions)) for sessions in (1, 3, 30))
    assert sum(one) == pytest.approx(1.0)
    assert one[-1] > 3.0 * three[-1] > 0.0
    assert many[0] > 0.99


@pytest.mark.parametrize(("apart", "n"), [(0.1, 0), (0.8, 2)])
def test_a_session_far_off_differs_further_than_those_that_are_known(apart, n):
    random = np.random.default_rng(3)
    known, new = ([parabola(random, np.full(K, place), 400.0) for _ in range(4)] for place in (0.0, apart))
    another = of_another(known, 0.01 * np.eye(K), Scatter(np.full(K, 0.2)), 1)
    watched = SimpleNamespace(sessions=[Session(4, 8, np.zeros(K), 0.01 * np.eye(K), np.zeros(K))], another=another)
    watched.pooled = lambda sessions: [SessionRuns.of(one, new) for one in sessions]
    assert WatchedRuns.with_another(watched, 4)[-1].V is another[n].V


def test_what_the_reference_has_of_a_label_is_known_from_its_runs():
    random, label = np.random.default_rng(5), 2
    runs, V = [parabola(random, np.array([0.0, 1.0, 0.4]), 5.0) for _ in range(4)], np.diag([0.5, 0.3, 0.0])
    usual = UsualLabels(np.full(K, 0.2), np.full(K, 0.4), np.full(K, 0.1), np.full(K, 0.3))
    healthy = SimpleNamespace(usual=usual, at=lambda labels: [])
    watched = SimpleNamespace(together=SimpleNamespace(V=V), k=K, healthy=healthy, runs=runs, learned=4, events=[])
    first, later = WatchedRuns.with_usual(watched, [session(4, 6, random), session(6, 8, random)], label)
    H, r = sum(one.curvature for one in runs), -sum(one.offset for one in runs)
    prior = np.linalg.inv(V + np.diag([0.0, 0.0, 0.3**2 + 0.4**2]))
    np.testing.assert_allclose(first.V, np.linalg.inv(prior + H))
    assert first.mean == pytest.approx(np.linalg.solve(prior + H, r + prior @ np.array([0.0, 0.0, 0.1])))
    assert (later.first, later.end) == (6, 8)
    assert not np.allclose(first.mean[label], 0.1)


@pytest.mark.parametrize("span", [(2, 4), (3, 7), (5, 8), (2, 8)])
def test_a_label_over_runs_of_one_or_two_sessions_has_the_evidence_of_the_model_written_out(span):
    random, label, tau = np.random.default_rng(7), 1, 1.7
    runs = {n: parabola(random, random.normal(size=K)) for n in range(2, 8)}
    sessions = [session(2, 5, random), session(5, 8, random)]
    found = [SessionRuns.of(one, [runs[n] for n in range(one.first, one.end)]) for one in sessions]
    slope, precision = (sum(part) for part in zip(*(one.alone(*span) for one in found), strict=True))
    total = 1.0 + tau**2 * precision[label]
    gain = 0.5 * (slope[label] ** 2 * tau**2 / total - np.log(total))
    wide = np.zeros((2 * K + 1, 2 * K + 1))  # both sessions' values and the label's size
    wide[:K, :K], wide[K : 2 * K, K : 2 * K], wide[-1, -1] = sessions[0].V, sessions[1].V, tau**2
    augmented = []
    for n, one in runs.items():
        which = int(n >= 5)
        into = np.zeros((K, 2 * K + 1))
        into[:, which * K : (which + 1) * K] = np.eye(K)
        into[label, -1] = float(span[0] <= n < span[1])
        about = replace(one, at=one.at - sessions[which].mean)
        augmented.append(Parabola(np.zeros(2 * K + 1), about.constant, into.T @ about.offset,
                                  into.T @ about.curvature @ into))  # fmt: skip
    without = wide.copy()
    without[-1, -1] = 0.0
    pooled = Pooled.of(augmented, wide)
    assert gain == pytest.approx(pooled.log_evidence() - pooled.log_evidence(without))
    assert sum(one.pooled.log_evidence() for one in found) == pytest.approx(pooled.log_evidence(without))
    size = pooled.mean()[-1]
    assert slope[label] * tau**2 / total == pytest.approx(size)
    for place, one in enumerate(found):
        values = pooled.mean()[place * K : (place + 1) * K] + sessions[place].mean
        assert one.given(*span, label, float(size)) == pytest.approx(values)
    places = np.array([label, 2])
    q, Q = (sum(part) for part in zip(*(one.beside(*span, places) for one in found), strict=True))
    assert (q[0], Q[0, 0]) == pytest.approx((slope[label], precision[label]))
    nat, mean, _ = size_posterior(q, Q, np.array([[tau**2, 0.0]]), False)
    assert (nat, mean) == pytest.approx((gain, size))


def test_the_density_at_a_place_is_that_of_the_runs_and_the_prior_there():
    random, label, size, span = np.random.default_rng(11), 1, 0.8, (3, 5)
    one = session(2, 6, random)
    there = replace(one, values=one.mean + random.normal(size=K))
    runs = [parabola(random, random.normal(size=K)) for _ in range(4)]

    def written_out(session, size):
        total = (session.values - one.mean) @ np.linalg.solve(one.V, session.values - one.mean)
        for n, run in enumerate(runs, one.first):
            x = session.values + size * (np.arange(K) == label) * (span[0] <= n < span[1]) - run.at
            total += run.value + 2.0 * run.slope @ x + x @ run.curvature @ x
        return -0.5 * total

    begin = replace(one, values=one.mean)
    found = SessionRuns.of(there, runs).log_density(*span, label, size)
    nothing = SessionRuns.of(begin, runs).log_density(*span, label, 0.0)
    assert found - nothing == pytest.approx(written_out(there, size) - written_out(begin, 0.0))


def test_a_session_is_split_where_another_begins_and_only_there():
    one = Session(2, 8, np.zeros(K), np.eye(K), np.ones(K))
    another = Another(np.ones(K), 2.0 * np.eye(K), -0.5)
    first, second = split([one], 5, another)
    assert (first.first, first.end, second.first, second.end) == (2, 5, 5, 8)
    assert first.values is one.values
    assert second.values == pytest.approx(np.ones(K))
    assert split([one], 8, another) == [one]
    empty, every = split([one], 2, another)  # none of the runs watched is the reference's
    assert (empty.first, empty.end, every.first, every.end) == (2, 2, 2, 8)
    assert SessionRuns.of(empty, []).pooled.log_evidence() == 0.0
    assert split([empty, every], 2, another) == [empty, every]


def test_deviations_of_a_session_are_those_of_its_runs_together():
    random, spread = np.random.default_rng(3), np.array([0.4, 0.0, 1.0])
    runs = [parabola(random, np.ones(K)) for _ in range(4)]
    whole = marginalised(Pooled.of(runs, np.eye(K)).parabola(), Scatter(spread))
    assert Pooled.of([whole], np.eye(K)).log_evidence() == pytest.approx(
        Pooled.of(runs, np.eye(K) + np.diag(spread**2)).log_evidence()
    )
