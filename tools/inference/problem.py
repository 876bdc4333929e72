"""A case as the observer sees it: recordings, noise, and flights of any model along them (core/filter)."""

from dataclasses import dataclass, replace

import numpy as np

from glider.firmware.model.vehicle import SensorsTable
from glider.sim_backend.ocean.vehicle import OceanSensors
from glider.tools.data.runs.case import Case
from glider.tools.data.runs.run import Run
from glider.tools.inference.channels import recorded
from glider.tools.inference.kind import Kind
from glider.tools.inference.kinds import kind_of
from glider.tools.inference.model import Model, nominal_model
from glider.tools.inference.recording import Recording, record
from glider.tools.inference.rules import Rules
from glider.tools.inference.windows import Window

ALL = Rules()
LEAST_NOISE = 1e-6
LOST = 1e6  # sigma; innovations of a model that has left every vehicle


@dataclass
class Gains:
    """What a filter leaves behind, by row: whitening, corrections, and the innovations of its own model."""

    z: np.ndarray  # (rows, N_Y) what it was given
    stamps: np.ndarray  # (rows,) s, of the poses in it
    W: np.ndarray  # (rows, N_Y, N_Y)
    K: np.ndarray  # (rows, n_error, N_Y)
    X: np.ndarray  # (rows, n_state) states
    path: np.ndarray  # (rows, n_path)
    E: np.ndarray  # (rows, N_Y) whitened innovations, NaN where nothing was measured
    misfit: np.ndarray  # (runs,) -2 log likelihood without its constant
    starts: np.ndarray  # (runs, n_state) where it began
    # (rows,): behind which row the filter stands that knows of nothing recorded behind a row; None: that row itself
    known: np.ndarray | None = None

    def begin(self, first: np.ndarray) -> np.ndarray:
        """The rows that windows with these first rows are flown from, (windows,): nothing recorded later is known."""
        return first if self.known is None else self.known[first - 1]


