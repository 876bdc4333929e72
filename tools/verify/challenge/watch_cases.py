"""One vehicle of a watch's blind test: drawn less well known than its file says, flown unchanged, then changed.

What all its runs share is no change: parameters drawn WIDER than [uncertainty], small constant errors of sensors, and
mostly an effect of its own. Sensors' biases also move a little from run to run.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from glider.firmware.model.vehicle import Vehicle
from glider.sim_backend.foreign import foreign_layout as fo
from glider.sim_backend.uncertainty import draw_parameters, sensor_errors
from glider.tools.verify.challenge.cases import NoCase, write_flights
from glider.tools.verify.challenge.design import LAKE, POOL, STYLES, draw_run
from glider.tools.verify.challenge.forms import FORMS, KNOWN, Form, draw_shapes, draw_waves
from glider.tools.verify.challenge.magnitude import find_strength, visible
from glider.tools.verify.challenge.trial import Trial, TrialFlight, flyable, with_effect
from glider.tools.verify.challenge.watch_plan import VehiclePlan, WatchCounts

WIDER = 2.0  # times [uncertainty] and the sensors' biases
WANDER = 0.3  # of a sensor's bias, from run to run
SENSOR_ERRORS = (fo.FS_GYRO_SCALE, fo.FS_IMU_ROLL, fo.FS_IMU_PITCH, fo.FS_DEPTH_SCALE, fo.FS_COMPASS_1, fo.FS_LEVER)
SENSOR_SIZES = (0.01, 0.005, 0.005, 0.01, 0.02, 0.02)  # 1 sigma: 1, rad, rad, 1, rad, m
SENSORS_WRONG = 2
COMMON_SHARE = 0.7  # of the vehicles: these have an effect in all runs
COMMON = (
    "drag", "linear_drag", "climb_dive_asymmetry", "lift", "added_mass", "side_force", "roll_trim", "pitch_trim",
    "pitch_damping", "yaw_trim", "weathercock", "yaw_damping", "net_buoyancy", "ballast_scale", "compressibility",
    "stratification", "cg_longitudinal", "slider_scale", "cg_lateral", "cg_vertical", "inertia", "servo_offset",
    "pump_droop", "compass", "gyro_scale", "depth_scale", "pressure_lever",
)  # fmt: skip  # of those that remember nothing
COMMON_VISIBLE = (1.3, 3.0)  # gap of a model that lacks it, over a perfect one's
VISIBLE = (2.0, 10.0)  # the same of a change at its full size
BISECTION_SHARE = 0.9  # of the least, that a bisection may fall short
SECONDS = (60.0, 90.0)  # of a run
TRIES, REDRAWN = 12, 40


@dataclass
class MadeVehicle:
    """A vehicle ready to be written."""

    plan: VehiclePlan
    trial: Trial
    common: str | None
    strength: float
    sizes: np.ndarray  # of the entries of F at strength 1
    visible: float
    flights: list[TrialFlight]  # reference first


def _trial(rng: np.random.Generator, vehicle: Vehicle, plan: VehiclePlan, runs: int) -> Trial:
    """A vehicle that is not quite what its file says, and its runs: each block of six has every style."""
    site = replace(POOL if plan.mocap else LAKE, seconds=SECONDS)
    waves = draw_waves(rng)
    styles = [style for _ in range(-(-runs // len(STYLES))) for style in rng.permutation(STYLES)][:runs]
    designs = [draw_run(rng, site, str(style), waves) for style in styles]
    shapes = draw_shapes(rng, SECONDS[0], site.depths)
    for n in rng.permutation(len(SENSOR_ERRORS))[:SENSORS_WRONG]:
        shapes[SENSOR_ERRORS[n]] += SENSOR_SIZES[n] * rng.standard_normal()
    errors = sensor_errors(vehicle, rng)
    errors[0] *= WIDER
    P = draw_parameters(vehicle, rng, WIDER)
    return Trial(vehicle, site, P, shapes, errors, designs, int(rng.integers(0, 2**31)), vehicle)


def _common(rng: np.random.Generator, trial: Trial, changed: Form | None) -> tuple[np.ndarray, str | None] | None:
    """F of all runs with an effect that is no change, and its label; None where it cannot be flown."""
    if rng.random() >= COMMON_SHARE:
        return trial.shapes, None
    places = changed.places if changed is not None else ()
    free = [form for form in KNOWN if form.label in COMMON and form.places[0] not in places]
    form = free[rng.integers(len(free))]
    sizes, strength = _drawn_size(rng, trial, form, COMMON_VISIBLE)
    return None if strength <= 0.0 else (with_effect(trial.shapes, form, sizes, strength), form.label)


def _drawn_size(
    rng: np.random.Generator, trial: Trial, form: Form, seen: tuple[float, float]
) -> tuple[np.ndarray, float]:
    """Sizes of an effect at strength 1, and the strength that makes it as visible as drawn between two factors."""
    sizes, most = form.draw(rng)
    target = float(np.exp(rng.uniform(*np.log(seen))))
    return sizes, find_strength(lambda strength: visible(trial, form, sizes, strength), target, most)


def _fly(rng: np.random.Generator, trial: Trial, effects: list[np.ndarray]) -> list[TrialFlight] | None:
    """Every run with its own F; what leaves the flyable region is drawn again. None where that does not help."""
    flights = []
    for n, F in enumerate(effects):
        errors = trial.errors.copy()
        tables = trial.vehicle.sensors
        sizes = [*3 * [tables.attitude.bias], *3 * [tables.gyro.bias], tables.depth.bias, tables.slider.bias,
                 tables.ballast.bias]  # fmt: skip
        errors[0] += WANDER * np.array(sizes) * rng.standard_normal(len(sizes))
        own = replace(trial, errors=errors)
        for _ in range(REDRAWN):
            flight = own._fly(F, n, trial.designs[n])
            if flyable([flight], trial.site):
                flights.append(flight)
                break
            trial.designs[n] = draw_run(rng, trial.site, str(rng.choice(STYLES)), trial.designs[n].waves)
        else:
            return None
    return flights


def draw_vehicle(seed: int, plan: VehiclePlan, counts: WatchCounts, vehicle: Vehicle) -> MadeVehicle:
    """Draw until the change shows as planned; NoCase where it never does."""
    for number in range(TRIES):
        rng = np.random.default_rng(np.random.SeedSequence([seed, 1001 + plan.number, number]))
        trial = _trial(rng, vehicle, plan, counts.runs)
        form = None if plan.label is None else FORMS[plan.label]
        found = _common(rng, trial, form)
        if found is None:
            continue
        trial.shapes, common = found
        strength, sizes, seen = 0.0, np.zeros(0), 1.0
        if form is not None:
            sizes, strength = _drawn_size(rng, trial, form, VISIBLE)
            seen = visible(trial, form, sizes, strength) if strength > 0.0 else 0.0
            if not seen >= BISECTION_SHARE * VISIBLE[0]:
                continue
        effects = [trial.shapes] * counts.reference
        for share in plan.strengths(counts.judged):
            effects.append(trial.shapes if form is None else _changed(trial.shapes, form, sizes, strength * share))
        flights = _fly(rng, trial, effects)
        if flights is not None:
            return MadeVehicle(plan, trial, common, strength, sizes, seen, flights)
    raise NoCase(f"{plan.name}: {plan.label} cannot be seen in {TRIES} drawn vehicles")


def _changed(F: np.ndarray, form: Form, sizes: np.ndarray, strength: float) -> np.ndarray:
    """F with a change added to what is there."""
    F = F.copy()
    F[list(form.entries)] += sizes * strength
    return F


def watch_answer(made: MadeVehicle, counts: WatchCounts) -> dict[str, Any]:
    """The truth: what changed, where, from which run to which, and how large it was in each."""
    plan = made.plan
    form = None if plan.label is None else FORMS[plan.label]
    known = form is not None and form.known
    return {
        "case": plan.name,
        "kind": plan.kind,
        "label": plan.label if known else None,
        "secret": plan.label if form is not None and not known else None,
        "places": [] if form is None else [list(place) for place in form.places],
        "course": plan.course,
        "from_run": plan.first,
        "to_run": plan.last,
        "strengths": plan.strengths(counts.judged).tolist(),
        "values": (made.sizes * made.strength).tolist(),
        "visible": made.visible,
        "common": made.common,
        "mocap": made.trial.site.mocap,
        "runs": counts.judged,
    }


def write_vehicle(made: MadeVehicle, counts: WatchCounts, cases: Path, reference: Path) -> None:
    """The runs before the change under `reference`, those that are watched under `cases`."""
    parts = ((reference, made.flights[: counts.reference]), (cases, made.flights[counts.reference :]))
    for folder, flights in parts:
        write_flights(folder / made.plan.name, made.trial, flights)
