"""What the model says a recorded flight should have been: every window flown on from its start.

See docs/reference/gap.md, Measures.

Windows start where the filter of the flying model stands, which for this purpose also finds what the model lacks
(core/model_error): of a wrong model taken at its word the starts would be wrong, and the gap would be theirs.
"""

import itertools
from dataclasses import replace

import numpy as np

from glider.tools.data.runs.case import Case
from glider.tools.data.runs.run import Run
from glider.tools.inference.core.error_layout import Q_LATE
from glider.tools.inference.kind import ROUGHIE, Kind
from glider.tools.inference.model import Model, effect_vector
from glider.tools.inference.problem import Gains, Problem, cut, problem_of
from glider.tools.inference.recording import held
from glider.tools.inference.time_alignment import aligned, capture_times

COAST = 1.0  # s without motion capture, after which what is onboard takes over
LATE_CLOCK_S = 0.4  # s; of a clock farther out the observer sees every pose at its own time
WANDER = 0.1  # of how late it is, by which such a clock may wander in a second: so late, it is not steady either
LARGEST_READING = 1e4  # rad, rad/s, m, kg: no vehicle reads more


def without_doubled(problem: Problem) -> np.ndarray:
    """What was measured, (rows, N_Y), less implausible samples, and less what is onboard where motion capture sees the
    vehicle.

    An offset of attitude or depth is then in the gap and not in the start, and two sensors that disagree cannot pull
    the filter apart. Where motion capture has not seen the vehicle for COAST seconds, onboard takes over.
    """
    z, bounds = np.where(np.abs(problem.z) < LARGEST_READING, problem.z, np.nan), problem.recording.bounds
    for n, run in enumerate(problem.runs):
        part = z[bounds[n] : bounds[n + 1]]
        for onboard, mocap in problem.kind.doubled:
            seen = np.where(np.isfinite(part[:, mocap]), run.t, -np.inf)
            part[run.t - np.maximum.accumulate(seen) < COAST, onboard] = np.nan
    return z


def observe(problem: Problem, P: np.ndarray, F: np.ndarray, steady_clock: bool = False) -> Gains:
    """The filter that finds where windows start.

    It looks at no row behind the one where it stands, or says so (known). steady_clock: motion capture's clock is as
    the model has it, however late; else one that is far out may wander, too.
    """
    placed, walk, known = poses_in_place(problem, F)
    more = None if steady_clock else walk
    gains = observer_of(placed).filter(P, F, begin=True, speeds=problem.kind.window_speeds, more=more)
    return as_known(problem, gains, known)


def at_its_word(problem: Problem, P: np.ndarray, F: np.ndarray) -> Gains:
    """The filter that takes a model at its word, and finds nothing that it lacks."""
    placed, walk, known = poses_in_place(problem, F)
    return as_known(problem, placed.filter(P, F, begin=True, more=walk), known)


def poses_in_place(problem: Problem, F: np.ndarray) -> tuple[Problem, np.ndarray | None, np.ndarray | None]:
    """The problem with poses at their own time where the model's clock of motion capture is far out.

    With the clock's walk (n_spectral,), and what was known at each row (known_rows). A filter that corrects today's
    state by old poses is a loop with a delay, and leaves every vehicle. Where the clock is not far out, the problem
    itself, None and None.
    """
    if not problem.seen[[mocap for _, mocap in problem.kind.doubled]].any():
        return problem, None, None
    late = float(np.abs(problem.recording.t - capture_times(problem, F)).max())
    if late < LATE_CLOCK_S:
        return problem, None, None
    placed, walk = aligned(problem, F), np.zeros(problem.kind.n_spectral)
    walk[Q_LATE] = (WANDER * late) ** 2
    known, r = known_rows(placed), placed.recording
    placed.recording = replace(r, early=known[r.early - 1])
    return placed, walk, known


def as_known(problem: Problem, gains: Gains, known: np.ndarray | None) -> Gains:
    """Gains of a problem whose poses have been moved where `known` says so, with what was known at each row."""
    if known is None:
        return gains
    gains.X[problem.recording.bounds[:-1]] = problem.starts  # by readings as they were recorded, and no later ones
    return replace(gains, known=known)


