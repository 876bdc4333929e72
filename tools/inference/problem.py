"""A case as the diagnosis sees it: recordings, noise, and flights of any model along them (core/filter)."""

from dataclasses import dataclass, replace

import numpy as np

from firmware.core.layouts import estimator_layout as kf
from firmware.core.vehicle.layout import N_X
from firmware.model.estimator_settings import UNSEEN_SERVO_WALK
from firmware.model.vehicle import SensorsTable
from sim_backend.core.effects import effect_layout as ef
from tools.data.runs import columns as names
from tools.data.runs.case import Case
from tools.data.runs.run import Run
from tools.inference.channels import measured
from tools.inference.core.filter import filter_runs, follow_runs
from tools.inference.core.flight import simulate_runs
from tools.inference.core.step import N_ERR, N_Y
from tools.inference.model import Model, nominal_model
from tools.inference.recording import Recording, record
from tools.inference.rules import Rules
from tools.inference.windows import Window, windows

START_SPEEDS = (0.03, 0.2, 0.4)  # m/s, tried; each with SPEED_SPREAD
SPEED_SPREAD = (0.1, 0.03, 0.03)  # m/s
POSITION_SPREAD, DEPTH_SPREAD, ATTITUDE_SPREAD, RATE_SPREAD = 0.05, 0.05, 0.05, 0.05  # m, m, rad, rad/s about readings
ACTUATOR_SPREAD = (1e-4, 3e-4, 5e-4)  # rad, m, kg: where commanded, they begin at 0 and at the draw-wires
UNSEEN_SPREAD = 0.3  # rad, of a servo without command
ROUGH_WALK = (1e-6, 4e-10, 2.5e-9)  # per s, times the roughness squared, of filters that are not to trust the model
ALL = Rules()
LEAST_NOISE = 1e-6
LOST = 1e6  # sigma; innovations of a model that has left every vehicle
WALK = (1e-8, 1e-12, 1e-12)  # per s; commanded actuators go as the model says


DRIFT = (10.0, 0.0005**2, 0.005**2)  # s, (rad/s)2/s, (m/s)2/s: of what the model lacks


@dataclass
class Gains:
    """What a filter leaves behind, by row: whitening, corrections, and the innovations of its own model."""

    W: np.ndarray  # (rows, N_Y, N_Y)
    K: np.ndarray  # (rows, N_ERR, N_Y)
    X: np.ndarray  # (rows, N_XF) states
    path: np.ndarray  # (rows, 6)
    E: np.ndarray  # (rows, N_Y) whitened innovations, NaN where nothing was measured
    misfit: np.ndarray  # (runs,) -2 log likelihood without its constant


