"""Fits of models to a recording: the most probable parameters, and how probable the model then is.

The misfit is |e|^2 + |v|^2: whitened innovations of a model followed along the data with kept gains, and its
parameters in units of their priors. What is allowed for (parameters within [uncertainty], biases) is always free; its
columns are taken once a fit and projected out, which leaves a handful of parameters to each candidate. Laplace's
approximation around the least misfit gives the evidence.
"""

import numpy as np
from scipy.optimize import lsq_linear

from tools.inference.candidates import Free, place
from tools.inference.problem import Gains, Problem

NUDGE = 0.3  # of a prior sigma, for what is allowed for
MOST = 3.5  # prior sigma that what is allowed for may be off
STEP = 0.05  # of a spread, for effects
WARM = 1.1  # squared innovations a sample, above which a fit is tempered
COARSE = 0.3  # of a spread, before the first step
WIDE = 2.0  # spreads, for what begins only beyond some size: a limit that the commands never reached
SHORTER = (0.4, 0.1)  # of a step, tried where the whole of it brings less than
POOR = 0.3  # of what it should
STUCK = 0.2  # misfit that a tenth of a step's promise must be worth, for parameters to be tried apart where it fails
FREED = 2  # candidates at most, the best of those that are stuck
ASIDE = (0.001, 0.004, 0.015, 0.06)  # of a spread, either way: a delay's misfit has steps, no slope leads on


class Fitter:
    """Fits at one set of gains."""

    def __init__(self, problem: Problem, gains: Gains, allowed: list[Free], at: "Course | None" = None, temper=False):
        """Columns of what is allowed are taken at the candidate `at`, or at the nominal model.

        With `temper`, misfits are divided by the excess of that candidate's, and what is allowed is held as much more
        tightly: far from the truth the data's weight would drive it anywhere, and no step could be foreseen.
        """
        self.problem, self.gains, self.allowed, self.cool, self.tight = problem, gains, allowed, 1.0, 1.0
        free, values = ([], np.zeros(0)) if at is None else (at.free, at.values)
        base = np.zeros(len(allowed)) if at is None else at.allowed
        E = self.flown([(free, values, base + NUDGE * row) for row in (np.zeros(len(base)), *np.eye(len(base)))])
        if temper:
            heat = float(E[0] @ E[0]) / E.shape[1]
            self.cool = 1.0 / np.sqrt(heat) if heat > WARM else 1.0
            self.tight = self.cool**-2
            E *= self.cool
        self.base, self.e0 = base, E[0]
        self.J = (E[1:] - E[0]) / NUDGE  # (allowed, samples)
        self.A = self.J @ self.J.T + self.tight * np.eye(len(base))
        self.chol = np.linalg.cholesky(self.A)
        self.occam = 2.0 * float(np.log(np.diag(self.chol)).sum()) - len(base) * float(np.log(self.tight))

    def solve(self, B: np.ndarray) -> np.ndarray:
        """A^-1 B."""
        return np.linalg.solve(self.chol.T, np.linalg.solve(self.chol, B))

    def course(self, labels: tuple[str, ...], free: list[Free], values=None, allowed=None) -> "Course":
        """A candidate before its first step."""
        values = np.zeros(len(free)) if values is None else values
        return Course(labels, free, values.copy(), (self.base if allowed is None else allowed).copy())

    def measure(self, courses: list["Course"]) -> None:
        """Innovations of candidates that have none yet."""
        new = [course for course in courses if not len(course.e)]
        for course, e in zip(new, self.flown([(c.free, c.values, c.allowed) for c in new]), strict=True):
            course.settle(e, self.tight)

    def linearise(self, courses: list["Course"], coarse: bool = False) -> None:
        """The columns of every candidate's parameters where it stands, and the step they foresee."""
        self.measure(courses)
        points, nudges = [], []
        for course in courses:
            sizes = course.nudges(coarse)
            nudges.append(sizes)
            for k in range(len(course.known), len(sizes)):
                size = sizes[k]
                moved = course.values.copy()
                moved[k] += size
                points.append((course.free, moved, course.allowed))
        E = iter(self.flown(points))
        tables = []
        for course, sizes in zip(courses, nudges, strict=True):
            known = len(course.known)
            table = np.empty((len(sizes) + 1, len(self.e0)))  # columns, and the innovations where it stands
            table[:known] = course.known if known else 0.0
            for k in range(known, len(sizes)):
                table[k] = (next(E) - course.e) / sizes[k]
            table[-1] = course.e
            course.known = np.empty((0, 0))
            tables.append(table)
        projected = self.J @ np.concatenate(tables).T  # all at once: the data are many, and are read once
        places = np.cumsum([0, *(len(table) for table in tables)])
        for course, table, first, last in zip(courses, tables, places, places[1:], strict=False):
            course.foresee(self, table, projected[:, first:last])

    def move(self, courses: list["Course"]) -> None:
        """The foreseen step of every candidate, or where that is too far the share of it that does best."""
        for course, e in zip(courses, self.flown([(c.free, *c.step(1.0)) for c in courses]), strict=True):
            course.consider(e, *course.step(1.0), self.tight)
        short = [c for c in courses if c.misfit - c.best[0] < POOR * c.foreseen_fall()]
        E = iter(self.flown([(c.free, *c.step(share)) for c in short for share in SHORTER]))
        for course in short:
            for share in SHORTER:
                course.consider(next(E), *course.step(share), self.tight)
        stuck = [c for c in short if c.misfit - c.best[0] < SHORTER[-1] * c.foreseen_fall() > STUCK]
        stuck = sorted(stuck, key=lambda c: c.misfit)[:FREED]
        points = [(course, *point) for course in stuck for point in course.apart()]
        for (course, values, known), e in zip(points, self.flown([(c.free, v, a) for c, v, a in points]), strict=True):
            course.consider(e, values, known, self.tight)
        for course in courses:
            course.accept()

    def advance(self, courses: list["Course"], coarse: bool = False) -> None:
        """One Gauss-Newton step of every candidate, all their flights together."""
        self.linearise(courses, coarse)
        self.move(courses)

    def flown(self, points: list[tuple[list[Free], np.ndarray, np.ndarray]]) -> np.ndarray:
        """Innovations of models given as (free, values, allowed), (points, samples)."""
        models = [place(self.problem, [*self.allowed, *free], np.concatenate([a, v])) for free, v, a in points]
        return self.cool * self.problem.follow(models, self.gains) if models else np.empty((0, len(self.e0)))


