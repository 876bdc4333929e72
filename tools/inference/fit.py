"""Fits of models to a recording: the most probable parameters, and how probable the model then is.

The misfit is |e|^2 + |v|^2: whitened innovations of a model followed along the data with kept gains, and its
parameters in units of their priors. Nuisance parameters (within [uncertainty], sensor biases) are free in
every hypothesis; their columns are taken once a fit and projected out, which leaves a handful of parameters to each.
Laplace's approximation around the least misfit gives the evidence.
"""

import numpy as np

from glider.tools.inference.parameters import FreeParameter, model_at
from glider.tools.inference.problem import Gains, Problem

NUISANCE_STEP = 0.3  # of a prior sigma: difference step of nuisance parameters
NUISANCE_LIMIT = 3.5  # prior sigma: bound of nuisance parameters
EFFECT_STEP = 0.05  # of a spread: difference step of effects
TEMPER_ABOVE = 1.1  # mean NIS of a sample, above which a fit is tempered
FIRST_STEP = 0.3  # of a spread, before the first step
TAME = 10.0  # times the misfit: a first step that moves the innovations by more is taken again, a tenth as far
THRESHOLD_STEP = 2.0  # spreads, for what begins only beyond some size: a limit that the commands never reached
SHORTER_STEPS = (0.4, 0.1)  # of a step, tried where the whole of it brings less than
POOR = 0.3  # of what it should
STUCK = 0.2  # misfit that a tenth of a step's promise must be worth, for parameters to be tried apart where it fails
STUCK_TRIED = 2  # hypotheses at most, the best of those that are stuck
HELD = 1e-12  # of the largest slope, below which a parameter at its limit has nothing to gain
SIDE_STEPS = (0.001, 0.004, 0.015, 0.06)  # of a spread, either way: a delay's misfit has steps, no slope leads on

Point = tuple[list[FreeParameter], np.ndarray, np.ndarray]  # what is free, its values, the nuisance parameters'


