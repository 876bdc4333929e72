"""The hierarchical model in closed form: scatter of runs, sessions, what of a label is usual, labels in one's place."""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import logsumexp

from glider.tools.inference.hyperparameters import HEALTHY
from glider.tools.inference.pooled import Pooled, Scatter, learn_scatter
from glider.tools.own.decision import (
    FORM_SHARES,
    SIZES,
    Deviations,
    Healthy,
    Hypothesis,
    UsualLabels,
    decide,
    log_prior,
    usual_share,
    with_usual,
)
from glider.tools.own.effects import INPUT, PARAMETER, PUSH, Effect
from glider.tools.own.evidence import alone
from glider.tools.own.hierarchy import ChannelErrors, Expansion, RunLevel
from glider.tools.own.identify import run_inflation
from glider.tools.own.posterior import Engine
from glider.tools.own.runs_fit import LineSearch, left_out
from glider.tools.own.watch import Event, Refit, Watch

LABELS = [Effect("gain", INPUT, "motor", "gain", "1", 0.1), Effect("mass", PARAMETER, "mass", "value", "kg", 0.1),
          Effect("force", PUSH, "heave", "push", "m/s2", 0.1)]  # fmt: skip
PRECISION = 400.0  # of each column in a run


def run_at(place: np.ndarray, alike: float = 0.0) -> Expansion:
    """A run whose likelihood is a normal one about `place` (3,); alike: correlation of the first two columns."""
    curvature = PRECISION * np.array([[1.0, alike, 0.0], [alike, 1.0, 0.0], [0.0, 0.0, 1.0]])
    blocks, ones = np.zeros((2, 2, 3)), np.ones(3)
    return Expansion(np.zeros(3), float(place @ curvature @ place), -curvature @ place, curvature, np.ones(1),
                     np.ones(1), np.ones(1), blocks, blocks[0], ones, curvature[None])  # fmt: skip


class Columns:
    """Stands for an observer of a count of runs: nothing is flown here."""

    horizon = 1.0

    def __init__(self, runs: int):
        self.runs = [None] * runs


def usually(scatter: float = 0.0, mean: float = 0.0) -> UsualLabels:
    """Of the first label."""
    first = np.array([1.0, 0.0, 0.0])
    return UsualLabels(scatter * first, scatter * first, mean * first, np.zeros(3))


def by_itself(size: float) -> Scatter:
    return Scatter(np.array([0.0, 0.0, size]))


def healthy(**changes) -> Healthy:
    errors = ChannelErrors(np.ones(1), np.ones(1))
    one = Healthy(LABELS, np.zeros((3, 3)), by_itself(1.0), by_itself(0.7),
                  usually(), errors, 1.0, 10, 0.5)  # fmt: skip
    return replace(one, **changes)


def engine(runs: int, **changes) -> Engine:
    found = Engine(Columns(runs), healthy(**changes))
    found.reach = np.ones(3)
    return found


def test_scatter_is_learned_where_runs_may_differ_and_stays_nothing_elsewhere():
    random = np.random.default_rng(3)
    runs = [run_at(np.array([0.0, 0.0, 0.7]) * random.standard_normal(3)) for _ in range(60)]
    found = learn_scatter(runs, np.zeros((3, 3)), Scatter(np.array([0.0, 0.02, 0.5]))).sizes
    assert found[0] == 0.0
    assert found[1] < 0.03
    assert found[2] == pytest.approx(0.7, rel=0.2)


def test_a_few_runs_change_little_of_a_scatter_that_many_have_shown():
    """Three runs, one of them far off: what 30 healthy runs differ by stays nearly as it is."""
    runs, usual = [run_at(np.array([0.0, 0.0, place])) for place in (0.1, -0.2, 3.0)], np.array([0.0, 0.0, 0.4])
    known, unknown = (
        learn_scatter(runs, np.zeros((3, 3)), Scatter(usual), learned_from=count).sizes[2] for count in (30, 0)
    )
    assert known < 0.75 < 1.3 < unknown