def within(normal: np.ndarray, slope: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The step d that minimises slope d + d normal d / 2 with low <= d <= high (low <= 0 <= high, normal definite)."""
    step = -np.linalg.solve(normal, slope) if len(slope) else np.zeros(0)
    if (step >= low).all() and (step <= high).all():
        return step
    root = np.linalg.cholesky(normal)
    aim = -np.linalg.solve(root, slope)
    found = lsq_linear(root.T, aim, (low - 1e-12, high + 1e-12), method="bvls")
    return np.clip(found.x, low, high)


class Course:
    """A candidate on its way to its least misfit."""

    def __init__(self, labels, free: list[Free], values: np.ndarray, allowed: np.ndarray):
        self.labels, self.free, self.values, self.allowed = labels, free, values, allowed
        self.low = np.array([f.low for f in free])
        self.high = np.array([f.high for f in free])
        self.e: np.ndarray = np.empty(0)
        self.misfit, self.gained = np.inf, np.inf
        self.known = np.empty((0, 0))  # columns of the first parameters, where they are known already
        self.whole = 1.0  # spreads that an effect which begins at a kink is nudged by there

    def settle(self, e: np.ndarray, tight: float) -> None:
        self.e = e
        self.misfit = float(e @ e + self.values @ self.values + tight * self.allowed @ self.allowed)
        self.best = (self.misfit, e, self.values, self.allowed)

    def nudges(self, coarse: bool) -> np.ndarray:
        """Step of each derivative, away from the nearer limit; a whole spread where an effect begins at a kink."""
        whole = [min(self.whole, max(f.high, -f.low)) if f.kinked else COARSE for f in self.free]
        sizes = np.array([
            size if coarse or (f.kinked and v == 0.0) else STEP * max(1.0, abs(v))
            for f, v, size in zip(self.free, self.values, whole, strict=True)
        ])  # fmt: skip
        return np.where(self.values + sizes > self.high, -sizes, sizes)

    def foresee(self, fitter: Fitter, table: np.ndarray, projected: np.ndarray) -> None:
        """Normal equations of what is allowed and the effects' parameters together, and the step they ask for.

        table (parameters + 1, samples): the columns, and the innovations; projected: the same on what is allowed.
        """
        count, columns = len(fitter.base), table[:-1]
        C = projected[:, :-1]
        own = columns @ table.T
        D = own[:, :-1] + np.eye(len(columns))
        self.columns = columns
        self.precision = D - C.T @ fitter.solve(C)  # with what is allowed projected out
        self.normal = np.block([[fitter.A, C], [C.T, D]])
        self.slope = np.concatenate([projected[:, -1] + fitter.tight * self.allowed, own[:, -1] + self.values])
        at = np.concatenate([self.allowed, self.values])
        low = np.concatenate([np.minimum(-MOST, self.allowed), self.low])
        high = np.concatenate([np.maximum(MOST, self.allowed), self.high])
        self.room = low - at, high - at
        self.foreseen = within(self.normal, self.slope, *self.room)
        alone = within(fitter.A, self.slope[:count], (low - at)[:count], (high - at)[:count])
        self.alone = float(self.slope[:count] @ alone + 0.5 * alone @ fitter.A @ alone)

    def step(self, share: float) -> tuple[np.ndarray, np.ndarray]:
        """Where a share of the step leads: values, allowed."""
        count = len(self.allowed)
        moved = np.clip(self.values + share * self.foreseen[count:], self.low, self.high)
        return moved, self.allowed + share * self.foreseen[:count]

    def apart(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Points (values, allowed) where the whole step brings nothing: without each parameter, and each one alone."""
        count, points = len(self.allowed), []
        for k in range(count, len(self.slope)):
            rest = np.delete(np.arange(len(self.slope)), k)
            step = np.zeros(len(self.slope))
            low, high = self.room
            step[rest] = within(self.normal[np.ix_(rest, rest)], self.slope[rest], low[rest], high[rest])
            points.append((self.values + step[count:], self.allowed + step[:count]))
            for aside in (sign * size for size in ASIDE for sign in (-1.0, 1.0)):
                values = self.values.copy()
                values[k - count] += aside
                points.append((np.clip(values, self.low, self.high), self.allowed))
        return points

    def foreseen_fall(self) -> float:
        """By how much the misfit should fall, were everything linear."""
        d = self.foreseen
        return -2.0 * float(self.slope @ d + 0.5 * d @ self.normal @ d)

    def foreseen_gain(self) -> float:
        """By how much the misfit should fall beyond what the allowed alone takes, were everything linear."""
        return 2.0 * self.alone + self.foreseen_fall()

    def consider(self, e: np.ndarray, values: np.ndarray, allowed: np.ndarray, tight: float) -> None:
        misfit = float(e @ e + values @ values + tight * allowed @ allowed)
        if misfit < self.best[0]:
            self.best = (misfit, e, values, allowed)

    def accept(self) -> None:
        self.gained = self.misfit - self.best[0]
        self.misfit, self.e, self.values, self.allowed = self.best

    def log_evidence(self, fitter: Fitter) -> float:
        """By Laplace's approximation, up to a constant of the data and the gains."""
        doubled = 2.0 * np.log(2.0) * sum(f.kinked for f in self.free)  # half of a prior lies on one side
        logdet = float(np.linalg.slogdet(self.precision)[1]) if len(self.free) else 0.0
        value = -0.5 * (self.misfit + fitter.occam + logdet - doubled)
        return float(value) if np.isfinite(value) else -np.inf

    def promise(self) -> float:
        """Log evidence that one step is foreseen to gain, less what the new parameters cost."""
        logdet = float(np.linalg.slogdet(self.precision)[1]) if len(self.free) else 0.0
        return 0.5 * (self.foreseen_gain() - logdet)