class Fitter:
    """Fits at one set of gains."""

    def __init__(
        self,
        problem: Problem,
        gains: Gains,
        nuisance: list[FreeParameter],
        at: "Hypothesis | None" = None,
        temper: bool = False,
    ):
        """Columns of the nuisance parameters are taken at the hypothesis `at`, or at the nominal model.

        With `temper`, squared innovations are divided by a temperature, the mean NIS of that hypothesis, and the prior
        of the nuisance parameters weighs as much more: far from the truth the data's weight would drive them anywhere,
        and no step could be foreseen.
        """
        self.problem, self.gains, self.nuisance, self.temperature = problem, gains, nuisance, 1.0
        free, values = ([], np.zeros(0)) if at is None else (at.free, at.values)
        base = np.zeros(len(nuisance)) if at is None else at.nuisance
        steps = NUISANCE_STEP * np.vstack([np.zeros(len(base)), np.eye(len(base))])
        E = self.flown([(free, values, base + step) for step in steps])
        mean_nis = float(E[0] @ E[0]) / E.shape[1]
        if temper and mean_nis > TEMPER_ABOVE:
            self.temperature = mean_nis
            E /= np.sqrt(mean_nis)
        self.base, self.e0 = base, E[0]
        self.J = (E[1:] - E[0]) / NUISANCE_STEP  # (nuisance, samples)
        self.A = self.J @ self.J.T + self.prior_weight * np.eye(len(base))
        self.chol = np.linalg.cholesky(self.A)
        self.occam = 2.0 * float(np.log(np.diag(self.chol)).sum()) - len(base) * float(np.log(self.prior_weight))

    @property
    def prior_weight(self) -> float:
        """By which the prior of the nuisance parameters weighs more than the data."""
        return self.temperature

    def solve(self, B: np.ndarray) -> np.ndarray:
        """A^-1 B."""
        return np.linalg.solve(self.chol.T, np.linalg.solve(self.chol, B))

    def hypothesis(
        self, labels: tuple[str, ...], free: list[FreeParameter], values=None, nuisance=None
    ) -> "Hypothesis":
        """A hypothesis before its first step."""
        values = np.zeros(len(free)) if values is None else values
        return Hypothesis(labels, free, values.copy(), (self.base if nuisance is None else nuisance).copy())

    def measure(self, hypotheses: list["Hypothesis"]) -> None:
        """Innovations of hypotheses that have none yet."""
        new = [hypothesis for hypothesis in hypotheses if not len(hypothesis.e)]
        for hypothesis, e in zip(new, self.flown([(c.free, c.values, c.nuisance) for c in new]), strict=True):
            hypothesis.set_innovations(e, self.prior_weight)

    def linearise(self, hypotheses: list["Hypothesis"], coarse: bool = False) -> None:
        """The columns of every hypothesis's parameters where it stands, and the step they predict."""
        self.measure(hypotheses)
        points, steps = [], []
        for hypothesis in hypotheses:
            sizes = hypothesis.difference_steps(coarse)
            steps.append(sizes)
            for k in range(len(hypothesis.known), len(sizes)):
                size = sizes[k]
                moved = hypothesis.values.copy()
                moved[k] += size
                points.append((hypothesis.free, moved, hypothesis.nuisance))
        E = iter(self.flown(points))
        tables = []
        for hypothesis, sizes in zip(hypotheses, steps, strict=True):
            known = len(hypothesis.known)
            table = np.empty((len(sizes) + 1, len(self.e0)))  # columns, and the innovations where it stands
            table[:known] = hypothesis.known if known else 0.0
            for k in range(known, len(sizes)):
                table[k] = (next(E) - hypothesis.e) / sizes[k]
            table[-1] = hypothesis.e
            hypothesis.known = np.empty((0, 0))
            tables.append(table)
        projected = self.J @ np.concatenate(tables).T  # all at once: the data are many, and are read once
        places = np.cumsum([0, *(len(table) for table in tables)])
        for hypothesis, table, first, last in zip(hypotheses, tables, places, places[1:], strict=False):
            hypothesis.solve_step(self, table, projected[:, first:last])

    def move(self, hypotheses: list["Hypothesis"]) -> None:
        """The step of every hypothesis, or where that is too far the share of it that does best."""
        for hypothesis, e in zip(hypotheses, self.flown([(c.free, *c.step(1.0)) for c in hypotheses]), strict=True):
            hypothesis.offer(e, *hypothesis.step(1.0), self.prior_weight)
        short = [c for c in hypotheses if c.misfit - c.best[0] < POOR * c.expected_fall()]
        E = iter(self.flown([(c.free, *c.step(share)) for c in short for share in SHORTER_STEPS]))
        for hypothesis in short:
            for share in SHORTER_STEPS:
                hypothesis.offer(next(E), *hypothesis.step(share), self.prior_weight)
        least = min((c.best[0] for c in hypotheses), default=np.inf)
        stuck = [c for c in short if c.misfit - c.best[0] < SHORTER_STEPS[-1] * c.expected_fall() > STUCK]
        stuck = sorted(stuck, key=lambda c: c.misfit)[:STUCK_TRIED]
        points = [(c, *point) for c in stuck for point in c.side_steps(c.misfit - c.expected_fall() <= least)]
        aside = self.flown([(c.free, v, a) for c, v, a in points])
        for (hypothesis, values, nuisance), e in zip(points, aside, strict=True):
            hypothesis.offer(e, values, nuisance, self.prior_weight)
        for hypothesis in hypotheses:
            hypothesis.accept()

    def advance(self, hypotheses: list["Hypothesis"], coarse: bool = False) -> None:
        """One Gauss-Newton step of every hypothesis, all their flights together."""
        self.linearise(hypotheses, coarse)
        self.move(hypotheses)

    def flown(self, points: list[Point]) -> np.ndarray:
        """Innovations of models given as (free, values, nuisance), (points, samples)."""
        models = [model_at(self.problem, [*self.nuisance, *free], np.concatenate([a, v])) for free, v, a in points]
        E = self.problem.follow(models, self.gains)
        if self.temperature != 1.0:
            E /= np.sqrt(self.temperature)
        return E