@pytest.mark.parametrize(
    ("common", "own", "kind", "times"), [(0.8, 0.2, 0, 0), (1.5, 0.2, 0, 1), (6.0, 0.2, 0, 2), (0.0, 1.2, 1, 0)]
)
def test_runs_themselves_say_whether_they_are_of_one_session_and_how_far_that_differs(common, own, kind, times):
    random, asked = np.random.default_rng(5), engine(12, session=by_itself(0.8), scatter=by_itself(0.4))
    runs = [run_at(np.array([0.0, 0.0, common + own * random.standard_normal()])) for _ in range(12)]
    by, _, evidence, *_ = asked.best_sizes(runs, [], np.zeros(3))
    best, _ = asked.deviations[2 * times + kind]
    assert by.scatter is best.scatter
    assert np.array_equal(by.V, best.V)
    each = [prior + Pooled.of(one.marginal(runs), one.V).log_evidence() for one, prior in asked.deviations]
    assert evidence == pytest.approx(logsumexp(each) - np.log(2.0))


def test_deviations_alike_in_all_runs_have_the_prior_of_their_two_levels():
    by = Deviations(np.diag([0.0, 0.0, 4.0]), by_itself(2.0))
    shared, own = np.array([0.0, 0.0, 1.0]), np.array([[0.0, 0.0, 3.0], [0.0, 0.0, 1.0]])
    assert by.prior(shared, own, ()) == pytest.approx(1.0 / 4.0 + 1.0)
    assert by.prior(shared, own, (2,)) == pytest.approx(1.0)


@pytest.mark.parametrize("places", [[0], [2], [0, 1], [1, 2]], ids=["label", "force", "labels", "label and force"])
def test_the_grid_of_sizes_is_what_each_prior_alone_gives(places):
    random = np.random.default_rng(3)
    asked = engine(4, V=np.diag([0.1, 0.0, 0.0]), scatter=by_itself(0.3))
    runs, shared = [run_at(random.normal(size=3), 0.3) for _ in range(4)], random.normal(size=3)
    by, at, evidence, mean, sd, off = asked.best_sizes(runs, places, shared)
    nat, chosen = [], []
    for each, prior in asked.deviations:
        for *sizes, form in itertools.product(*[SIZES.tolist()] * len(places), FORM_SHARES):
            pooled = Pooled.of(each.marginal(runs), asked.variance(each.V, places, sizes, shared, form))
            nat.append(prior + pooled.log_evidence())
            chosen.append(sizes)
    assert evidence == pytest.approx(logsumexp(nat) - np.log(2 * len(SIZES) ** len(places) * len(FORM_SHARES)))
    assert at.log_evidence() + max(prior for _, prior in asked.deviations) == pytest.approx(max(nat))
    assert mean == pytest.approx(at.mean()[places])
    assert sd**2 == pytest.approx(np.diag(at.covariance())[places])
    # the numbers of the vehicle and what labels add to them, one behind the other
    tau2 = np.array(chosen[int(np.argmax(nat))]) ** 2
    both = np.hstack([np.eye(3), np.eye(3)[:, places]])
    prior = np.diag(np.append(np.diag(at.V) - np.eye(3)[:, places] @ tau2, tau2))
    covariance = np.linalg.inv(np.eye(len(prior)) + prior @ both.T @ at.H @ both) @ prior
    assert mean - off == pytest.approx((covariance @ both.T @ at.r)[3:])
    # what it is led by: the most probable sizes of labels that are as they have it
    each, _ = next(one for one in asked.deviations if one[0].scatter is by.scatter)
    plain = [asked.variance(each.V, places, sizes, shared, 0.0)
             for sizes in itertools.product(*[SIZES.tolist()] * len(places))]  # fmt: skip
    pooled = Pooled.of(each.marginal(runs), each.V)
    np.testing.assert_allclose(by.V, max(plain, key=pooled.log_evidence))


