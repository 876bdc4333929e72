"""Runs left out: parameters fitted to a case's runs by prediction error, and every run flown by a fit to the others.

The fit to all runs is Levenberg and Marquardt's (`PredictionError.led`). The fit without a run is one Gauss-Newton step
from there, halved until it lowers the objective of the runs that it is for; the run is then flown at those values. Its
mean square is that of this flight: the quadratic that the step is taken from is wrong by orders of magnitude where the
runs that are left hold a direction by its prior alone.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from glider.tools.inference.fit import bounded_step
from glider.tools.inference.parameters import FreeParameter, model_at
from glider.tools.inference.prediction_error import DIFFERENCE_STEP, HORIZONS, STEPS, PredictionError, Windows
from glider.tools.inference.problem import Gains, Problem
from glider.tools.inference.vehicle_parameters import Parameters

SHARES = (1.0, 0.5, 0.25)  # of the step to the fit without a run


class HeldOutWindows(PredictionError):
    """Windows of runs with a list of free parameters about a problem's own model.

    scales: tolerances by channel that a residual is divided by. independent: residuals of all runs that count as
    independent, at most one for each window and channel.
    """

    def __init__(
        self, problem: Problem, free: Sequence[FreeParameter], scales: dict[str, float], independent: float = np.inf
    ):
        super().__init__(problem, Parameters(list(free), np.zeros(len(free))))
        self.scales, self.most_independent = scales, independent

    def independent(self, cuts: list[Windows]) -> float:
        """Residuals that count as independent."""
        return min(super().independent(cuts), self.most_independent)

    def model(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(P, F) at values (n,)."""
        return model_at(self.problem, self.free.free, values)

    @cached_property
    def cuts(self) -> list[Windows]:
        """The windows, cut in more than one way."""
        horizon, offsets = HORIZONS[-1]
        return [self.windows(horizon, offset) for offset in offsets]

    def further_columns(
        self, values: np.ndarray, known: list[np.ndarray], gains: Gains
    ) -> Iterable[tuple[np.ndarray, np.ndarray]]:
        """As `columns`, the first ones (known, of every cut) not flown again; gains: of the same model."""
        n = len(known[0])
        size = np.where(values + DIFFERENCE_STEP <= self.high, DIFFERENCE_STEP, -DIFFERENCE_STEP)
        points = [values, *(values + s * row for s, row in zip(size[n:], np.eye(len(values))[n:], strict=True))]
        Y = self.fly(points, gains, self.cuts)
        for k, one in enumerate(self.cuts):
            E = self.residuals(Y[:, k], one)
            yield E[0], np.concatenate([known[k], (E[1:] - E[0]) / size[n:, None]])

    def linearised(self, values: np.ndarray, gains: Gains | None = None) -> "Linearised":
        """Every run's mean square about values (n,); gains: the observer's there, if they are known."""
        gains = self.gains(values) if gains is None else gains
        return Linearised.gathered(values, self, self.columns(values, gains, self.cuts))

    def squares(self, points: list[np.ndarray], gains: Gains) -> np.ndarray:
        """Mean squares (points, runs, channels), whose sum is that over runs of the channels' mean, with an observer's
        gains for all points."""
        Y = self.fly(points, gains, self.cuts)
        runs, channels = len(self.problem.runs), len(self.channels)
        found = np.zeros((len(points), runs * channels))
        for k, one in enumerate(self.cuts):
            run_of, channel_of = self.origins(one)
            for n, e in enumerate(self.residuals(Y[:, k], one)):
                weight = self.weights(e)[0] / len(self.cuts)
                found[n] += np.bincount(run_of * channels + channel_of, weight * e * e, runs * channels)
        return found.reshape(len(points), runs, channels)

    def left_out(self, begin: np.ndarray) -> "LeftOut":
        """The fit to all runs, led from values (n,), and every run flown by the fit to the others."""
        values, cost, gains = self.led(self.clipped(begin), self.cuts, STEPS[-1])
        at, every = self.linearised(values, gains), np.arange(len(values))
        held = max(cost, 1.0) / self.independent(self.cuts)
        runs = len(at.value)
        kept = ~np.eye(runs, dtype=bool) if runs > 1 else np.full((1, 1), True)
        steps = [at.step(every, 1.0 / held, run if runs > 1 else None) for run in range(runs)]
        others, todo = np.tile(values, (runs, 1)), list(range(runs))
        (whole,) = self.squares([values], gains)
        found = whole.copy()
        for share in SHARES:
            tried = [self.clipped(values + share * steps[run]) for run in todo]
            for run, point, squares in zip(list(todo), tried, self.squares(tried, gains), strict=True):
                least = whole[kept[run]].sum() + held * values @ values
                if squares[kept[run]].sum() + held * point @ point <= least:
                    found[run], others[run] = squares[run], point
                    todo.remove(run)
            if not todo:
                break
        return LeftOut(values, found, others, at.normal.sum(axis=0) / held + np.eye(len(values)))


