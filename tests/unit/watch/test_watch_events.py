"""Events over runs from parabolas alone: no flight is flown, the truth is a vector."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from glider.tools.inference.expansion import Expansion
from glider.tools.inference.parameters import NUISANCE, FreeParameter
from glider.tools.inference.pooled import Scatter, log_evidence, marginalised
from glider.tools.inference.shared_parameters import SharedParameters
from glider.tools.watch.events import GROWING, STEP, Joint, Span, spans
from glider.tools.watch.flights import LEAST_SIZE, RunEnsemble
from glider.tools.watch.history import History
from glider.tools.watch.label_fit import LabelFit
from glider.tools.watch.rivals import over_spans
from glider.tools.watch.scatter import learn_scatter

RUNS, SEEN = 10, 40  # rows of each run's Jacobian
FREE = [
    FreeParameter(NUISANCE, "P[0]", "P", 0, 0.1),
    FreeParameter("drag", "scale", "F", 0, 0.4, -2.0, 10.0),
    FreeParameter("lift", "scale", "F", 1, 0.3, -3.0, 10.0),
    FreeParameter("play", "width", "F", 2, 0.2, 0.0, 5.0),
]
LIMITS = {"drag": [(-2.0, 10.0)], "lift": [(-3.0, 10.0)], "play": [(0.0, 5.0)]}
SHARED = SharedParameters(FREE, {"drag": [1], "lift": [2], "play": [3]}, LIMITS)


def runs_of(change: np.ndarray, shared: np.ndarray, seed: int, scatter: float = 0.0) -> list[Expansion]:
    """Parabolas about 0 of runs whose values are the shared ones and `change` (runs, count)."""
    rng = np.random.default_rng(seed)
    found = []
    for own in change:
        J = 4.0 * rng.standard_normal((len(FREE), SEEN))
        truth = shared + own + scatter * rng.standard_normal(len(FREE))
        e = rng.standard_normal(SEEN) - J.T @ truth
        found.append(Expansion(np.zeros(len(FREE)), float(e @ e), J @ e, J @ J.T, float(e @ e) / SEEN, SEEN))
    return found


def moved_to(one: Expansion, at: np.ndarray) -> Expansion:
    """The same parabola about other values."""
    A, b = one.curvature, one.slope
    misfit = one.value + 2.0 * float(b @ at) + float(at @ A @ at)
    return Expansion(at, misfit, b + A @ at, A, misfit / SEEN, SEEN)


def best(joint: Joint, begins: int = 1):
    changes = joint.changes(spans([True] * RUNS, begins))
    return max(changes, key=lambda one: one.evidence)


def changed(label: int, weights: np.ndarray, size: float) -> np.ndarray:
    table = np.zeros((RUNS, len(FREE)))
    table[:, label] = size * weights
    return table


COMMON = np.array([1.0, 0.8, -0.5, 0.4])


@pytest.mark.parametrize("span", [Span(4, 10, STEP), Span(3, 6, STEP), Span(2, 10, GROWING), Span(7, 8, STEP)])
def test_label_span_course_and_size(span):
    joint = Joint(SHARED, runs_of(changed(2, span.weights(RUNS), 1.2), COMMON, 3), [])
    found = best(joint)
    assert (found.label, found.span) == ("lift", span)
    assert abs(found.size[0] - 1.2) < 3.0 / np.sqrt(found.precision[0, 0])
    assert found.evidence > 20.0


def test_what_all_runs_share_is_no_change():
    worst = [best(Joint(SHARED, runs_of(np.zeros((RUNS, len(FREE))), COMMON, seed), [])).evidence for seed in range(20)]
    assert max(worst) < 8.0


def test_a_play_does_not_become_negative():
    joint = Joint(SHARED, runs_of(changed(3, Span(5, 10, STEP).weights(RUNS), -0.8), np.zeros(len(FREE)), 4), [])
    plays = [one for one in joint.changes(spans([True] * RUNS, 1)) if one.label == "play"]
    assert max(one.size[0] for one in plays) >= 0.0
    at_the_change = next(one for one in plays if one.span == Span(5, 10, STEP))
    assert at_the_change.size[0] >= -float(np.clip(joint.values[3], 0.0, None)) - 1e-9


def test_a_second_event_beside_the_first():
    first, second = Span(3, 10, STEP), Span(6, 10, STEP)
    table = changed(2, first.weights(RUNS), 1.0) + changed(1, second.weights(RUNS), 0.8)
    runs = runs_of(table, COMMON, 5)
    joint = Joint(SHARED, runs, [("lift", first.weights(RUNS))])
    found = best(joint)
    assert (found.label, found.span) == ("drag", second)
    both = Joint(SHARED, runs, [("lift", first.weights(RUNS)), ("drag", second.weights(RUNS))])
    assert both.log_evidence > joint.log_evidence
    assert both.size_of(1)[0][0] == pytest.approx(0.8, abs=0.15)
    assert both.run_values(9)[2] - both.run_values(0)[2] == pytest.approx(1.0, abs=0.15)


def test_evidence_of_a_change_is_that_of_the_models_compared():
    runs = runs_of(changed(2, Span(5, 10, STEP).weights(RUNS), 0.7), COMMON, 6)
    span = Span(5, 10, STEP)
    without, with_it = Joint(SHARED, runs, []), Joint(SHARED, runs, [("lift", span.weights(RUNS))])
    found = next(one for one in without.changes([span]) if one.label == "lift")
    assert found.evidence == pytest.approx(with_it.log_evidence - without.log_evidence, abs=1e-6)


def test_runs_that_differ_by_themselves_are_no_events():
    quiet, scattered = (runs_of(np.zeros((RUNS, len(FREE))), COMMON, 7, scatter=s) for s in (0.0, 0.3))
    sizes = learn_scatter(scattered[:5], SHARED)
    assert best(Joint(SHARED, scattered, [])).evidence > 20.0  # were nothing known of it
    known = [marginalised(one, Scatter(sizes)) for one in scattered]
    assert best(Joint(SHARED, known, [])).evidence < 10.0
    assert learn_scatter(quiet[:5], SHARED)[1] < 0.3 * sizes[1]


def test_deviations_integrated_out_are_those_of_the_marginal():
    run = runs_of(np.zeros((1, len(FREE))), COMMON, 8)[0]
    sizes = np.array([0.2, 0.1, 0.3, 0.05])
    made = marginalised(run, Scatter(sizes))
    rng = np.random.default_rng(1)
    x = COMMON + 0.05 * rng.standard_normal(len(FREE))
    drawn = x + sizes * rng.standard_normal((200_000, len(FREE)))
    values = run.value + 2.0 * drawn @ run.slope + np.einsum("ij,jk,ik->i", drawn, run.curvature, drawn)
    least = values.min()
    sampled = least - 2.0 * np.log(np.mean(np.exp(-0.5 * (values - least))))
    shift = x - made.at
    closed = made.value + 2.0 * made.slope @ shift + shift @ made.curvature @ shift
    assert closed == pytest.approx(sampled, abs=0.3)
    assert log_evidence([run], np.diag(SHARED.prior**2), Scatter(sizes)) < 0.0


def test_no_event_before_it_may_begin_nor_at_a_run_that_was_not_judged():
    judged = [True, True, False, True, True]
    listed = spans(judged, 1)
    assert all(one.first >= 1 and judged[one.first] and judged[one.end - 1] for one in listed)
    assert Span(1, 4, STEP) in listed
    assert {one.end for one in listed if one.course == GROWING} == {5}


@pytest.mark.parametrize("span", [Span(2, 10, STEP), Span(1, 8, STEP), Span(4, 7, STEP)])
def test_a_change_found_in_one_run_is_followed_to_its_ends(span):
    runs = runs_of(changed(2, span.weights(RUNS), 1.2), COMMON, 9)
    flights = SimpleNamespace(
        count=RUNS, shared=SHARED, runs=runs, made=lambda n, one: one, expanded=lambda n, x: moved_to(runs[n], x)
    )
    history = History(flights, np.ones(RUNS, dtype=bool), 1)
    start = Span(5, 6, STEP)
    found = over_spans(history, history.joint(), start, LabelFit("lift", np.array([1.2]), 0.0))
    assert found.span == span
    with_it = Joint(SHARED, runs, [("lift", span.weights(RUNS))])
    assert found.evidence == pytest.approx(with_it.log_evidence - history.joint().log_evidence, abs=1e-6)


def test_a_run_whose_change_has_another_form_says_less_of_what_all_share():
    """The last run's change is left with errors ten times the others': its pull on the shared values falls."""
    raw = runs_of(np.zeros((RUNS, len(FREE))), COMMON, 11)
    noisy, smooth = RUNS - 1, RUNS - 2
    raw[noisy] = runs_of(np.zeros((1, len(FREE))), 10.0 * COMMON, 12)[0]
    raw[smooth] = replace(raw[smooth], nis=0.5 * raw[smooth].nis)
    flights = RunEnsemble([], SHARED, np.arange(RUNS) < 5, 1.0, np.ones(RUNS), np.full(len(FREE), LEAST_SIZE))
    flights.certainty = np.eye(len(FREE)) / LEAST_SIZE**2
    flights.raw = [moved_to(one, COMMON) for one in raw]
    flights.runs = [flights.made(n, one) for n, one in enumerate(flights.raw)]
    before = Joint(SHARED, list(flights.runs), []).values
    for n in (noisy, smooth):
        flights.inflate_run(n)
    after = Joint(SHARED, list(flights.runs), []).values

    assert flights.run_inflation[smooth] == 1.0  # none says more than the reference
    assert flights.run_inflation[noisy] == pytest.approx(flights.nis(noisy) / flights.usual_nis.mean())
    assert flights.run_inflation[noisy] > 20.0
    assert np.abs(after - COMMON).max() < 0.2 * np.abs(before - COMMON).max()


def test_the_form_of_a_strong_change_is_no_change_of_the_runs_before_it():
    """Drag by 40 spreads whose form looks like a lift of 5 % of it: runs before it had that lift the other way."""
    rng, size, first = np.random.default_rng(13), 40.0, 3
    raw = []
    for n in range(RUNS):
        J = 4.0 * rng.standard_normal((len(FREE), SEEN))
        J[2] = J[1] + 0.3 * J[2]  # lift looks like drag
        truth = np.array([0.0, size, 0.05 * size, 0.0]) if n >= first else np.zeros(len(FREE))
        e = rng.standard_normal(SEEN) - J.T @ truth
        raw.append(Expansion(np.zeros(len(FREE)), float(e @ e), J @ e, J @ J.T, float(e @ e) / SEEN, SEEN))
    change = np.array([0.0, size, 0.0, 0.0])
    parts = [SimpleNamespace(kind=SimpleNamespace(form=0.06))] * RUNS
    flights = RunEnsemble(parts, SHARED, np.arange(RUNS) < 1, 1.0, np.ones(RUNS), np.full(len(FREE), 0.01))
    flights.raw = [moved_to(one, change) if n >= first else one for n, one in enumerate(raw)]
    flights.runs = [flights.made(n, one) for n, one in enumerate(flights.raw)]
    before = [Span(1, first, STEP)]
    taken = [("drag", np.arange(RUNS) >= first)]

    def lift_before_it() -> float:
        joint = Joint(SHARED, list(flights.runs), taken)
        return joint.changes(before, ["lift"])[0].evidence

    assert lift_before_it() > 16.0
    for n in range(first, RUNS):
        flights.loosen(n, change)
    assert lift_before_it() < 0.0
    # what is not like the change is known from those runs as before: the third value's form is a few of its sigma
    A = flights.raw[-1].curvature
    assert flights.form[RUNS - 1] == pytest.approx(0.06 * np.abs(A @ change) / np.diag(A))
    assert flights.form[RUNS - 1][1] == pytest.approx(0.06 * size)


def test_forms_of_two_changes_in_a_run_add_up_in_squares():
    flights = RunEnsemble([SimpleNamespace(kind=SimpleNamespace(form=0.06))], SHARED, np.ones(1, dtype=bool))
    A = np.diag([1e4, 4e4, 1e4, 1e4])
    flights.raw = [Expansion(np.zeros(len(FREE)), 40.0, np.zeros(len(FREE)), A, 1.0, SEEN)]
    flights.runs, flights.run_inflation, flights.sizes = list(flights.raw), np.ones(1), np.full(len(FREE), 0.01)
    flights.loosen(0, np.array([0.0, 3.0, 0.0, 0.0]))
    flights.loosen(0, np.array([0.0, 4.0, 2.0, 0.0]))
    assert flights.form[0] == pytest.approx(0.06 * np.array([0.0, 5.0, 2.0, 0.0]))
    # the run knows each value by what it reads, and by what it may differ by
    apart = flights.form[0] ** 2 + 0.01**2
    assert np.diag(flights.runs[0].curvature) == pytest.approx(1.0 / (1.0 / np.diag(A) + apart))