def test_a_label_alone_gains_what_its_evidence_says():
    asked, runs = engine(4), [run_at(np.array([0.3, 0.0, 0.0])) for _ in range(4)]
    pooled = Pooled.of(asked.together.marginal(runs), asked.together.V)
    gain, size = asked.label_gains(*alone(pooled))
    whole = []
    for tolerances in SIZES:
        V = asked.together.V.copy()
        V[0, 0] = tolerances**2
        whole.append(pooled.log_evidence(V) - pooled.log_evidence())
    assert gain[0] == pytest.approx(np.log(np.mean(np.exp(whole))))
    assert size[0] == pytest.approx(0.3, rel=1e-2)
    assert gain[1] < 0.0


@pytest.mark.parametrize(("usual", "least", "most"), [(0.0, 0.0, 0.0), (0.05, 1.0, 12.0), (3.0, 15.0, 1e3)])
def test_what_healthy_runs_show_of_a_label_is_no_evidence_of_a_change(usual, least, most):
    asked = engine(4, usual=usually(usual))
    assert least <= usual_share(asked.healthy, 0, float(asked.reach[0]), 0.5, 0.08, 4) <= most


@pytest.mark.parametrize(("mean", "least", "most"), [(0.5, 18.0, 20.0), (0.45, 17.0, 19.0), (-0.5, 0.0, 0.0)])
def test_what_all_healthy_runs_show_of_a_label_is_no_change_but_the_opposite_is(mean, least, most):
    """A label of 0.5 tolerances, 0.08 known: some 18 nat."""
    asked = engine(4, usual=usually(0.02, mean))
    assert least <= usual_share(asked.healthy, 0, 1.0, 0.5, 0.08, 4) <= most


def test_what_sessions_differ_by_is_no_reason_for_a_change_within_one():
    """Within a session single runs scatter; another one differs as sessions do, and by what all have."""
    usual = UsualLabels(np.full(3, 0.1), np.full(3, 0.2), np.full(3, 0.5), np.full(3, 0.3))
    for within, mean, variance in ((True, 0.0, 0.0025), (False, 0.5, 0.09 + 0.04 + 0.0025)):
        assert usual.of_runs(0, 4, within) == (mean, pytest.approx(variance))
    asked = engine(4, usual=usual)
    within, beyond = (usual_share(asked.healthy, 0, 1.0, 0.5, 0.08, 4, within=one) for one in (True, False))
    assert within < beyond


def test_of_a_label_that_gains_little_no_more_is_usual_and_of_one_that_gains_much_all_but_what_is_not():
    """By the parabola some 18 nat; a likelihood that falls faster towards no change has more."""
    asked = engine(4, usual=usually(3.0))
    assert usual_share(asked.healthy, 0, 1.0, 0.5, 0.08, 4, gain=60.0) == pytest.approx(60.0, abs=2.5)
    assert usual_share(asked.healthy, 0, 1.0, 0.5, 0.08, 4, gain=5.0) == pytest.approx(5.0, abs=2.5)
    assert usual_share(asked.healthy, 0, 1.0, 0.5, 0.08, 4, gain=-5.0) == 0.0


def test_two_labels_that_healthy_runs_show_are_no_change():
    """Both in their usual place: no change says as much as both; one of them beside what is not usual says nothing."""
    both = healthy(usual=UsualLabels(np.full(3, 0.02), np.zeros(3), np.array([0.5, 0.4, 0.0]), np.zeros(3)))

    def at(labels, gain, sizes) -> Hypothesis:
        return Hypothesis(labels, gain + log_prior(both, labels), np.array(sizes), np.full(len(sizes), 0.08),
                          np.zeros(3), np.zeros((4, 3)), np.ones(4))  # fmt: skip

    every = [
        at((), 0.0, []),
        at(("gain",), 18.0, [0.5]),
        at(("mass",), 11.0, [0.4]),
        at(("gain", "mass"), 29.0, [0.5, 0.4]),
    ]
    none, *_, pair = with_usual(every, both, np.ones(3), 4)
    assert none > pair
    beyond = [*every[:2], at(("mass",), 61.0, [1.0]), at(("gain", "mass"), 79.0, [0.5, 1.0])]
    none, gain, mass, pair = with_usual(beyond, both, np.ones(3), 4)
    assert mass > max(none, gain, pair)


