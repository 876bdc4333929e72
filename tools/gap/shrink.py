"""How far the gap shrinks: windows of runs that were left out of the fit, flown by four models (GAP.md, Measures)."""

from dataclasses import dataclass

import numpy as np

from sim_backend.core import effect_layout as ef
from tools.gap.candidates import place
from tools.gap.channels import CHANNELS
from tools.gap.fit import Course, within
from tools.gap.measure import RunGap, root_mean_square, run_gap
from tools.gap.model import Model
from tools.gap.predict import predict as predict_nominal
from tools.gap.problem import Problem, cut, estimated, fly_on
from tools.gap.search import Search

DRAWS = 2  # simulated repetitions that find the floor
SEED = 20261121
BOOTSTRAP = 2000
BEFORE, RECALIBRATED, AFTER, FLOOR = "before", "recalibrated", "after", "floor"


@dataclass
class Shrinkage:
    """Gaps by run of the four models, and what follows from them."""

    runs: dict[str, list[RunGap]]
    before: float
    recalibrated: float
    after: float
    floor: float
    shrinkage: float
    ci90: tuple[float, float]
    closed: float
    closed_ci90: tuple[float, float]
    predictions: dict[str, list[np.ndarray]]  # by model and run, (rows, N_Y); not of the floor

    def channels(self, which: str) -> dict[str, float]:
        """Each channel's rms over the runs, and the total."""
        found = {}
        for channel in CHANNELS:
            values = [gap.channels[channel.name] for gap in self.runs[which] if channel.name in gap.channels]
            if values:
                found[channel.name] = root_mean_square(values)
        return found | {"total": root_mean_square([gap.total for gap in self.runs[which]])}


def left_out(search: Search, course: Course) -> list[tuple[np.ndarray, np.ndarray]]:
    """A candidate's models, each fitted without one run: the step that the other runs ask for, to first order."""
    fitter, problem = search.fitter, search.problem
    fitter.linearise([course])
    columns = np.vstack([fitter.J, course.columns]) if len(course.free) else fitter.J
    normal = course.normal
    run = np.broadcast_to(problem.run_of[:, None], problem.valid.shape)[problem.valid]
    count = len(course.allowed)
    at = np.concatenate([course.allowed, course.values])
    low = np.concatenate([np.minimum(-3.5, course.allowed), course.low]) - at
    high = np.concatenate([np.maximum(3.5, course.allowed), course.high]) - at
    models = []
    for n in range(len(problem.runs)):
        own = columns[:, run == n]
        slope = course.slope - own @ course.e[run == n]
        step = within(normal - own @ own.T, slope, low, high)
        models.append(place(problem, [*search.allowed, *course.free], at + step))
    assert len(at) == count + len(course.values)
    return models


def gaps(
    problem: Problem, models: list[tuple[np.ndarray, np.ndarray]], z: np.ndarray | None = None
) -> tuple[list[RunGap], list[np.ndarray]]:
    """Each run's own model's gap and prediction (rows, N_Y); `z` (rows, N_Y) in the place of what was measured."""
    found, flown = [], []
    for n, (P, F) in enumerate(models):
        part = problem.part(n)
        table = None
        if z is not None:
            table = z[problem.recording.bounds[n] : problem.recording.bounds[n + 1]]
            part.z = table
        scored = cut(part)
        gains = part.filter(P, F, begin=True)
        Y = estimated(part, F, gains)
        fly_on(part, scored, P, F, gains, Y)
        found.append(run_gap(part.runs[0], Y[:, : ef.Y_MOCAP_Z], scored.listed[0], table))
        flown.append(Y)
    return found, flown


def floor(search: Search, course: Course, rng: np.random.Generator) -> list[RunGap]:
    """What noise and disturbance leave of a perfect model: the selected model's own flights, predicted by itself."""
    problem = search.problem
    model = search.model(course)
    starts = search.gains.X[problem.recording.bounds[:-1]]
    draws = []
    for _ in range(DRAWS):
        Z = problem.simulated(*model, starts, rng)
        draws.append(gaps(problem, [model] * len(problem.runs), Z)[0])
    mean = []
    for n, run in enumerate(problem.runs):
        names = draws[0][n].channels
        channels = {name: root_mean_square([draw[n].channels[name] for draw in draws]) for name in names}
        mean.append(RunGap(run.name, channels, root_mean_square(channels.values()), draws[0][n].windows))
    return mean


def shrink(search: Search, course: Course) -> Shrinkage:
    """The gap before, recalibrated, after, and its floor, on runs left out of the fit."""
    problem = search.problem
    rng = np.random.default_rng(SEED)
    nominal = Model(problem.model.name, problem.model.P, problem.model.sigma)
    flown = predict_nominal(problem.case, nominal, problem.runs)
    listed = cut(problem).listed
    refitted, Y_refitted = gaps(problem, left_out(search, search.null))
    after, Y_after = gaps(problem, left_out(search, course)) if course.labels else (refitted, Y_refitted)
    runs = {
        BEFORE: [run_gap(run, flown[n], listed[n]) for n, run in enumerate(problem.runs)],
        RECALIBRATED: refitted,
        AFTER: after,
        FLOOR: floor(search, course, rng),
    }
    predictions = {BEFORE: flown, RECALIBRATED: Y_refitted, AFTER: Y_after}
    total = {name: np.array([gap.total for gap in found]) ** 2 for name, found in runs.items()}

    def of(pick: np.ndarray) -> tuple[float, float]:
        b, a, f = (float(np.sqrt(total[name][pick].mean())) for name in (BEFORE, AFTER, FLOOR))
        return 1.0 - a / b, (b - a) / max(b - f, 1e-9)

    whole = np.arange(len(problem.runs))
    drawn = np.array([of(rng.choice(whole, len(whole))) for _ in range(BOOTSTRAP)])
    low, high = np.quantile(drawn, [0.05, 0.95], axis=0)
    shrunk, closed = of(whole)
    mean = {name: float(np.sqrt(values.mean())) for name, values in total.items()}
    return Shrinkage(
        runs, mean[BEFORE], mean[RECALIBRATED], mean[AFTER], mean[FLOOR], shrunk, (float(low[0]), float(high[0])),
        closed, (float(low[1]), float(high[1])), predictions,
    )  # fmt: skip