@dataclass
class LeftOut:
    """What `HeldOutWindows.left_out` finds."""

    values: np.ndarray  # (n,) of the fit to all runs
    squares: np.ndarray  # (runs, channels) of each run by the fit to the others; their sum is a mean over both
    others: np.ndarray  # (runs, n) values of those fits
    precision: np.ndarray  # (n, n) of the posterior by all runs

    @property
    def runs(self) -> np.ndarray:
        """Mean squares (runs,)."""
        return self.squares.sum(axis=1)

    @property
    def channels(self) -> np.ndarray:
        """Mean squares (channels,) over runs."""
        return self.squares.sum(axis=0) * self.squares.shape[1]


@dataclass
class Linearised:
    """Mean squares of runs, value + 2 slope d + d normal d at values + d; over channels, in healthy runs' units."""

    values: np.ndarray  # (n,)
    value: np.ndarray  # (runs,)
    slope: np.ndarray  # (runs, n)
    normal: np.ndarray  # (runs, n, n)
    windows: HeldOutWindows
    columns: list[np.ndarray]  # (n, residuals) of every cut

    @classmethod
    def gathered(cls, values: np.ndarray, windows: "HeldOutWindows", cut_columns: Iterable) -> "Linearised":
        """From (residuals, columns) of every cut."""
        n, runs = len(values), len(windows.problem.runs)
        normal, slope, value = np.zeros((runs, n, n)), np.zeros((runs, n)), np.zeros(runs)
        columns: list[np.ndarray] = []
        for one, (e, J) in zip(windows.cuts, cut_columns, strict=True):
            weight = windows.weights(e)[0] / len(windows.cuts)
            run_of, _ = windows.origins(one)
            columns.append(J)
            for run in range(runs):
                own = np.flatnonzero(run_of == run)
                weighted = J[:, own] * weight[own]
                normal[run] += weighted @ J[:, own].T
                slope[run] += weighted @ e[own]
                value[run] += float(weight[own] @ e[own] ** 2)
        return cls(values, value, slope, normal, windows, columns)

    def step(self, free: np.ndarray, weight: float, without: int | None = None) -> np.ndarray:
        """The most probable step (n,) in some of the parameters, by all runs but one; weight of a mean square of 1."""
        kept = np.arange(len(self.value)) != (-1 if without is None else without)
        normal = weight * self.normal[kept].sum(axis=0)[np.ix_(free, free)] + np.eye(len(free))
        slope = weight * self.slope[kept].sum(axis=0)[free] + self.values[free]
        low, high = self.windows.low - self.values, self.windows.high - self.values
        step = np.zeros(len(self.values))
        step[free] = bounded_step(normal, slope, np.minimum(low[free], 0.0), np.maximum(high[free], 0.0))
        return step

    def expected(self, free: np.ndarray, weight: float) -> tuple[float, float, np.ndarray]:
        """Of the most probable step in some of the parameters: the objective there, a mean square, half the logarithm
        of the posterior's precision, by Laplace's approximation, and the step (n,)."""
        step = self.step(free, weight)
        slope, normal, at = self.slope.sum(axis=0), self.normal.sum(axis=0), self.values + step
        objective = float(self.value.sum() + 2.0 * slope @ step + step @ normal @ step + at @ at / weight)
        precision = weight * normal[np.ix_(free, free)] + np.eye(len(free))
        return objective, 0.5 * float(np.linalg.slogdet(precision)[1]), step

    def information(self, other: np.ndarray, own: np.ndarray, weight: float) -> tuple[np.ndarray, np.ndarray]:
        """Precision (k, k) and score (k,) of parameters that are 0 here by all runs, others (n,) integrated out."""
        normal, score = weight * self.normal.sum(axis=0), -weight * self.slope.sum(axis=0)
        across = normal[np.ix_(other, own)]
        away = np.linalg.solve(normal[np.ix_(other, other)] + np.eye(len(other)), across).T
        return normal[np.ix_(own, own)] - away @ across, score[own] - away @ (score[other] - self.values[other])
