"""What an effect explains: innovations against the quantity of flight that its contribution follows, and run by run.

About the fitted model, innovations are linear in the parameters: e(theta) = e(0) + C theta. The partial residual of an
effect is e - C theta over its own parameters, and -C theta is what the effect predicts of it. In the channel in which
the effect predicts most, both are averaged over bins of the feature of flight that explains most of the prediction.
A run's own estimate is the step from the common fit to the minimum of that run's misfit, with the same priors.
"""

import numpy as np

from glider.tools.data.intervals import NINETY
from glider.tools.diagnose.record import Regressor, RunEstimate
from glider.tools.diagnose.residuals import FEATURE_UNITS, features, smoothed
from glider.tools.diagnose.search import Search
from glider.tools.gap.measure import scored_rows
from glider.tools.inference.fit import NUISANCE_LIMIT, Hypothesis, bounded_step

BINS, LEAST_IN_BIN = 24, 12  # of a feature; samples of each
PREFERRED = 0.01  # share of the prediction by which a later feature must explain more


def regressors(search: Search, hypothesis: Hypothesis) -> list[Regressor]:
    """One entry for each effect that the hypothesis has fitted, in their order."""
    if not hypothesis.free:
        return []
    search.fitter.linearise([hypothesis])
    estimates = _by_run(search, hypothesis)
    found = [_regressor(search, hypothesis, label, estimates) for label in dict.fromkeys(hypothesis.labels)]
    return [one for one in found if len(one.bins) > 1]


def _regressor(
    search: Search, hypothesis: Hypothesis, label: str, estimates: dict[tuple[str, str], list[RunEstimate]]
) -> Regressor:
    problem = search.problem
    own = np.array([free.label == label for free in hypothesis.free])
    predicted = -hypothesis.values[own] @ hypothesis.columns[own]
    row, reading = np.nonzero(problem.valid)
    power = np.bincount(reading, predicted**2, minlength=problem.valid.shape[1])
    channel = int(power.argmax())
    here = reading == channel
    rows, fit = row[here], predicted[here]
    residual = hypothesis.e[here] + fit
    with_what = {name: values[rows] for name, values in features(problem, search.gains).items()}
    name = _follows(fit, with_what)
    run, second = _largest(problem, rows, fit)
    return Regressor(
        label, problem.kind.readings[channel].name, name, FEATURE_UNITS[name], run, second,
        [
            (
                float(with_what[name][one].mean()), float(residual[one].mean()),
                float(residual[one].std() / np.sqrt(len(one))), float(fit[one].mean()), len(one),
            )
            for one in _bins(with_what[name])
        ],
        {free.name: estimates[label, free.name] for free in hypothesis.free if free.label == label},
    )  # fmt: skip


def _bins(values: np.ndarray) -> list[np.ndarray]:
    """Indices of equally filled bins of a feature, in its order; equal values stay together."""
    order = np.argsort(values, kind="stable")
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, BINS + 1)[1:-1]))
    parts = np.split(order, np.searchsorted(values[order], edges, side="right"))
    return [part for part in parts if len(part) >= LEAST_IN_BIN]


def _follows(fit: np.ndarray, with_what: dict[str, np.ndarray]) -> str:
    """The feature whose bins explain most of a prediction; of equally good ones the first."""
    best, most = next(iter(with_what)), -1.0
    total = max(float(fit @ fit), 1e-12)
    for name, values in with_what.items():
        explained = sum(len(one) * float(fit[one].mean()) ** 2 for one in _bins(values)) / total
        if explained > most + PREFERRED:
            best, most = name, explained
    return best


def _largest(problem, rows: np.ndarray, fit: np.ndarray) -> tuple[str, float]:
    """Run and second of its clock in which the prediction's mean square over SMOOTHED_SECONDS is largest, if scored."""
    bounds, t = problem.recording.bounds, problem.recording.t
    square = np.zeros(len(t))
    square[rows] = fit**2
    best = (problem.runs[0].name, float(t[0]), -1.0)
    for n, run in enumerate(problem.runs):
        first, last = bounds[n], bounds[n + 1]
        mean = smoothed(square[first:last], t[first:last])
        mean *= scored_rows(problem.kind.measures.windows(run.t), run.rows)
        at = int(mean.argmax())
        if mean[at] > best[2]:
            best = (run.name, float(run.t[at]), float(mean[at]))
    return best[0], best[1]


def _by_run(search: Search, hypothesis: Hypothesis) -> dict[tuple[str, str], list[RunEstimate]]:
    """By label and parameter, every run's own estimate with its 90 % interval."""
    fitter, problem = search.fitter, search.problem
    columns = np.vstack([fitter.J, hypothesis.columns])
    run = np.broadcast_to(problem.run_of[:, None], problem.valid.shape)[problem.valid]
    count = len(hypothesis.nuisance)
    at = np.concatenate([hypothesis.nuisance, hypothesis.values])
    prior = np.concatenate([np.full(count, fitter.prior_weight), np.ones(len(hypothesis.values))])
    low = np.concatenate([np.minimum(-NUISANCE_LIMIT, hypothesis.nuisance), hypothesis.low]) - at
    high = np.concatenate([np.maximum(NUISANCE_LIMIT, hypothesis.nuisance), hypothesis.high]) - at
    found: dict[tuple[str, str], list[RunEstimate]] = {(free.label, free.name): [] for free in hypothesis.free}
    for n, one in enumerate(problem.runs):
        own = columns[:, run == n]
        normal = own @ own.T + np.diag(prior)
        values = at + bounded_step(normal, own @ hypothesis.e[run == n] + prior * at, low, high)
        spread = np.sqrt(np.diag(np.linalg.inv(normal)))
        for k, free in enumerate(hypothesis.free, start=count):
            ends = (values[k], max(values[k] - NINETY * spread[k], free.low),
                    min(values[k] + NINETY * spread[k], free.high))  # fmt: skip
            value, *ci90 = (float(end * free.spread) for end in ends)
            found[free.label, free.name].append(RunEstimate(one.name, value, (ci90[0], ci90[1])))
    return found
