"""One vehicle at one site flown through its runs, and its gaps from the true starts of the windows."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from glider.firmware.core.maths.rotations import wrap
from glider.firmware.core.vehicle.layout import N_X, X_ACT
from glider.firmware.model.vehicle import Vehicle
from glider.sim_backend.foreign import foreign_layout as fo
from glider.sim_backend.foreign.foreign_flight import fly_foreign, fly_on, pose_rows, start_from_readings
from glider.sim_backend.uncertainty import draw_parameters, sensor_errors
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run
from glider.tools.gap.measure import root_mean_square, run_gap
from glider.tools.inference.channels import ROUGHIE_MEASURES
from glider.tools.inference.windows import Window
from glider.tools.verify.challenge.design import STYLES, DesignSite, RunDesign, draw_run, draw_runs
from glider.tools.verify.challenge.forms import Form, draw_shapes, draw_waves

EXTRA = 40  # rows flown past the end: a fast motion capture clock looks ahead
TUMBLED_PITCH, TUMBLED_ROLL, TOO_FAST = 1.31, 1.57, 1.5  # rad, rad, m/s


@dataclass
class TrialFlight:
    """One run flown: truth and record."""

    design: RunDesign
    F: np.ndarray  # the effects it was flown with
    commands: np.ndarray  # (rows + EXTRA, 3)
    X: np.ndarray  # (rows + EXTRA, N_FX)
    run: Run

    @cached_property
    def windows(self) -> list[Window]:
        return ROUGHIE_MEASURES.windows(self.run.t)


@dataclass
class Trial:
    """A drawn vehicle and its designs; `fly` flies them with any effects."""

    vehicle: Vehicle
    site: DesignSite
    P: np.ndarray  # (N_P,) the true parameters, within [uncertainty]
    shapes: np.ndarray  # F without effects
    errors: np.ndarray  # (2, N_FR) bias and noise
    designs: list[RunDesign]
    noise_seed: int
    flown: Vehicle  # with the noise and disturbance that it has; `vehicle` has what its file says

    def fly(self, F: np.ndarray, runs: int | None = None) -> list[TrialFlight]:
        """Fly the first `runs` designs (all, if None) with effects F."""
        return [self._fly(F, n, design) for n, design in enumerate(self.designs[:runs])]

    def _fly(self, F: np.ndarray, number: int, design: RunDesign) -> TrialFlight:
        rows = design.rows + EXTRA
        commands, X, Y = np.zeros((rows, 3)), np.zeros((rows, fo.N_FX)), np.zeros((rows, fo.N_FR))
        self._pilot(F, design, commands, X, Y)
        columns = {names.TIME: np.arange(design.rows) * fo.ROW_S}
        columns |= dict(zip(names.COMMANDS, commands[: design.rows].T, strict=True))
        order = (*names.DRAW_WIRES, *names.ATTITUDE, *names.RATES, names.DEPTH)
        places = (fo.FR_SLIDER, fo.FR_BALLAST, *range(7))
        columns |= {name: Y[: design.rows, place] for name, place in zip(order, places, strict=True)}
        for name in names.ATTITUDE:
            columns[name] = wrap(columns[name])
        if self.site.mocap:
            columns |= self._mocap(F, number, X, design.rows)
        return TrialFlight(design, F, commands, X, Run(f"run{number:02d}", None, columns))

    def _pilot(self, F: np.ndarray, design: RunDesign, commands: np.ndarray, X: np.ndarray, Y: np.ndarray) -> None:
        """Fly a design with effects F: commands, states and readings in place."""
        disturbance = self.flown.disturbance
        fly_foreign(
            self.P, F, design.waves, self.errors, disturbance.linear, disturbance.angular, design.seed,
            design.start.copy(), design.legs, commands, X, Y,
        )  # fmt: skip

    def _mocap(self, F: np.ndarray, number: int, X: np.ndarray, rows: int) -> dict[str, np.ndarray]:
        """Motion capture's columns: at its own time, with noise and short blind spells."""
        rng = np.random.default_rng([self.noise_seed, number])
        pose = mocap_pose(F, poses(X), np.arange(rows))
        sensors = self.flown.sensors
        pose[:, :3] += sensors.mocap_position.noise * rng.standard_normal((rows, 3))
        pose[:, 3:] = wrap(pose[:, 3:] + sensors.mocap_attitude.noise * rng.standard_normal((rows, 3)))
        for first in np.flatnonzero(rng.random(rows) < 0.004):
            pose[first : first + rng.integers(1, 5)] = np.nan
        return dict(zip(names.MOCAP, pose.T, strict=True))

    def predict(
        self, flight: TrialFlight, P: np.ndarray, F: np.ndarray, plain: bool = False, seen: bool = False
    ) -> np.ndarray:
        """The flight's windows flown on from the truth with another model, (rows, 11); plain: of nominal form.

        A model of nominal form takes the slider to be where its wire is, and knows of nothing that effects remember;
        seen: without motion capture it also starts at the depth and attitude that its sensors show, noise apart.
        """
        rows, found = flight.run.rows, [w for w in flight.windows if w.scored and w.start < w.end]
        truth = poses(flight.X)
        Y = np.zeros((rows, len(ROUGHIE_MEASURES.columns)))
        beyond = EXTRA if self.site.mocap and (F[fo.FS_MOCAP_DELAY] or F[fo.FS_CLOCK_SKEW]) else 0
        first = np.array([w.start for w in found])
        last = np.array([w.end + beyond for w in found])
        longest = int((last - first).max())
        X, Xw, Yw = flight.X, np.zeros((len(found), longest, fo.N_FX)), np.zeros((len(found), longest, fo.N_FR))
        if plain:
            X = X.copy()
            if seen and not self.site.mocap:
                start_from_readings(flight.F, X, first - 1)
            X[:, X_ACT + 1] -= X[:, fo.X_SLIDER_Z]
            X[:, N_X:] = 0.0
        fly_on(P, F, flight.design.waves, flight.design.seed, flight.commands, X, first, last, Xw, Yw)
        for n, window in enumerate(found):
            here = slice(window.start, window.end)
            Y[here, :9] = Yw[n, : window.end - window.start]
            if self.site.mocap:
                watched = truth.copy()
                watched[window.start : window.end + beyond] = poses(Xw[n, : last[n] - first[n]])
                Y[here, 9:] = mocap_pose(F, watched, np.arange(window.start, window.end))[:, :2]
        return Y

    def channels(
        self, flights: list[TrialFlight], P: np.ndarray, F: np.ndarray, plain: bool, seen: bool = False
    ) -> list[dict[str, float]]:
        """Channel gaps of every flight for a model."""
        flown = [(f, self.predict(f, P, F, plain, seen)) for f in flights]
        return [run_gap(ROUGHIE_MEASURES, f.run, Y, f.windows).channels for f, Y in flown]