def bounded_step(normal: np.ndarray, slope: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The step d that minimises slope d + d normal d / 2 with low <= d <= high (low <= 0 <= high, normal definite).

    By an active set (Stark and Parker 1995): whatever leaves its limits is held there; then what would fall is freed,
    one at a time.
    """
    step = -np.linalg.solve(normal, slope) if len(slope) else np.zeros(0)
    if (step >= low).all() and (step <= high).all():
        return step
    held = np.zeros(len(step))  # -1, 1: at its lower, at its upper limit
    while (outside := np.where(held == 0.0, 1.0 * (step > high) - (step < low), 0.0)).any():
        held += outside
        step = _held_step(normal, slope, low, high, held)
    for _ in range(len(step)):
        inward = (slope + normal @ step) * held  # what would fall if a parameter left its limit
        if inward.max() <= HELD * np.abs(slope).max():
            break
        held[inward.argmax()] = 0.0
        step = _freed_step(step, normal, slope, low, high, held)
    return np.clip(step, low, high)


def _freed_step(
    step: np.ndarray, normal: np.ndarray, slope: np.ndarray, low: np.ndarray, high: np.ndarray, held: np.ndarray
) -> np.ndarray:
    """The least of what is free, reached from `step` with a stop at each limit on the way, which `held` then holds."""
    while True:
        aim = _held_step(normal, slope, low, high, held)
        limit = np.where(aim > step, high, low)
        beyond = (held == 0.0) & ((aim < low) | (aim > high))
        if not beyond.any():
            return aim
        share = np.full(len(step), np.inf)
        share[beyond] = (limit - step)[beyond] / (aim - step)[beyond]
        first = share.argmin()
        step = step + share[first] * np.where(held == 0.0, aim - step, 0.0)
        held[first] = np.sign(aim[first] - step[first])
        step[first] = limit[first]


def _held_step(
    normal: np.ndarray, slope: np.ndarray, low: np.ndarray, high: np.ndarray, held: np.ndarray
) -> np.ndarray:
    """The least with some parameters held at their limits, the others wherever it leads."""
    step, free = np.where(held < 0.0, low, high), held == 0.0
    rest = slope[free] + normal[np.ix_(free, ~free)] @ step[~free]
    step[free] = -np.linalg.solve(normal[np.ix_(free, free)], rest)
    return step


class Hypothesis:
    """A set of effects with its parameters, on its way to its least misfit: the MAP estimate."""

    def __init__(self, labels, free: list[FreeParameter], values: np.ndarray, nuisance: np.ndarray):
        self.labels, self.free, self.values, self.nuisance = labels, free, values, nuisance
        self.low = np.array([f.low for f in free])
        self.high = np.array([f.high for f in free])
        self.e: np.ndarray = np.empty(0)
        self.misfit, self.gained = np.inf, np.inf
        self.known = np.empty((0, 0))  # columns of the first parameters, where they are known already
        self.bound_step = 1.0  # spreads: difference step of an effect that begins at a kink, there
        self.shorter = 1.0  # share of a coarse difference step that is taken

    def set_innovations(self, e: np.ndarray, prior_weight: float) -> None:
        self.e = e
        self.misfit = float(e @ e + self.values @ self.values + prior_weight * self.nuisance @ self.nuisance)
        self.best = (self.misfit, e, self.values, self.nuisance)

    def difference_steps(self, coarse: bool) -> np.ndarray:
        """Step of each derivative, away from the nearer limit; a whole spread where an effect begins at a kink."""
        whole = [min(self.bound_step, max(f.high, -f.low)) if f.one_sided else FIRST_STEP for f in self.free]
        sizes = np.array([
            self.shorter * size if coarse or (f.one_sided and v == 0.0) else EFFECT_STEP * max(1.0, abs(v))
            for f, v, size in zip(self.free, self.values, whole, strict=True)
        ])  # fmt: skip
        return np.where(self.values + sizes > self.high, -sizes, sizes)

    @property
    def late(self) -> bool:
        """Whether its last effect may begin only beyond some size."""
        return any(free.one_sided for free in self.free if free.label == self.labels[-1])

    def runs_away(self, first: int) -> bool:
        """Whether a coarse step along a parameter, the first of them numbered `first`, led where nothing is linear.

        A vehicle that rolls over on one side of the truth hides that the other side would explain all.
        """
        steps = self.difference_steps(True)[first:]
        moved = steps**2 * (self.columns[first:] ** 2).sum(axis=1)
        return bool((moved > TAME * self.e @ self.e).any())

    def solve_step(self, fitter: Fitter, table: np.ndarray, projected: np.ndarray) -> None:
        """Normal equations of nuisance and effects' parameters together, and the step they ask for.

        table (parameters + 1, samples): the columns, and the innovations; projected: the same on the nuisance.
        """
        count, columns = len(fitter.base), table[:-1]
        C = projected[:, :-1]
        own = columns @ table.T
        D = own[:, :-1] + np.eye(len(columns))
        self.columns = columns
        self.precision = D - C.T @ fitter.solve(C)  # with the nuisance projected out
        self.normal = np.block([[fitter.A, C], [C.T, D]])
        self.slope = np.concatenate([projected[:, -1] + fitter.prior_weight * self.nuisance, own[:, -1] + self.values])
        at = np.concatenate([self.nuisance, self.values])
        low = np.concatenate([np.minimum(-NUISANCE_LIMIT, self.nuisance), self.low])
        high = np.concatenate([np.maximum(NUISANCE_LIMIT, self.nuisance), self.high])
        self.room = low - at, high - at
        self.full_step = bounded_step(self.normal, self.slope, *self.room)
        alone = bounded_step(fitter.A, self.slope[:count], (low - at)[:count], (high - at)[:count])
        self.nuisance_fall = -2.0 * float(self.slope[:count] @ alone + 0.5 * alone @ fitter.A @ alone)

    def step(self, share: float) -> tuple[np.ndarray, np.ndarray]:
        """Where a share of the step leads: values, nuisance."""
        count = len(self.nuisance)
        moved = np.clip(self.values + share * self.full_step[count:], self.low, self.high)
        return moved, self.nuisance + share * self.full_step[:count]

    def side_steps(self, hopeful: bool) -> list[tuple[np.ndarray, np.ndarray]]:
        """Points (values, nuisance) where the whole step brings nothing: without each parameter, and each delay alone.

        hopeful: what the step predicts would make it the best, or no delay is tried alone.
        """
        count, points = len(self.nuisance), []
        for k in range(count, len(self.slope)):
            rest = np.delete(np.arange(len(self.slope)), k)
            step = np.zeros(len(self.slope))
            low, high = self.room
            step[rest] = bounded_step(self.normal[np.ix_(rest, rest)], self.slope[rest], low[rest], high[rest])
            points.append((self.values + step[count:], self.nuisance + step[:count]))
            if not (hopeful and self.free[k - count].delays):
                continue
            for aside in (sign * size for size in SIDE_STEPS for sign in (-1.0, 1.0)):
                values = self.values.copy()
                values[k - count] += aside
                points.append((np.clip(values, self.low, self.high), self.nuisance))
        return points

    def expected_fall(self) -> float:
        """By how much the misfit should fall, were everything linear."""
        d = self.full_step
        return -2.0 * float(self.slope @ d + 0.5 * d @ self.normal @ d)

    def expected_gain(self) -> float:
        """By how much the misfit should fall beyond what the nuisance alone brings, were everything linear."""
        return self.expected_fall() - self.nuisance_fall

    def offer(self, e: np.ndarray, values: np.ndarray, nuisance: np.ndarray, prior_weight: float) -> None:
        misfit = float(e @ e + values @ values + prior_weight * nuisance @ nuisance)
        if misfit < self.best[0]:
            self.best = (misfit, e, values, nuisance)

    def accept(self) -> None:
        self.gained = self.misfit - self.best[0]
        self.misfit, self.e, self.values, self.nuisance = self.best

    def log_evidence(self, fitter: Fitter) -> float:
        """By Laplace's approximation, up to a constant of the data and the gains."""
        doubled = 2.0 * np.log(2.0) * sum(f.one_sided for f in self.free)  # half of a prior lies on one side
        logdet = float(np.linalg.slogdet(self.precision)[1]) if len(self.free) else 0.0
        value = -0.5 * (self.misfit + fitter.occam + logdet - doubled)
        return float(value) if np.isfinite(value) else -np.inf

    def expected_evidence(self) -> float:
        """Log evidence that one step is foreseen to gain, less what the new parameters cost."""
        logdet = float(np.linalg.slogdet(self.precision)[1]) if len(self.free) else 0.0
        return 0.5 * (self.expected_gain() - logdet)
