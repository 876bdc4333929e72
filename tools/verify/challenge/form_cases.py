"""One vehicle of another form in a blind test: drawn, flown healthy, changed, flown again; its answer."""

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from glider.firmware.autopilot import Autopilot, configuration
from glider.firmware.guidance.mission import Leg, Mission
from glider.firmware.guidance.mission import Site as Water
from glider.firmware.model.vehicle import Vehicle
from glider.sim_backend.foreign import foreign_layout as fo
from glider.sim_backend.foreign.foreign_mission import fly_mission
from glider.sim_backend.uncertainty import sensor_errors
from glider.tools.verify.challenge.cases import NoCase, write_flights
from glider.tools.verify.challenge.design import FITTED, HELD, LAKE, POOL, STYLES, DesignSite, RunDesign, draw_run
from glider.tools.verify.challenge.form_fit import fit_flights, fit_forces, formless, residual
from glider.tools.verify.challenge.form_plan import BY_LABEL, CHANGES, OUTSIDE, FormCounts, FormPlan
from glider.tools.verify.challenge.form_vehicle import draw_body, draw_form_shapes
from glider.tools.verify.challenge.forms import Form, draw_waves
from glider.tools.verify.challenge.magnitude import find_strength
from glider.tools.verify.challenge.plan import UNKNOWN
from glider.tools.verify.challenge.trial import Trial, TrialFlight, flyable, poses, predictable, total, with_effect

PERIODS = {name: fo.ROW_S for name in ("imu", "beacon", "wires")}
BY_AUTOPILOT = 2 / 3  # of the runs: missions; the others by the foreign pilot, whose steps part more
BY_DEPTH = 0.15  # of the legs: the depth loop moves the ballast
LEG_LIMIT, MISSION_LIMIT = 300.0, 1800.0  # s
SIZE = (1.5, 6.0)  # gap that a change makes, in healthy residuals
BISECTION_SHARE = 0.9  # of the least, that a bisection may fall short
TRIES, GIVE_WAY, REDRAWN = 30, 10, 60  # vehicles a case; from then on another label; runs drawn again
REFINING = 6  # reference runs that the nearest vehicle of equation (4) is refined on
SPEED, PITCH, TURN = (0.2, 0.5), 0.14, 0.5  # m/s median in steady glides; rad from what was asked; rad in 30 s
PROBE = "probe"


@dataclass
class SawtoothDesign(RunDesign):
    """A run that the shipped autopilot flies."""

    mission: Mission = field(kw_only=True)


@dataclass
class FormTrial(Trial):
    """A vehicle of another form at a site; `shapes` hold its body."""

    def _pilot(self, F: np.ndarray, design: RunDesign, commands: np.ndarray, X: np.ndarray, Y: np.ndarray) -> None:
        if not isinstance(design, SawtoothDesign):
            super()._pilot(F, design, commands, X, Y)
            return
        autopilot, disturbance = pilot_of(self.vehicle, design.mission), self.flown.disturbance
        fly_mission(
            self.P, F, design.waves, self.errors, disturbance.linear, disturbance.angular, design.seed,
            design.start.copy(), autopilot.P, autopilot.C, autopilot.legs, autopilot.nav, commands, X, Y,
        )  # fmt: skip


def pilot_of(vehicle: Vehicle, mission: Mission) -> Autopilot:
    """The shipped autopilot at one tick a row."""
    return Autopilot(vehicle, mission, configuration(vehicle, mission, dt=fo.ROW_S, periods=PERIODS))


def draw_mission(rng: np.random.Generator, site: DesignSite) -> Mission:
    """Dives and climbs of drawn pitch, roll and ballast, more than a run has time for."""
    legs = []
    for number in range(24):
        sign = 1.0 if number % 2 == 0 else -1.0
        held = rng.random() >= BY_DEPTH
        legs.append(
            Leg(
                pitch_deg=-sign * rng.uniform(16.0, 36.0),
                roll_deg=0.0 if rng.random() < 0.35 else rng.uniform(-45.0, 45.0),
                depth_m=rng.uniform(*(site.lower if sign > 0.0 else site.upper)),
                ballast_kg=sign * rng.uniform(0.08, 0.18) if held else None,
                time_limit_s=LEG_LIMIT,
            )
        )
    water = Water(name=site.name, depth_m=site.limits[1])
    return Mission(format=1, name="blind", time_limit_s=MISSION_LIMIT, site=water, leg=legs)


def draw_design(rng: np.random.Generator, site: DesignSite, waves: np.ndarray) -> RunDesign:
    """A run: a mission of the autopilot's, or legs of the foreign pilot's."""
    plain = draw_run(rng, site, str(rng.choice(STYLES)), waves)
    if rng.random() >= BY_AUTOPILOT:
        return plain
    return SawtoothDesign(**vars(plain), mission=draw_mission(rng, site))


