"""A label over a span of runs against its rivals: fitted without parabolas, compared over all spans near by."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glider.tools.inference.expansion import Expansion, expand
from glider.tools.inference.fit import bounded_step
from glider.tools.inference.hyperparameters import WATCH
from glider.tools.watch.events import GROWING, STEP, Change, Joint, Span
from glider.tools.watch.flights import RunEnsemble, numbers
from glider.tools.watch.history import ChangeEvent, History, confounded, within
from glider.tools.watch.label_fit import Affected, LabelFit, affected_runs, best_fit, cost_of, values_of

FITTED = 3  # runs in which rivals are fitted
SMALL = 20  # labels of a catalogue that can be tried whole
LINEAR_TRIED, INFLATED_TRIED = 4, 5  # labels: by the parabolas of the filter as it is, and by rough ones
FINAL = 3  # rivals that are compared over all spans
MAX_RIVAL_DEFICIT, MAX_RIVAL_DEFICIT_SHARE = (
    40.0,
    0.1,
)  # squared sigma, and share of what the best gains, that a rival may be behind
MAX_UNEXPLAINED_SHARE = 0.1  # of the excess: what the best of the first rivals may leave before more are tried
SPAN_SEARCH_RUNS = 2  # runs about a span's ends between which it is found again


def refit_event(
    history: History, joint: Joint, best: Change, changes: Sequence[Change], also: Sequence[str] = ()
) -> ChangeEvent | None:
    """The change fitted without parabolas, with the labels that may be meant as well, and its span found again.

    also: labels that are fitted whatever parabolas promise of them.
    """
    flights, shared = history.flights, history.flights.shared
    weights = best.span.weights(flights.count)
    inside = numbers(weights * history.judged)
    chosen = sorted(inside, key=lambda n: (-weights[n], -flights.excess(n)))[:FITTED]
    base = [within(flights, flights.runs[n].at) for n in chosen]
    affected = affected_runs(flights, chosen, weights, base)
    inside_state = weights > 0.0
    same = [
        one for one in changes if one.span == best.span and confounded(history, one.label, best.label, inside_state)
    ]
    same.sort(key=lambda one: -one.evidence)
    nothing = cost_of(affected, shared, best.label, np.zeros(len(best.size)))
    tried = LINEAR_TRIED if len(shared.labels) > SMALL else len(same)
    fits = {one.label: best_fit(affected, shared, one.label, one.size, False) for one in same[:tried]}
    samples = sum(flights.raw[n].samples for n in chosen)
    least = min(fits.values(), key=lambda fit: fit.cost)
    predicted_gain = sum(max(flights.excess(n), 0.0) for n in chosen)
    more = [(label, np.zeros(len(shared.labels[label]))) for label in also]
    if nothing - least.cost < (1.0 - MAX_UNEXPLAINED_SHARE) * predicted_gain and predicted_gain > 0.1 * samples:
        ranking = [
            one for one in inflated_ranking(affected, flights) if confounded(history, one[0], best.label, inside_state)
        ]
        more += ranking[:INFLATED_TRIED]
    for label, size in more:
        again = best_fit(affected, shared, label, size, True)
        if label not in fits or again.cost < fits[label].cost:
            fits[label] = again
    ranked = sorted(fits.values(), key=lambda fit: fit.cost)
    gained = nothing - ranked[0].cost
    kept = [
        fit for fit in ranked if fit.cost - ranked[0].cost <= max(MAX_RIVAL_DEFICIT, MAX_RIVAL_DEFICIT_SHARE * gained)
    ][:FINAL]
    found = [one for one in (over_spans(history, joint, best.span, fit) for fit in kept) if one is not None]
    if not found:
        return None
    winner = max(found, key=lambda event: event.evidence)
    other = by_other_course(history, joint, winner)
    if other is not None and other.evidence > winner.evidence:
        found[found.index(winner)] = winner = other
    winner.rivals = {event.label: event.evidence for event in found}
    # labels that were behind already count as far behind as they were in the runs of the fit
    odds = {fit.label: shared.odds.get(fit.label, 0.0) for fit in ranked}
    for fit in ranked:
        own = winner.evidence - 0.5 * (fit.cost - ranked[0].cost) + odds[fit.label] - odds[winner.label]
        winner.rivals.setdefault(fit.label, own)
    winner.explained = 0.5 * gained * len(inside) / max(1, len(chosen))
    winner.rivals = by_cause(winner, odds, flights.parts[0].kind.form_share)
    return winner


def by_cause(event: ChangeEvent, odds: dict[str, float], form_share: float) -> dict[str, float]:
    """Log evidence of labels where a share of what the change explains is left to the form of each."""
    best, confounded = event.rivals[event.label] - odds[event.label], form_share * event.explained
    return {
        label: best
        - max(best - (value - odds[label]) - confounded, WATCH.rival_share * (best - value + odds[label]))
        + odds[label]
        for label, value in event.rivals.items()
    }


def by_other_course(history: History, joint: Joint, event: ChangeEvent) -> ChangeEvent | None:
    """A change that is still there fitted as growing where it is a step, and the other way; None where it ended.

    Parabolas about a step say little of the small sizes that a growth begins with.
    """
    flights, span = history.flights, event.span
    other = replace(span, course=STEP if span.course == GROWING else GROWING)
    if other not in history.listed():
        return None
    weights = other.weights(flights.count)
    inside = numbers(weights * history.judged)
    chosen = [inside[0], inside[len(inside) // 2], inside[-1]]
    base = [within(flights, flights.raw[n].at) for n in chosen]
    affected = affected_runs(flights, chosen, weights, base)
    fit = best_fit(affected, flights.shared, event.label, event.size, False)
    return over_spans(history, joint, other, fit, (other.course,))


def inflated_ranking(affected: Affected, flights: RunEnsemble) -> list[tuple[str, np.ndarray]]:
    """Labels by what a filter that lets the vehicle move sees of them, with the sizes it predicts."""
    shared = flights.shared
    normal, slope = np.zeros((shared.count, shared.count)), np.zeros(shared.count)
    for part, weight, at, inflation in affected.each():
        one = expand(part, shared, at, 100.0).tempered(inflation)
        normal += weight**2 * one.curvature
        slope += weight * one.slope
    found = []
    for label, columns in shared.labels.items():
        own = normal[np.ix_(columns, columns)] + np.eye(len(columns))
        low, high = shared.limits(label, affected.at[0])
        size = bounded_step(own, slope[columns], low, high)
        found.append((float(2.0 * slope[columns] @ size + size @ own @ size), label, size))
    return [(label, size) for _, label, size in sorted(found, key=lambda one: one[0])]


def over_spans(
    history: History, joint: Joint, span: Span, fit: LabelFit, courses: Sequence[str] = (STEP, GROWING)
) -> ChangeEvent | None:
    """A label's evidence over every span near the one it was fitted in, by parabolas about what it fitted.

    Where the most evident reaches as far as was looked, it is looked for again about that one.
    """
    flights, shared = history.flights, history.flights.shared
    weights = span.weights(flights.count)
    first = max(history.begins, span.first - SPAN_SEARCH_RUNS)
    end = min(flights.count, span.end + SPAN_SEARCH_RUNS)
    about: dict[int, Expansion] = {}
    for n in range(first, end):
        if history.judged[n]:
            weight = weights[n] or (1.0 if span.course != GROWING or n >= span.end else weights[span.first])
            x = values_of(shared, fit.label, flights.runs[n].at, weight, fit.size)
            about[n] = flights.made(n, flights.expanded(n, within(flights, x)))
    found: dict[Span, tuple[float, np.ndarray, np.ndarray]] = {}
    for one in history.listed():
        near = abs(one.first - span.first) <= SPAN_SEARCH_RUNS and abs(one.end - span.end) <= SPAN_SEARCH_RUNS
        if not near or one.course not in courses:
            continue
        own = one.weights(flights.count)
        runs = [about[n] if own[n] and n in about else flights.runs[n] for n in range(flights.count)]
        tried = Joint(shared, runs, [*history.taken, (fit.label, own)])
        size, covariance = tried.size_of(len(history.taken))
        low, high = shared.limits(fit.label, tried.values)
        halved = float(np.log(2.0) * ((low == 0.0) | (high == 0.0)).sum())
        outside = np.maximum(low - size, 0.0) + np.maximum(size - high, 0.0)
        lost = 0.5 * float(outside @ np.linalg.solve(covariance, outside)) if outside.any() else 0.0
        prior = halved - lost + shared.odds.get(fit.label, 0.0)
        found[one] = tried.log_evidence - joint.log_evidence + prior, np.clip(size, low, high), covariance
    if not found:
        return None
    best = max(found, key=lambda one: found[one][0])
    evidence, size, covariance = found[best]
    if (best.first == first < span.first or best.end == end > span.end) and best.course == span.course:
        further = over_spans(history, joint, best, replace(fit, size=size), courses)
        if further is not None and further.evidence >= evidence:
            return further
    return ChangeEvent(
        fit.label, best, evidence, {}, size, covariance, 0.0, {one: value[0] for one, value in found.items()}
    )