@pytest.mark.parametrize(("moved", "least", "most"), [(0.0, 0.0, 0.0), (0.25, 1.0, 12.0), (100.0, 15.0, 1e3)])
def test_what_the_form_of_an_effect_lacks_is_no_evidence_of_another_beside_it(moved, least, most):
    """A label of 0.5 tolerances beside effects of mean square `moved`, whose form is 0.2 of them off."""
    asked = engine(4)
    assert least <= usual_share(asked.healthy, 0, 1.0, 0.5, 0.08, 4, moved) <= most


def test_of_a_label_a_force_may_be_that_its_equations_do_not_have():
    asked = engine(4)
    V = asked.variance(np.zeros((3, 3)), [0], [2.0], np.array([5.0, 0.0, 0.0]), 0.2)
    assert np.diag(V) == pytest.approx([4.0, 0.0, 1.0])
    assert asked.variance(np.zeros((3, 3)), [2], [2.0], np.array([0.0, 0.0, 5.0]), 0.2)[2, 2] == pytest.approx(4.0)


def about(at: np.ndarray, place: np.ndarray) -> Expansion:
    """A run whose likelihood is a normal one about `place`, expanded elsewhere."""
    one, off = run_at(place), at - place
    return replace(one, at=at, value=float(off @ one.curvature @ off), slope=one.curvature @ off)


class Flown(Engine):
    """Stands for an engine whose runs are flown: their likelihood is a normal one about `places` (runs, 3), but by a
    filter that is begun anew it is much worse where the first number is beyond `edge`."""

    places, edge, off = np.zeros((1, 3)), np.inf, 0.0  # off: by which derivatives of another place do not hold

    def _all_followed(self, own, columns, found):
        there = [about(at, place) for at, place in zip(own, self.places, strict=True)]
        return [replace(one, value=one.value + self.off) for one in there]

    def expansions(self, own, columns, keep=False):
        found = [about(at, place) for at, place in zip(own, self.places, strict=True)]
        return [replace(one, value=one.value + 1e5 * max(0.0, one.at[0] - self.edge)) for one in found]


def asked_of(places: np.ndarray, edge: float = np.inf, off: float = 0.0) -> Flown:
    found = Flown(Columns(len(places)), healthy())
    found.reach, found.places, found.edge, found.off = np.ones(3), places, edge, off
    return found


def test_a_fit_ends_where_its_posterior_rests():
    """A force beside a label: where it is led, the label is as its equations have it."""
    asked = asked_of(np.tile([5.0, 0.0, 2.0], (4, 1)))
    found = asked.fit(("gain",))
    again = asked.fit(("gain",), found)
    assert again.shared == pytest.approx(found.shared, abs=1e-6)
    assert again.evidence == pytest.approx(found.evidence, abs=1e-6)
    by, *_ = asked.best_sizes(found.found, [0], found.shared)
    assert found.shared[2] == pytest.approx(Pooled.of(by.marginal(found.found), by.V).mean()[2])
    assert np.diag(by.V)[2] in np.diag(asked.deviations[0][0].V) + np.diag(asked.deviations[1][0].V)


def test_a_way_that_ends_worse_by_the_filter_there_is_taken_back():
    places = np.tile([5.0, 0.0, 0.0], (4, 1))
    assert asked_of(places).fit(("gain",)).shared[0] == pytest.approx(5.0, abs=0.05)
    edged = asked_of(places, edge=1.5, off=1.0).fit(("gain",))
    assert 0.5 < edged.shared[0] <= 1.5
    assert edged.own[:, 0].max() <= 1.5


class Searched(LineSearch):
    """The same for a search along a line, of runs whose filters are kept or begun anew."""

    def misfit(self, n, row):
        kept = self.warm[n].filtered is not None
        return about(row, self.warm[n].at + 5.0).value + (0.0 if kept else 1e5 * max(0.0, row[0] - 1.5))