def _keep_flyable(rng: np.random.Generator, trial: FormTrial, F: np.ndarray) -> list[TrialFlight] | None:
    """Every run with F; those that leave the flyable region are drawn again. None where that does not help."""
    flights = []
    for n in range(len(trial.designs)):
        for _ in range(REDRAWN):
            flight = trial._fly(F, n, trial.designs[n])
            if flyable([flight], trial.site):
                flights.append(flight)
                break
            trial.designs[n] = draw_design(rng, trial.site, trial.designs[n].waves)
        else:
            return None
    return flights


def gross_behaviour(trial: FormTrial) -> dict[str, float]:
    """Speeds (m/s) and worst pitch error (rad) of steady glides both ways; the turn (rad in 30 s) of a rolled one."""
    wanted, probes = (-25.0, 25.0, -25.0), []  # deg
    for pitch, roll in zip(wanted, (0.0, 0.0, 30.0), strict=True):
        leg = Leg(pitch_deg=pitch, roll_deg=roll, duration_s=60.0, ballast_kg=math.copysign(0.12, -pitch))
        water = Water(name=PROBE, depth_m=100.0)
        mission = Mission(format=1, name=PROBE, time_limit_s=MISSION_LIMIT, site=water, leg=[leg])
        start, waves = np.zeros(fo.N_FX), np.zeros((0, fo.N_FW))
        start[2], start[3], start[7] = 30.0, 1.0, 0.1
        probes.append(SawtoothDesign(start, np.zeros((0, fo.N_L)), 600, np.uint64(1), waves, mission=mission))
    steady = replace(
        trial, site=replace(trial.site, mocap=False), errors=np.zeros_like(trial.errors), designs=list(probes)
    )
    X = [flight.X[300:600] for flight in steady.fly(trial.shapes)]
    speeds = [float(np.median(np.linalg.norm(x[:, 7:10], axis=1))) for x in X]
    missed = [float(np.median(poses(x)[:, 4]) - math.radians(pitch)) for x, pitch in zip(X, wanted, strict=True)]
    yaw = poses(X[2])[:, 5]
    return {
        "slowest": min(speeds), "fastest": max(speeds), "pitch": max(map(abs, missed)),
        "turn": float(yaw[-1] - yaw[0]),
    }  # fmt: skip


def plausible(trial: FormTrial) -> bool:
    """Whether a vehicle glides, trims and turns about as ROUGHIE does under the shipped autopilot."""
    seen = gross_behaviour(trial)
    speeds = SPEED[0] <= seen["slowest"] and seen["fastest"] <= SPEED[1]
    return speeds and seen["pitch"] <= PITCH and seen["turn"] >= TURN


def draw_healthy(rng: np.random.Generator, vehicle: Vehicle, runs: int) -> tuple[FormTrial, list[TrialFlight]] | None:
    """A vehicle of another form in the pool and its captured runs; None where it is not plausible or not flyable."""
    P, body = draw_body(rng, vehicle)
    waves = draw_waves(rng)
    designs = [draw_design(rng, POOL, waves) for _ in range(runs)]
    shapes = draw_form_shapes(rng, body, POOL.seconds[0], POOL.depths)
    trial = FormTrial(
        vehicle, POOL, P, shapes, sensor_errors(vehicle, rng), designs, int(rng.integers(0, 2**31)), vehicle
    )  # fmt: skip
    if not plausible(trial):
        return None
    flights = _keep_flyable(rng, trial, shapes)
    return None if flights is None else (trial, flights)


@dataclass
class MadeForm:
    """A vehicle ready to be written."""

    plan: FormPlan
    form: Form | None  # what changed
    values: np.ndarray  # of the form's entries of F
    size: float  # gap that the change makes, in healthy residuals
    residual: float  # gap of the nearest vehicle of equation (4), healthy, at the later runs' site
    P: np.ndarray  # that vehicle
    F: np.ndarray  # of the later runs
    later: FormTrial
    reference: list[TrialFlight]
    healthy: list[TrialFlight]  # held out, at the later runs' site, without the change
    changed: list[TrialFlight]  # FITTED for the case, HELD for its score
    tries: int


def _size(trial: FormTrial, form: Form, sizes: np.ndarray, strength: float, scale: float) -> float:
    """Gap that the change alone makes, in healthy residuals: of a model that lacks it only; NaN where not flyable."""
    F = with_effect(trial.shapes, form, sizes, strength)
    flights = trial.fly(F, FITTED)
    if not flyable(flights, trial.site):
        return float("nan")
    without = total(trial.channels(flights, trial.P, trial.shapes, plain=True, seen=True))
    perfect = total(trial.channels(flights, trial.P, predictable(F), plain=False))
    return float(np.sqrt(max(without**2 - perfect**2, 0.0)) / scale)