def known_rows(problem: Problem) -> np.ndarray:
    """For every row, (rows,), behind which row nothing stands that was recorded later; no run's first row."""
    found = np.empty(len(problem.stamps), dtype=np.int64)
    for a, b in itertools.pairwise(problem.recording.bounds):
        latest = np.maximum.accumulate(problem.stamps[a:b])
        found[a:b] = a + np.maximum(np.searchsorted(latest, problem.recording.t[a:b], side="right"), 1)
    return found


def observer_of(problem: Problem) -> Problem:
    """The problem as the filter sees it that finds starts; poses of a clock known to be wrong replace no reading."""
    kind, z = problem.kind, problem.z
    wanders = problem.extra_noise is not None and kind.n_spectral > Q_LATE and problem.extra_noise[Q_LATE] > 0.0
    if problem.recorded is None and not wanders:
        z = without_doubled(problem)
    spreads = np.column_stack([problem.spreads, np.tile(kind.model_error_sd, (len(problem.runs), 1))])
    spreads[:, kind.speed_errors] = kind.window_speed_spread
    return replace(problem, z=z, spreads=spreads)


def fly_near(problem: Problem, models: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Predictions (models, rows, N_Y) of models (P, F) near the problem's own, whose observer's gains are kept.

    Far quicker than an observer of each. Rows that no window scores are NaN.
    """
    scored, gains = cut(problem), observe(problem, problem.model.P, effect_vector(problem.model))
    Y = np.full((len(models), 1, *problem.z.shape), np.nan)
    fly_followed(problem, models, gains, scored.first, scored.last, scored.run_of, np.zeros_like(scored.run_of), Y)
    return Y[:, 0]


def fly_followed(
    problem: Problem, models: list[tuple[np.ndarray, np.ndarray]], gains: Gains, first: np.ndarray, last: np.ndarray,
    run_of: np.ndarray, cut_of: np.ndarray, Y: np.ndarray,
) -> None:  # fmt: skip
    """Models (P, F) followed with an observer's gains (`observe`), and windows flown on, rows first to last - 1.

    Y (models, cuts, rows, N_Y) gets them, each window (windows,) in its cut; windows of a cut do not overlap.
    """
    r = problem.recording
    problem.kind.fly_followed(
        np.array([P for P, _ in models]), np.array([F for _, F in models]), np.array(problem.kind.drift), r.modes,
        r.bounds, r.t, gains.stamps, r.inputs, gains.z, gains.starts, gains.W, gains.K, gains.begin(first), first, last,
        run_of, cut_of, Y,
    )  # fmt: skip


def fly(problem: Problem, P: np.ndarray, F: np.ndarray, own_filter: bool = False) -> np.ndarray:
    """A model's prediction (rows, N_Y) of all runs; the windows' first 2 s hold the filter's estimate.

    own_filter: windows begin where the filter stands that takes the model at its word. So models are compared with each
    other: the observer would take up what tells them apart.
    """
    gains = at_its_word(problem, P, F) if own_filter else observe(problem, P, F)
    return fly_windows_from(problem, P, F, gains)


def fly_windows_from(problem: Problem, P: np.ndarray, F: np.ndarray, gains: Gains) -> np.ndarray:
    """The same from where a filter stands."""
    r, scored = problem.recording, cut(problem)
    Y = np.empty_like(problem.z)
    problem.kind.read_rows(F, gains.X, gains.path, r.t, r.bounds, Y)
    problem.kind.fly_windows(
        P, F, r.modes, r.bounds, r.t, r.inputs, gains.X, gains.path, gains.begin(scored.first), scored.first,
        scored.last, scored.run_of, Y,
    )  # fmt: skip
    return Y


def predict(case: Case, model: Model, runs: list[Run]) -> list[np.ndarray]:
    """A prediction (rows, N_Y) for every run."""
    problem = problem_of(case, model, runs)
    Y = fly(problem, model.P, effect_vector(model))
    return np.split(Y, problem.recording.bounds[1:-1])


def as_run(run: Run, Y: np.ndarray, kind: Kind = ROUGHIE) -> Run:
    """A prediction (rows, N_Y) with the rows and columns of the measured run, no gaps."""
    read = {reading.column: n for n, reading in enumerate(kind.readings)}
    # time and commands are not predicted, only without gaps
    columns = {name: held(Y[:, read[name]] if name in read else values) for name, values in run.columns.items()}
    return replace(run, columns=columns, path=None)