def poses(X: np.ndarray) -> np.ndarray:
    """Position and Euler angles (continuous) of states (rows, N_FX), shape (rows, 6)."""
    found = np.empty((len(X), 6))
    pose_rows(X, found)
    found[:, 3:] = np.unwrap(found[:, 3:], axis=0)
    return found


def mocap_pose(F: np.ndarray, pose: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """What motion capture gives out at the onboard times of `rows`: the pose (rows, 6) of another moment, maybe."""
    t = rows * fo.ROW_S
    late = F[fo.FS_MOCAP_DELAY] * (1.0 + F[fo.FS_JITTER] * np.sin(2.0 * np.pi * t / 7.0))
    ahead = F[fo.FS_CLOCK_SKEW] * (t + F[fo.FS_SKEW_STEP] * (t > F[fo.FS_SKEW_TIME]))
    at = np.arange(len(pose)) * fo.ROW_S
    return np.stack([np.interp(t - late + ahead, at, column) for column in pose.T], axis=1)


def draw_trial(rng: np.random.Generator, vehicle: Vehicle, site: DesignSite, flown: Vehicle | None = None) -> Trial:
    """A vehicle as identification leaves it, sensors with their biases, and its runs.

    flown: the vehicle with the noise that it really has, where that is not what its file says.
    """
    flown = vehicle if flown is None else flown
    waves = draw_waves(rng)
    designs = draw_runs(rng, site, waves)
    seconds = fo.ROW_S * min(design.rows for design in designs)
    return Trial(
        vehicle, site, draw_parameters(vehicle, rng), draw_shapes(rng, seconds, site.depths),
        sensor_errors(flown, rng), designs, int(rng.integers(0, 2**31)), flown,
    )  # fmt: skip


def redraw(rng: np.random.Generator, trial: Trial, F: np.ndarray, tries: int) -> bool:
    """Draw those designs again, in place, that F takes out of the flyable region; whether all stay in it now."""
    for _ in range(tries):
        bad = [n for n, flight in enumerate(trial.fly(F)) if not flyable([flight], trial.site)]
        if not bad:
            return True
        for n in bad:
            style = str(rng.choice(STYLES))
            trial.designs[n] = draw_run(rng, trial.site, style, trial.designs[n].waves)
    return False


def flyable(flights: list[TrialFlight], site: DesignSite) -> bool:
    """Whether no run tumbles, runs away or leaves the depths of the site."""
    for flight in flights:
        X = flight.X
        if not np.isfinite(X).all():
            return False
        angles = np.abs(wrap(poses(X)[:, 3:5])).max(axis=0)
        low, high = site.limits
        if angles[0] > TUMBLED_ROLL or angles[1] > TUMBLED_PITCH or np.abs(X[:, 7:10]).max() > TOO_FAST:
            return False
        if X[:, 2].min() < low or X[:, 2].max() > high:
            return False
    return True


def total(gaps: list[dict[str, float]]) -> float:
    """A case's total gap: rms over runs of the rms over channels."""
    return root_mean_square([root_mean_square(run.values()) for run in gaps])


def by_channel(gaps: list[dict[str, float]]) -> dict[str, float]:
    """Each channel's rms over the runs."""
    return {name: root_mean_square([run[name] for run in gaps]) for name in gaps[0]}


def with_effect(F: np.ndarray, form: Form, sizes: np.ndarray, strength: float) -> np.ndarray:
    """A copy of F with an effect at a strength."""
    F = F.copy()
    F[list(form.entries)] = sizes * strength
    return F


def predictable(F: np.ndarray) -> np.ndarray:
    """F without what no model could foretell: the phases of waves, turbulence."""
    F = F.copy()
    F[[fo.FS_WAVES, fo.FS_TURBULENCE]] = 0.0
    return F