def test_a_step_into_a_place_that_is_worse_by_its_own_filter_is_searched_by_that():
    at, limits = np.zeros(3), (np.full(3, -20.0), np.full(3, 20.0))
    runs = [replace(about(at, at + 5.0), filtered=SimpleNamespace()) for _ in range(2)]
    observer = SimpleNamespace(each=lambda asked, places: [asked(n) for n in places])
    search = Searched(observer, LABELS, runs, Scatter(np.zeros(3)), 1.0, np.eye(3), limits, healthy().errors, 1.0)
    values, own, gain = search.along(at, np.tile(at, (2, 1)), Pooled.of(runs, np.eye(3)))
    assert gain > 0.0
    assert 0.5 < values[0] <= 1.5
    assert own[:, 0] == pytest.approx(values[0])


def test_a_label_that_acts_alike_comes_in_the_place_of_the_best():
    asked, runs = engine(4), [run_at(np.array([1.0, 0.0, 0.0]), alike=0.999) for _ in range(4)]
    shared = np.array([1.0, 0.0, 0.0])
    runs = [replace(one, at=shared, value=0.0, slope=np.zeros(3)) for one in runs]
    leading = Hypothesis(("gain",), 0.0, np.ones(1), np.ones(1), shared, np.tile(shared, (4, 1)), np.ones(4), 0.0, runs)
    (label, begin), *_ = asked.swaps(leading, {("gain",): leading})
    assert label == "mass"
    assert begin.shared == pytest.approx([0.0, 0.99, 0.0], abs=0.02)
    found = {("gain",): leading, ("mass",): replace(leading, labels=("mass",))}  # as probable as it comes to from there
    assert not [label for label, _ in asked.swaps(leading, found) if label in ("gain", "mass")]
    lost = found | {("mass",): replace(leading, labels=("mass",), evidence=-20.0)}
    assert asked.swaps(leading, lost)[0][0] == "mass"


def refit(score: float, label: str, first: int = 2, end: int = 6, usual: float = 0.0) -> Refit:
    return Refit(score, Event({}, first, end, label, 1.0, 0.1, 0.0), [], usual)


def test_labels_together_count_against_a_force_that_none_has():
    asked = Watch(Columns(6), healthy(), 2)
    events = [refit(10.0, "force"), refit(9.5, "gain"), refit(9.4, "mass")]
    found, chances = asked.decided(events)
    assert (found.event.label, sum(chances.values())) == ("gain", pytest.approx(1.0))
    assert asked.decided(events[:2])[0].event.label == "force"


def test_a_label_counts_over_all_spans_in_which_it_may_be():
    asked = Watch(Columns(6), healthy(), 2)
    events = [refit(10.0, "gain", 2, 4), refit(9.6, "mass"), refit(9.8, "mass", 3)]
    found, chances = asked.decided(events)
    assert (found.event.label, found.event.first) == ("mass", 3)
    assert chances["mass"] == pytest.approx(np.exp([9.6, 9.8]).sum() / np.exp([10.0, 9.6, 9.8]).sum())


def test_what_healthy_runs_show_of_a_label_counts_for_no_change_and_none_against_the_label():
    asked = Watch(Columns(6), healthy(), 2)
    asked.sessions, asked.led_alone = [], {None: (0.0, [])}
    events = [refit(10.0, "gain", usual=8.0), refit(9.0, "mass", usual=1.0)]
    assert asked.unchanged(events) == {None: 8.0}
    assert asked.decided(events)[0].event.label == "gain"


def test_that_nothing_changed_has_its_prior_probability():
    asked = engine(4)
    assert log_prior(asked.healthy, ()) == pytest.approx(np.log1p(-HEALTHY.changed))


LEVEL = RunLevel(ChannelErrors(np.ones(1), np.full(1, 4.0)), 2.0, 0.5)


@pytest.mark.parametrize("squares", [0.0, 10.0, 40.0, 400.0])
def test_a_run_s_own_level_of_errors_is_the_most_probable(squares):
    levels = np.linspace(0.0, 6.0, 100_001)
    every = squares * np.exp(-levels) + 40.0 * levels + (levels / 0.5) ** 2
    assert LEVEL.value(squares, 40.0) == pytest.approx(every.min(), abs=1e-4)
    assert LEVEL.log_level(squares, 40.0) == pytest.approx(levels[every.argmin()], abs=1e-3)
    assert replace(LEVEL, scatter=0.0).value(squares, 40.0) == squares