@dataclass
class Problem:
    """Runs behind each other in one table, ready for the kernels of their vehicle's kind.

    N_Y is the number of its readings; n_state, n_error, n_spectral are the kind's.
    """

    kind: Kind
    case: Case
    model: Model
    runs: list[Run]
    recording: Recording
    z: np.ndarray  # (rows, N_Y) measured
    starts: np.ndarray  # (runs, n_state) by the first readings; the first speed is the filter's to find (Gains)
    spreads: np.ndarray  # (runs, n_error)
    spectral: np.ndarray  # (n_spectral,) of accelerations, of walks of actuators, water and motion capture's clock
    R: np.ndarray  # (runs, N_Y)
    valid: np.ndarray  # (rows, N_Y) bool
    stamps: np.ndarray  # (rows,) s, of the poses of motion capture that stand in the rows
    run_of: np.ndarray  # (rows,)
    rules: Rules = ALL
    extra_noise: np.ndarray | None = None  # (n_spectral,) densities of disorder that was found, beside `spectral`

    recorded: "Problem | None" = None  # as it was before its poses were moved

    @property
    def since(self) -> np.ndarray:
        """Time from the run's start, (rows,) s."""
        t = self.recording.t
        return np.asarray(t - t[self.recording.bounds[:-1]][self.run_of])

    @property
    def as_recorded(self) -> "Problem":
        """The problem with motion capture's poses in the rows where they were recorded."""
        return self if self.recorded is None else self.recorded

    def with_extra_noise(self, more: np.ndarray) -> "Problem":
        """The problem, and the one it was made from, with densities (n_spectral,) of disorder added."""
        recorded = None if self.recorded is None else self.recorded.with_extra_noise(more)
        return replace(self, extra_noise=more, recorded=recorded)

    def reading(self, z: np.ndarray) -> "Problem":
        """The problem with other readings (rows, N_Y), of the same samples."""
        return replace(self, z=np.where(self.valid, z, np.nan))

    @property
    def densities(self) -> np.ndarray:
        """Spectral densities with the extra noise, (n_spectral,)."""
        return self.spectral.copy() if self.extra_noise is None else self.spectral + self.extra_noise

    @property
    def seen(self) -> np.ndarray:
        """Which readings these runs have at all, bool of shape (N_Y,)."""
        return np.asarray(self.valid.any(axis=0))

    @property
    def one_group(self) -> tuple[str, ...]:
        """Labels that these runs' readings cannot tell apart, whatever the evidence."""
        return self.kind.one_group([r.name for r, seen in zip(self.kind.readings, self.seen, strict=True) if seen])

    def filter(
        self, P: np.ndarray, F: np.ndarray, process_noise_scale: float = 1.0, begin: bool = False, more=None,
        doubt=None, speeds=None, starts=None,
    ) -> Gains:  # fmt: skip
        """The filter of a model over all runs; `process_noise_scale` multiplies the disturbance; `begin` seeks the
        first speed among `speeds`, the kind's if none are given. Nothing of the problem changes.

        starts (runs, n_state): where other gains began, in place of the problem's; more (n_spectral,) is added to the
        spectral densities, doubt (N_Y,) to the variances of the measurements.
        """
        kind, (rows, width), runs = self.kind, self.z.shape, len(self.runs)
        made = Gains(
            self.z, self.stamps, np.empty((rows, width, width)), np.empty((rows, self.spreads.shape[1], width)),
            np.empty((rows, kind.n_state)), np.empty((rows, kind.n_path)), np.empty((rows, width)), np.empty(runs),
            (self.starts if starts is None else starts).copy(),
        )  # fmt: skip
        spectral, speeds = self.densities, kind.speeds if speeds is None else speeds
        spectral[kind.accelerations] += self.spectral[kind.accelerations] * (process_noise_scale**2 - 1.0)
        if process_noise_scale > 1.0:
            spectral[kind.actuator_walks] += np.array(kind.inflated_walks) * process_noise_scale**2
        if more is not None:
            spectral += more
        R = self.R if doubt is None else self.R + doubt
        r = self.recording
        kind.filter_runs(
            P, F, spectral, R, self.model.sigma, np.array(kind.drift), r.modes, r.bounds, r.early, r.t, self.stamps,
            r.inputs, self.z, made.starts, np.array(speeds if begin else ()), self.spreads, made.X, made.path, made.E,
            made.W, made.K, made.misfit,
        )  # fmt: skip
        return made

    def open_loop_gains(self, gains: Gains) -> Gains:
        """Gains with which windows fly on commands alone, from their first 2 s on."""
        scored = cut(self)
        K = gains.K.copy()
        for first, last in zip(scored.first, scored.last, strict=True):
            K[first:last] = 0.0
        return replace(gains, K=K)

    def follow(self, models: list[tuple[np.ndarray, np.ndarray]], gains: Gains) -> np.ndarray:
        """Whitened innovations of models (P, F) with kept gains, from where those began: (models, valid samples)."""
        r = self.recording
        places = np.concatenate([[0], np.cumsum(self.valid.sum(axis=1))])[r.bounds]
        E = np.empty((len(models), places[-1]))
        if models:
            self.kind.follow_runs(
                np.array([P for P, _ in models]), np.array([F for _, F in models]), np.array(self.kind.drift), r.modes,
                r.bounds, r.t, self.stamps, r.inputs, self.z, gains.starts, gains.W, gains.K, self.valid, places,
                LOST, E,
            )  # fmt: skip
        return E

    def part(self, run: int) -> "Problem":
        """One of its runs as a problem of its own."""
        r = self.recording
        at = slice(r.bounds[run], r.bounds[run + 1])
        recording = replace(
            r, bounds=np.array([0, r.bounds[run + 1] - r.bounds[run]]), early=r.early[run : run + 1] - r.bounds[run],
            modes=r.modes[run : run + 1], t=r.t[at], inputs=r.inputs[at], drawn=r.drawn[at],
            begins=r.begins[run : run + 1],
        )  # fmt: skip
        return replace(
            self, runs=[self.runs[run]], recording=recording, z=self.z[at], starts=self.starts[run : run + 1],
            spreads=self.spreads[run : run + 1], R=self.R[run : run + 1], valid=self.valid[at],
            stamps=self.stamps[at], recorded=None,
            run_of=np.zeros(at.stop - at.start, dtype=np.int64),
        )  # fmt: skip

    def simulated(self, P: np.ndarray, F: np.ndarray, starts: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """What would have been measured, were (P, F) the truth: (rows, N_Y), NaN where nothing was."""
        r, Z = self.recording, np.empty_like(self.z)
        disturbance_draws = rng.standard_normal((len(Z), len(self.kind.disturbance)))
        self.kind.simulate_runs(
            P, F, self.densities, self.R, r.modes, r.bounds, r.t, r.inputs, starts, disturbance_draws,
            rng.standard_normal(Z.shape), Z,
        )  # fmt: skip
        Z[~self.valid] = np.nan
        return Z


def measured_all(kind: Kind, run: Run) -> np.ndarray:
    """Everything that was measured, (rows, N_Y): onboard, and motion capture's pose beside it."""
    table = np.full((run.rows, len(kind.readings)), np.nan)
    for n, reading in enumerate(kind.readings):
        if recorded(run, reading.column):
            table[:, n] = run.columns[reading.column]
    return table


def variances(kind: Kind, sensors: SensorsTable | OceanSensors) -> np.ndarray:
    """The measurements' variances, (N_Y,). A file may say that one has no noise; a filter must not believe that."""
    noise = [getattr(sensors, reading.source).noise for reading in kind.readings]
    return np.array([max(sigma, LEAST_NOISE) ** 2 for sigma in noise])


def problem_of(case: Case, model: Model | None = None, runs: list[Run] | None = None, rules: Rules = ALL) -> Problem:
    """The problem of a case (all of its runs, if none are named)."""
    kind = kind_of(case.vehicle)
    model = nominal_model(case) if model is None else model
    runs = case.runs if runs is None else runs
    recording = record(kind, runs)
    z = np.concatenate([measured_all(kind, run) for run in runs])
    if kind.unread is not None:
        z[kind.unread(recording.t, recording.bounds, recording.inputs)] = np.nan
    spreads, spectral = np.tile(kind.spread, (len(runs), 1)), np.zeros(kind.n_spectral)
    disturbance = [getattr(case.disturbance, name) for name in kind.disturbance]
    spectral[kind.accelerations] = np.array(disturbance) ** 2 * kind.hold
    walks = np.array(kind.walks)
    for i, entry in enumerate(kind.inputs):
        if entry.unseen is not None:
            unseen = (recording.modes & entry.driven) > 0
            if unseen.any():
                spreads[unseen, kind.actuator_errors.start + i], walks[i] = entry.unseen
        if entry.reading >= 0:  # a position that drives the model is no measurement beside it
            z[np.isfinite(recording.drawn[:, i]), entry.reading] = np.nan
    spectral[kind.actuator_walks] = walks
    run_of = np.repeat(np.arange(len(runs)), np.diff(recording.bounds))
    R = np.tile(variances(kind, case.sensors), (len(runs), 1))
    return Problem(
        kind, case, model, runs, recording, z, recording.begins.copy(), spreads, spectral, R, np.isfinite(z),
        recording.t, run_of, rules,
    )  # fmt: skip


@dataclass
class ScoringWindows:
    """Windows of the runs as docs/reference/gap.md, Windows, cuts them, in rows of the table."""

    listed: list[list[Window]]
    first: np.ndarray
    last: np.ndarray
    run_of: np.ndarray


def cut(problem: Problem) -> ScoringWindows:
    """The windows of all runs."""
    listed = [problem.kind.measures.windows(run.t) for run in problem.runs]
    flat = [(n, window) for n, found in enumerate(listed) for window in found if window.start < window.end]
    offset = problem.recording.bounds[:-1]
    return ScoringWindows(
        listed,
        np.array([offset[n] + window.start for n, window in flat], dtype=np.int64),
        np.array([offset[n] + window.end for n, window in flat], dtype=np.int64),
        np.array([n for n, _ in flat], dtype=np.int64),
    )