@dataclass
class Problem:
    """Runs behind each other in one table, ready for the kernels."""

    case: Case
    model: Model
    runs: list[Run]
    recording: Recording
    z: np.ndarray  # (rows, N_Y) measured
    starts: np.ndarray  # (runs, N_XF)
    spreads: np.ndarray  # (runs, N_ERR)
    spectral: np.ndarray  # (N_SPECTRAL,) of accelerations, of walks of actuators, water and motion capture's clock
    R: np.ndarray  # (runs, N_Y)
    valid: np.ndarray  # (rows, N_Y) bool
    stamps: np.ndarray  # (rows,) s, of the poses of motion capture that stand in the rows
    run_of: np.ndarray  # (rows,)
    rules: Rules = ALL
    extra_noise: np.ndarray | None = None  # (N_SPECTRAL,) densities of disorder that was found, beside `spectral`

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
        """The problem, and the one it was made from, with densities (N_SPECTRAL,) of disorder added."""
        recorded = None if self.recorded is None else self.recorded.with_extra_noise(more)
        return replace(self, extra_noise=more, recorded=recorded)

    @property
    def densities(self) -> np.ndarray:
        """Spectral densities with the extra noise, (N_SPECTRAL,)."""
        return self.spectral.copy() if self.extra_noise is None else self.spectral + self.extra_noise

    @property
    def seen(self) -> np.ndarray:
        """Which readings these runs have at all, bool of shape (N_Y,)."""
        return np.asarray(self.valid.any(axis=0))

    def filter(
        self, P: np.ndarray, F: np.ndarray, roughness: float = 1.0, begin: bool = False, more=None, doubt=None,
        speeds=START_SPEEDS,
    ) -> Gains:  # fmt: skip
        """The filter of a model over all runs; `roughness` multiplies the disturbance; `begin` seeks the first speed
        among `speeds`.

        more (N_SPECTRAL,) is added to the spectral densities, doubt (N_Y,) to the variances of the measurements.
        """
        rows, runs = len(self.z), len(self.runs)
        made = Gains(
            np.empty((rows, N_Y, N_Y)), np.empty((rows, self.spreads.shape[1], N_Y)), np.empty((rows, ef.N_XF)),
            np.empty((rows, 6)), np.empty((rows, N_Y)), np.empty(runs),
        )  # fmt: skip
        spectral = self.densities
        spectral[:6] += self.spectral[:6] * (roughness**2 - 1.0)
        if roughness > 1.0:
            spectral[6:9] += np.array(ROUGH_WALK) * roughness**2
        if more is not None:
            spectral += more
        R = self.R if doubt is None else self.R + doubt
        r = self.recording
        filter_runs(
            P, F, spectral, R, self.model.sigma, np.array(DRIFT), r.modes, r.bounds, r.early, r.t, self.stamps,
            r.inputs, self.z, self.starts, np.array(speeds if begin else ()), self.spreads, made.X, made.path, made.E,
            made.W, made.K, made.misfit,
        )  # fmt: skip
        return made

    def unheld(self, gains: Gains) -> Gains:
        """Gains with which windows fly on commands alone, from their first 2 s on."""
        scored = cut(self)
        K = gains.K.copy()
        for first, last in zip(scored.first, scored.last, strict=True):
            K[first:last] = 0.0
        return replace(gains, K=K)

    def follow(self, models: list[tuple[np.ndarray, np.ndarray]], gains: Gains) -> np.ndarray:
        """Whitened innovations of models (P, F) with kept gains, (models, valid samples)."""
        r, out = self.recording, []
        block = max(1, int(2e7 // self.z.size))
        for n in range(0, len(models), block):
            part = models[n : n + block]
            E = np.empty((len(part), *self.z.shape))
            follow_runs(
                np.array([P for P, _ in part]), np.array([F for _, F in part]), np.array(DRIFT), r.modes, r.bounds,
                r.t, self.stamps, r.inputs, self.z, self.starts, gains.W, gains.K, E,
            )  # fmt: skip
            out.append(np.clip(np.nan_to_num(E[:, self.valid], nan=LOST), -LOST, LOST))
        return np.concatenate(out)

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
            self, runs=[self.runs[run]], recording=recording, z=self.z[at], starts=self.starts[run : run + 1].copy(),
            spreads=self.spreads[run : run + 1], R=self.R[run : run + 1], valid=self.valid[at],
            stamps=self.stamps[at], recorded=None,
            run_of=np.zeros(at.stop - at.start, dtype=np.int64),
        )  # fmt: skip

    def simulated(self, P: np.ndarray, F: np.ndarray, starts: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """What would have been measured, were (P, F) the truth: (rows, N_Y), NaN where nothing was."""
        r, Z = self.recording, np.empty_like(self.z)
        rows = len(Z)
        simulate_runs(
            P, F, self.densities, self.R, r.modes, r.bounds, r.t, r.inputs, starts, rng.standard_normal((rows, 6)),
            rng.standard_normal((rows, N_Y)), Z,
        )  # fmt: skip
        Z[~self.valid] = np.nan
        return Z


def measured_all(run: Run) -> np.ndarray:
    """Everything that was measured, (rows, N_Y): onboard, and motion capture's pose beside it."""
    table = np.full((run.rows, N_Y), np.nan)
    table[:, : ef.Y_ONBOARD] = measured(run)[:, : ef.Y_ONBOARD]
    for onboard, mocap in zip(names.ATTITUDE, names.MOCAP_ATTITUDE, strict=True):
        if onboard not in run.columns and mocap in run.columns:
            table[:, names.ATTITUDE.index(onboard)] = np.nan
    if names.DEPTH not in run.columns:
        table[:, ef.Y_DEPTH] = np.nan
    for n, name in enumerate((*names.MOCAP_POSITION, *names.MOCAP_ATTITUDE)):
        if name in run.columns:
            table[:, ef.Y_MOCAP_X + n] = run.columns[name]
    return table


def variances(sensors: SensorsTable) -> np.ndarray:
    """The measurements' variances, (N_Y,). A file may say that one has no noise; a filter must not believe that."""
    of = [
        *3 * [sensors.attitude], *3 * [sensors.gyro], sensors.depth, sensors.slider, sensors.ballast,
        *3 * [sensors.mocap_position], *3 * [sensors.mocap_attitude],
    ]  # fmt: skip
    return np.array([max(sensor.noise, LEAST_NOISE) ** 2 for sensor in of])


def pose(case: Case, model: Model | None = None, runs: list[Run] | None = None, rules: Rules = ALL) -> Problem:
    """The problem of a case (all of its runs, if none are named)."""
    model = nominal_model(case) if model is None else model
    runs = case.runs if runs is None else runs
    recording = record(runs)
    count = len(runs)
    z = np.concatenate([measured_all(run) for run in runs])
    starts, spreads = np.zeros((count, ef.N_XF)), np.zeros((count, N_ERR))
    starts[:, :N_X] = recording.begins
    starts[:, 7], starts[:, 10:13] = 0.2, 0.0
    starts[:, ef.X_GEAR_SERVO], starts[:, ef.X_GEAR_SLIDER] = starts[:, 13], starts[:, 14]
    walk = np.array(WALK)
    for n in range(count):
        actuators = np.array(ACTUATOR_SPREAD)
        if recording.modes[n] & kf.SERVO_DRIVEN:
            actuators[0], walk[0] = UNSEEN_SPREAD, UNSEEN_SERVO_WALK**2
        spreads[n] = [
            POSITION_SPREAD, POSITION_SPREAD, DEPTH_SPREAD, *3 * [ATTITUDE_SPREAD], *SPEED_SPREAD, *3 * [RATE_SPREAD],
            *actuators, 0.0,
        ]  # fmt: skip
        # A position that drives the model is no measurement beside it.
        driven = recording.drawn[recording.bounds[n] : recording.bounds[n + 1]]
        z[recording.bounds[n] : recording.bounds[n + 1], ef.Y_SLIDER : ef.Y_BALLAST + 1][np.isfinite(driven)] = np.nan
    d = case.disturbance
    spectral = np.array(
        [*3 * [d.linear**2 * kf.DISTURBANCE_HOLD], *3 * [d.angular**2 * kf.DISTURBANCE_HOLD], *walk, *4 * [0.0]]
    )
    run_of = np.repeat(np.arange(count), np.diff(recording.bounds))
    R = np.tile(variances(case.sensors), (count, 1))
    return Problem(
        case, model, runs, recording, z, starts, spreads, spectral, R, np.isfinite(z), recording.t, run_of, rules
    )


@dataclass
class Scored:
    """Windows of the runs as docs/GAP.md, Windows, cuts them, in rows of the table."""

    listed: list[list[Window]]
    first: np.ndarray
    last: np.ndarray
    run_of: np.ndarray


def cut(problem: Problem) -> Scored:
    """The windows of all runs."""
    listed = [windows(run.t) for run in problem.runs]
    flat = [(n, window) for n, found in enumerate(listed) for window in found if window.start < window.end]
    offset = problem.recording.bounds[:-1]
    return Scored(
        listed,
        np.array([offset[n] + window.start for n, window in flat], dtype=np.int64),
        np.array([offset[n] + window.end for n, window in flat], dtype=np.int64),
        np.array([n for n, _ in flat], dtype=np.int64),
    )