def _change(rng: np.random.Generator, trial: FormTrial, form: Form, scale: float) -> tuple[np.ndarray, float] | None:
    """Values of the form's entries at a drawn size, and that size; None where it cannot be had."""
    sizes, most = form.draw(rng)
    target = float(np.exp(rng.uniform(*np.log(SIZE))))

    def visible(strength: float) -> float:
        return float(np.sqrt(1.0 + _size(trial, form, sizes, strength, scale) ** 2))

    strength = find_strength(visible, float(np.sqrt(1.0 + target**2)), most)
    found = _size(trial, form, sizes, strength, scale) if strength > 0.0 else 0.0
    return (sizes * strength, found) if BISECTION_SHARE * SIZE[0] <= found <= SIZE[1] / BISECTION_SHARE else None


def draw_form_case(seed: int, plan: FormPlan, counts: FormCounts, vehicle: Vehicle) -> MadeForm:
    """Draw vehicles until the change can be had at its size; a label that cannot gives way to another of its kind."""
    for number in range(TRIES):
        rng = np.random.default_rng(np.random.SeedSequence([seed, 5001 + plan.number, number]))
        found = draw_healthy(rng, vehicle, counts.reference)
        if found is None:
            continue
        trial, reference = found
        site = POOL if plan.mocap else LAKE
        waves = trial.designs[0].waves
        later = replace(
            trial, site=site, designs=[draw_design(rng, site, waves) for _ in range(FITTED + HELD)],
            noise_seed=int(rng.integers(0, 2**31)),
            shapes=draw_form_shapes(rng, trial.shapes, site.seconds[0], site.depths),
        )  # fmt: skip
        healthy = _keep_flyable(rng, later, later.shapes)
        if healthy is None:
            continue
        P = fit_flights(trial, reference[:REFINING], fit_forces(trial, reference))
        scale = residual(later, healthy, P)
        form, values, size, F = None, np.zeros(0), 0.0, later.shapes
        if plan.label is not None:
            form = BY_LABEL[plan.label]
            if number >= GIVE_WAY:
                others = [
                    one for one in (OUTSIDE if plan.kind == UNKNOWN else CHANGES) if plan.mocap or not one.by_mocap
                ]
                form = others[rng.integers(len(others))]
            sized = _change(rng, later, form, scale)
            if sized is None:
                continue
            values, size = sized
            F = with_effect(later.shapes, form, values, 1.0)
        held_out = replace(
            later, designs=[draw_design(rng, site, waves) for _ in range(HELD)], noise_seed=int(rng.integers(0, 2**31))
        )  # fmt: skip
        unchanged, changed = _keep_flyable(rng, held_out, later.shapes), _keep_flyable(rng, later, F)
        if unchanged is not None and changed is not None:
            return MadeForm(plan, form, values, size, scale, P, F, later, reference, unchanged, changed, number + 1)
    raise NoCase(f"{plan.name}: {plan.label} cannot be had in {TRIES} drawn vehicles")


def form_answer(made: MadeForm) -> dict[str, Any]:
    """The truth of a case; `before` is of the nearest vehicle of equation (4), `oracle` of a perfect model."""
    plan, trial, form = made.plan, made.later, made.form
    unknown = plan.kind == UNKNOWN
    name = None if form is None else form.label
    return {
        "case": plan.name,
        "kind": plan.kind,
        "labels": [] if name is None else ["unknown"] if unknown else [name],
        "secret": [name] if unknown else [],
        "places": [] if form is None else [[list(place) for place in form.places]],
        "values": made.values.tolist(),
        "size": made.size,
        "residual": made.residual,
        "nearest": made.P.tolist(),
        "before": trial.channels(made.changed, made.P, formless(trial.shapes), plain=True),
        "oracle": trial.channels(made.changed, trial.P, predictable(made.F), plain=False),
        "healthy": trial.channels(made.healthy, made.P, formless(trial.shapes), plain=True),
        "runs": FITTED,
        "mocap": trial.site.mocap,
        "site": trial.site.name,
        "tries": made.tries,
    }


def write_form_case(made: MadeForm, cases: Path, held: Path, reference: Path, healthy: Path) -> None:
    """The runs of a case, each kind under its folder."""
    captured = replace(made.later, site=POOL)
    for folder, trial, flights in (
        (reference, captured, made.reference),
        (cases, made.later, made.changed[:FITTED]),
        (held, made.later, made.changed[FITTED:]),
        (healthy, made.later, made.healthy),
    ):
        write_flights(folder / made.plan.name, trial, flights)
