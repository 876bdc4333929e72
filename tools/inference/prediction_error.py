"""Identification by prediction error: parameters with which windows of the runs are flown best on commands alone.

For a vehicle far from its file, and real water: a filter that takes a wrong model at its word, or noise that is not
white, leads a likelihood of one-step innovations astray, while what a model is for is to fly a window. Residuals are
those of the gap (docs/reference/gap.md, Measures): what is measured less what is flown, in tolerances, from where the
observer of
the model itself stands.

- Horizons grow: 4 s, 8 s, then nearly a whole window. Over a short one even a wrong model stays near what was flown,
  so that the least squares have one valley; a flight of 20 s that tumbles once says nothing of where to go.
- Each channel counts the same, and large residuals count linearly (pseudo-Huber), so that one window that is lost does
  not decide.
- Errors within a window are one error: as many independent residuals are counted as there are windows and channels.
  The prior, 1 sigma of each parameter, is weighed against the misfit that is there, so that it holds while little is
  explained and yields as more is.
- Asked to (`doubts`), the observer is as sure of the model as its innovations are small: before each horizon the
  disturbance gets the level, in powers of ten of its density, at which they are most probable. With the file's, a
  filter of a vehicle far from its file believes what is wrong, and where a window begins hangs on a parameter's last
  digit. A vehicle that is handed out is fitted with the file's, by which its windows will begin.
- From several starts: the file's values and the best of others (RANDOM draws of the prior, or fits by other means).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glider.tools.inference.channels import Channel, in_tolerances
from glider.tools.inference.fit import bounded_step
from glider.tools.inference.predict import fly_followed, observe
from glider.tools.inference.problem import Gains, Problem
from glider.tools.inference.vehicle_parameters import Parameters

HORIZONS = ((4.0, (0.0,)), (8.0, (0.0, 4.0)), (18.0, (0.0, 10.0)))  # s, and where the first window begins
STEPS = (8, 8, 12)  # at most, at each
LOOK_IN = 2.0  # s of a run before its first window
LINEAR = 4.0  # tolerances from which a residual counts linearly
MAX_COUNTED_TOLERANCES = 200.0  # tolerances: a flight that is lost is lost
LEVELS = tuple(10.0**n for n in range(7))  # of the disturbance's density, times the file's
DIFFERENCE_STEP = 0.02  # of a prior's sigma, for columns
LIMIT = 5.0  # sigma that a parameter goes at most
BOLDEST = 1.0  # sigma a step
CONVERGED_SHARE = 2e-3  # share of the objective, below which a step has converged
RANDOM, TAKEN = 12, 1  # draws of the prior that are tried, and those that are followed beside the file's own values
START_SPREAD = 0.7  # sigma of those draws
SEPARATE_ENDS_SIGMA = 1.0  # posterior sigma a parameter, from which two ends of the first horizon are followed apart
SEED = 20261122


@dataclass
class Windows:
    """Windows to be flown: first and last + 1 row of each, and its run."""

    first: np.ndarray
    last: np.ndarray
    run_of: np.ndarray

    @property
    def rows(self) -> np.ndarray:
        """All rows in them, (rows,)."""
        return np.concatenate([np.arange(a, b) for a, b in zip(self.first, self.last, strict=True)])


@dataclass
class Fitted:
    """Where a fit ended: values (n,) in units of the priors, and what is known of them there."""

    values: np.ndarray
    cost: float  # mean square residual over channels, large ones counted linearly, tolerances squared
    normal: np.ndarray  # (n, n) of the posterior: J'J over the misfit, and the prior's identity
    independent: float  # residuals counted as independent

    @property
    def objective(self) -> float:
        """The misfit with the prior as it is weighed there."""
        return self.cost + float(self.values @ self.values) * max(self.cost, 1.0) / self.independent

    def distance(self, values: np.ndarray) -> float:
        """How far other values are, in posterior sigma: the root mean square over parameters."""
        away = values - self.values
        return float(np.sqrt(away @ self.normal @ away / len(away)))

    @property
    def covariance(self) -> np.ndarray:
        """Laplace's approximation, (n, n)."""
        return np.linalg.inv(self.normal)

    def conditional(self, at: np.ndarray, fixed: np.ndarray) -> np.ndarray:
        """Values (n,) where those at `fixed` (indices) stand at `at`, and the others where they then are most
        probable."""
        values = self.values.copy()
        if not len(fixed):
            return values
        free = np.setdiff1d(np.arange(len(values)), fixed)
        moved = at[fixed] - values[fixed]
        values[fixed] = at[fixed]
        across = self.normal[np.ix_(free, fixed)] @ moved
        values[free] -= np.linalg.solve(self.normal[np.ix_(free, free)], across)
        return values

    def evidence(self, at: np.ndarray, term: np.ndarray, gone: Sequence[int] | np.ndarray = ()) -> float:
        """Log odds (nat) that a term is there, parameters `term` (indices), where those `gone` (indices) are not.

        The ratio of its prior's density to its posterior's at `at` (Savage and Dickey's), by Laplace's approximation;
        at (n,): values of a vehicle without them, in units of the priors.
        """
        fixed = np.asarray(gone, dtype=np.int64)
        kept = np.setdiff1d(np.arange(len(at)), fixed)
        off = (self.conditional(at, fixed) - at)[term]
        own = np.searchsorted(kept, term)
        covariance = np.linalg.inv(self.normal[np.ix_(kept, kept)])[np.ix_(own, own)]
        prior = -0.5 * float(at[term] @ at[term])
        return prior + 0.5 * float(np.linalg.slogdet(covariance)[1] + off @ np.linalg.solve(covariance, off))