@pytest.mark.parametrize("size", [0.1, 1.0])
def test_a_run_at_its_own_level_is_a_parabola_above_what_it_has_everywhere(size):
    random = np.random.default_rng(8)
    one = replace(run_at(size * random.normal(size=3), 0.3), samples=np.full(1, 320.0))  # 40 independent errors
    leveled, count = LEVEL.of(one), LEVEL.count(one)
    assert count == pytest.approx(40.0)
    assert leveled.value == pytest.approx(LEVEL.value(one.value, count))
    for _ in range(20):
        x = random.normal(size=3)
        assert leveled.at_place(x) > LEVEL.value(one.at_place(x), count) - 1e-9
        near = one.at + 1e-6 * x
        assert leveled.at_place(near) == pytest.approx(LEVEL.value(one.at_place(near), count), abs=1e-6)


@pytest.mark.parametrize("excess", [1.0, 3.0])
def test_runs_that_differ_by_more_than_they_say_count_for_less(excess):
    """Runs' places scatter by `excess` times what their likelihood has: its square is found by leaving runs out."""
    random = np.random.default_rng(5)
    sizes, free = [], np.ones(3, dtype=bool)
    for _ in range(40):
        places = excess * random.standard_normal((20, 3)) / np.sqrt(PRECISION)
        runs, V = [run_at(place) for place in places], 100.0 * np.eye(3)
        sizes.append(run_inflation(Pooled.of(runs, V), left_out(runs, V), free))
    assert np.median(sizes) == pytest.approx(excess**2, rel=0.3)
    assert min(sizes) >= 1.0
    assert run_inflation(Pooled.of(runs[:2], V), left_out(runs[:2], V), free) == 1.0


def fitted(one: Healthy, sizes: dict[str, float], nat: float, sd: float | list[float] = 0.005) -> Hypothesis:
    """Labels of sizes, known to sd, that gain nat over none."""
    return Hypothesis(tuple(sizes), nat + log_prior(one, tuple(sizes)), np.array([*sizes.values()]),
                      np.broadcast_to(sd, len(sizes)), np.zeros(3), np.zeros((4, 3)), np.ones(4))  # fmt: skip


@pytest.mark.parametrize(("gain", "size", "first"), [(2300.0, 3.0, "gain"), (2.0, 0.015, "none")], ids=["far", "usual"])
def test_a_label_far_from_what_is_usual_is_not_lost_to_another(gain, size, first):
    """0.03 spreads are usual of the first label, known to 0.005; it gains what that says, the second half of it."""
    one, known = healthy(usual=usually(0.03)), 0.005
    every = [fitted(one, {}, 0.0, known), fitted(one, {"gain": size}, gain, known)]
    every += [
        fitted(one, {"mass": size}, 0.5 * gain, known),
        fitted(one, {"gain": size, "mass": 0.0}, gain - 4.0, known),
    ]
    found = decide(every, one, np.full(3, 1.0 / size), 4)
    assert max(found.chances, key=lambda label: found.chances[label]) == first


@pytest.mark.parametrize(("size", "beside"), [(0.3, False), (6.0, True)], ids=["within its form", "beyond"])
def test_an_effect_stands_beside_another_only_beyond_what_its_form_may_lack(size, beside):
    """Of 5 tolerances, its form 20 % off; another gains 12.5 nat beside it, as 5 sigma do; the odds of one stay."""
    one = healthy()
    alone = [fitted(one, {}, 0.0, []), fitted(one, {"gain": 5.0}, 2.0, [1.0])]
    both = decide([*alone, fitted(one, {"gain": 5.0, "mass": size}, 14.5, [1.0, size / 5.0])], one, np.ones(3), 4)
    assert (both.weights[2] > 0.5) == beside
    ratio = both.weights[1] / both.weights[0]
    assert ratio == pytest.approx(np.divide(*decide(alone, one, np.ones(3), 4).weights[::-1]))