class PredictionError:
    """A problem and what is free in it."""

    def __init__(self, problem: Problem, free: Parameters, doubts: bool = False):
        self.problem, self.free, self.doubts = problem, free, doubts
        measures = problem.kind.measures
        self.table = np.concatenate([measures.measured(run) for run in problem.runs])
        self.channels = list({c.name: c for run in problem.runs for c in measures.channels_of(run)}.values())
        self.low = np.maximum([f.low for f in free.free], -LIMIT)
        self.high = np.minimum([f.high for f in free.free], LIMIT)
        self.one_sided = np.array([f.one_sided for f in free.free])
        self.level = 1.0  # of the disturbance that the observer expects, times the file's density
        self.scales: dict[str, float] = {}  # tolerances by channel that a residual is divided by, 1 where none is given

    def model(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(P, F) at values (n,)."""
        P, F, _ = self.free.place(self.problem.model, values)
        return P, F

    def windows(self, horizon: float, offset: float) -> Windows:
        """Windows of `horizon` s, one behind the other; a run that is shorter is one window."""
        bounds, times = self.problem.recording.bounds, self.problem.recording.t
        first, last, run_of = [], [], []
        for n in range(len(self.problem.runs)):
            t = times[bounds[n] : bounds[n + 1]] - times[bounds[n]]
            starts = np.arange(LOOK_IN + offset, t[-1] - horizon, horizon)
            for start in starts if len(starts) else [LOOK_IN]:
                a, b = np.searchsorted(t, [start, start + horizon])
                if b > a > 0:
                    first.append(bounds[n] + a)
                    last.append(bounds[n] + b)
                    run_of.append(n)
        return Windows(*(np.array(values, dtype=np.int64) for values in (first, last, run_of)))

    def gains(self, values: np.ndarray) -> Gains:
        """The observer of the model at `values`; a clock that could wander would take up what a wrong delay leaves."""
        return self.observed(values, self.level)

    def observed(self, values: np.ndarray, level: float) -> Gains:
        """The same with the disturbance at another level."""
        spectral = self.problem.spectral.copy()
        spectral[self.problem.kind.accelerations] *= level
        return observe(replace(self.problem, spectral=spectral), *self.model(values), steady_clock=True)

    def expect(self, values: np.ndarray) -> None:
        """Set the level to that of LEVELS at which the innovations at `values` are most probable, where it doubts."""
        if not self.doubts:
            return
        misfits = [float(self.observed(values, level).misfit.sum()) for level in LEVELS]
        self.level = LEVELS[int(np.argmin(np.nan_to_num(misfits, nan=np.inf)))]

    def fly(self, points: list[np.ndarray], gains: Gains, cuts: list[Windows]) -> np.ndarray:
        """Flights (points, cuts, rows, N_Y) of the windows from where the gains hold each model."""
        Y = np.full((len(points), len(cuts), *self.problem.z.shape), np.nan)
        names = ("first", "last", "run_of")
        first, last, run_of = (np.concatenate([getattr(one, name) for one in cuts]) for name in names)
        cut_of = np.repeat(np.arange(len(cuts)), [len(one.first) for one in cuts])
        models = [self.model(values) for values in points]
        fly_followed(self.problem, models, gains, first, last, run_of, cut_of, Y)
        return Y

    def residuals(self, Y: np.ndarray, windows: Windows) -> np.ndarray:
        """Residuals (models, samples) in tolerances, divided so that their squares add up to a mean over channels."""
        rows, parts = windows.rows, []
        table = self.table[rows]
        for channel, measured in self.measured(table):
            of, place = np.nonzero(measured)
            columns = np.array(channel.columns)[place]
            flown = in_tolerances(channel, table[of, columns] - Y[:, rows[of], columns])
            np.nan_to_num(flown, copy=False, nan=MAX_COUNTED_TOLERANCES)
            np.clip(flown, -MAX_COUNTED_TOLERANCES, MAX_COUNTED_TOLERANCES, out=flown)
            count = measured.sum() / (len(channel.columns) if channel.joint else 1)
            parts.append(flown / (np.sqrt(count) * self.scales.get(channel.name, 1.0)))
        return np.concatenate(parts, axis=1) / np.sqrt(len(parts))

    def measured(self, table: np.ndarray) -> Iterator[tuple[Channel, np.ndarray]]:
        """Channels that rows of a table (rows, N_Y) have, and which of their columns were measured, (rows, columns)."""
        for channel in self.channels:
            found = np.isfinite(table[:, list(channel.columns)])
            if channel.joint:
                found[:] = found.all(axis=1, keepdims=True)
            if found.any():
                yield channel, found

    def origins(self, windows: Windows) -> tuple[np.ndarray, np.ndarray]:
        """Of each residual its run and its channel's number, (samples,) both."""
        rows = windows.rows
        runs, of_row, channels = [], self.problem.run_of[rows], []
        for channel, found in self.measured(self.table[rows]):
            own = np.broadcast_to(of_row[:, None], found.shape)[found]
            runs.append(own)
            channels.append(np.full(len(own), self.channels.index(channel)))
        return np.concatenate(runs), np.concatenate(channels)

    def weights(self, e: np.ndarray) -> tuple[np.ndarray, float]:
        """Of residuals (samples,): each one's weight in the normal equations, and the mean square, large ones tamed."""
        squares = e * e * len(e) / LINEAR**2
        root = np.sqrt(1.0 + squares)
        return 1.0 / root, float(2.0 * LINEAR**2 * (root - 1.0).mean())

    def cost(self, values: np.ndarray, cuts: list[Windows]) -> tuple[float, Gains]:
        """The mean square at values, over cuts into windows, and the observer's gains there."""
        gains = self.gains(values)
        Y = self.fly([values], gains, cuts)
        parts = [self.weights(self.residuals(Y[:, n], one)[0])[1] for n, one in enumerate(cuts)]
        return float(np.mean(parts)), gains

    def linear(self, values: np.ndarray, gains: Gains, cuts: list[Windows]) -> tuple[np.ndarray, np.ndarray]:
        """Normal matrix (n, n) and slope (n,) of the mean square at values, the gains kept."""
        normal, slope = np.zeros((len(values), len(values))), np.zeros(len(values))
        for e, J in self.columns(values, gains, cuts):
            weighted = J * (self.weights(e)[0] / len(cuts))
            normal += weighted @ J.T
            slope += weighted @ e
        return normal, slope

    def columns(self, values: np.ndarray, gains: Gains, cuts: list[Windows]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Of every cut the residuals (samples,) and their columns (n, samples) at values; from a kink by a sigma."""
        size = np.where(self.one_sided & (values == 0.0), 1.0, DIFFERENCE_STEP)
        size = np.where(values + size <= self.high, size, -size)
        points = [values, *(values + s * row for s, row in zip(size, np.eye(len(values)), strict=True))]
        Y = self.fly(points, gains, cuts)
        for n, one in enumerate(cuts):
            E = self.residuals(Y[:, n], one)
            yield E[0], (E[1:] - E[0]) / size[:, None]

    def independent(self, cuts: list[Windows]) -> float:
        """Residuals of windows that count as independent: one for each window and channel."""
        return float(len(cuts[0].first) * len(self.channels))

    def led(self, values: np.ndarray, cuts: list[Windows], steps: int) -> tuple[np.ndarray, float, Gains]:
        """Levenberg and Marquardt's steps on windows, limits kept: the values, their cost, and the observer's gains."""
        independent = self.independent(cuts)
        cost, gains = self.cost(values, cuts)
        damping, n = 1e-2, len(values)
        held = max(cost, 1.0) / independent  # weight of the prior
        for _ in range(steps):
            normal, slope = self.linear(values, gains, cuts)
            normal, slope = normal + held * np.eye(n), slope + held * values
            objective, moved = cost + held * float(values @ values), False
            for _ in range(5):
                damped = normal + damping * np.diag(np.diag(normal))
                low, high = np.maximum(self.low - values, -BOLDEST), np.minimum(self.high - values, BOLDEST)
                tried = values + bounded_step(damped, slope, low, high)
                found, at = self.cost(tried, cuts)
                fall = objective - found - held * float(tried @ tried)
                if fall > 0.0:
                    moved = True
                    break
                damping *= 5.0
            if not moved:
                break
            values, cost, gains, damping = tried, found, at, max(damping / 4.0, 1e-5)
            held = max(cost, 1.0) / independent
            if fall < CONVERGED_SHARE * objective:
                break
        return values, cost, gains

    def descend(self, values: np.ndarray, horizon: float, offsets: tuple[float, ...], steps: int) -> Fitted:
        """The same at one horizon, and what is known of the values there."""
        self.expect(values)
        cuts = [self.windows(horizon, offset) for offset in offsets]
        values, cost, gains = self.led(values, cuts, steps)
        independent = self.independent(cuts)
        normal, _ = self.linear(values, gains, cuts)
        return Fitted(values, cost, normal * independent / max(cost, 1.0) + np.eye(len(values)), independent)

    def draws(self) -> list[np.ndarray]:
        """Some draws of the prior."""
        rng, n = np.random.default_rng(SEED), len(self.low)
        return [np.clip(rng.normal(size=n) * START_SPREAD, self.low, self.high) for _ in range(RANDOM)]

    @property
    def file_values(self) -> np.ndarray:
        """Where the file stands, (n,)."""
        return self.clipped(np.zeros(len(self.low)))

    def clipped(self, values: np.ndarray) -> np.ndarray:
        """Values (n,) within the limits."""
        return np.clip(np.nan_to_num(values), self.low, self.high)

    def best_of(self, starts: list[np.ndarray], say: Callable[[str], None] = lambda text: None) -> Fitted:
        """The best end that is reached through all horizons from the file's values or others.

        Of the others, the one that costs least at once is taken. What reaches the same place at the first horizon is
        followed once.
        """
        first, *later = zip(HORIZONS, STEPS, strict=True)
        cuts = [self.windows(first[0][0], offset) for offset in first[0][1]]
        others = sorted(starts, key=lambda values: self.cost(values, cuts)[0])
        begun: list[Fitted] = []
        for n, values in enumerate([self.file_values, *others[:TAKEN]]):
            say(f"prediction error, start {n + 1}")
            begun.append(self.descend(values, *first[0], first[1]))
        begun.sort(key=lambda one: one.objective)
        best = begun[0]
        apart = [best, *(one for one in begun[1:] if best.distance(one.values) > SEPARATE_ENDS_SIGMA)]
        found = []
        for one in apart:
            values = one.values
            for (horizon, offsets), steps in later:
                ended = self.descend(values, horizon, offsets, steps)
                values = ended.values
            found.append(ended)
        return min(found, key=lambda one: one.objective)

    def through(self, values: np.ndarray) -> Fitted:
        """From values through all horizons."""
        for (horizon, offsets), steps in zip(HORIZONS, STEPS, strict=True):
            found = self.descend(values, horizon, offsets, steps)
            values = found.values
        return found

    def again(self, values: np.ndarray, steps: int = STEPS[-1]) -> Fitted:
        """From values that fit already, at the last horizon alone."""
        return self.descend(values, *HORIZONS[-1], steps)
