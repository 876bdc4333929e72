"""One blind case from its plan to its files: drawn, sized, flown, written, and its answer."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from glider.firmware.model.vehicle import Vehicle
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import write_case
from glider.tools.verify.challenge.design import FITTED, LAKE, POOL
from glider.tools.verify.challenge.forms import FORMS
from glider.tools.verify.challenge.magnitude import LEAST_GAP_FLOORS, Magnitude, choose
from glider.tools.verify.challenge.messy import COUNT, LARGE, Factors, draw_factors, small_ones
from glider.tools.verify.challenge.plan import UNKNOWN, CasePlan
from glider.tools.verify.challenge.trial import (
    Trial,
    TrialFlight,
    draw_trial,
    flyable,
    predictable,
    redraw,
    total,
    with_effect,
)

LOG_RATE, DENSITY = 10.0, 998.0  # Hz, kg/m3
TRIES, GIVE_WAY = 48, 4  # an error of the gyro that grows with depth shows in one messy vehicle of many
DECIMALS = {name: 4 for name in names.ALL} | {
    names.TIME: 2, names.DEPTH: 3, "cmd_slider_m": 5, "cmd_ballast_kg": 5, "slider_m": 5, "ballast_kg": 5,
    **{name: 3 for name in names.MOCAP_POSITION},
}  # fmt: skip


@dataclass
class Made:
    """A case ready to be written."""

    plan: CasePlan
    trial: Trial
    F: np.ndarray
    magnitudes: list[Magnitude]
    flights: list[TrialFlight]
    tries: int
    small: list[Magnitude]  # beside them, of a messy case
    factors: Factors | None  # on noise, of a messy case


class NoCase(RuntimeError):
    """A case of the plan that could not be drawn: its effects cannot be seen in flyable runs."""


def draw_case(seed: int, plan: CasePlan, vehicle: Vehicle) -> Made:
    """Draw vehicles and runs until the effects show as planned; a size that cannot be had gives way to the other."""
    for number in range(TRIES):
        rng = np.random.default_rng(np.random.SeedSequence([seed, 1 + plan.number, number]))
        factors = draw_factors(rng, vehicle) if plan.messy else None
        flown = vehicle if factors is None else factors.applied(vehicle)
        trial = draw_trial(rng, vehicle, POOL if plan.mocap else LAKE, flown)
        if not redraw(rng, trial, trial.shapes, 40):
            continue
        found = []
        for label, weak in zip(plan.labels, plan.weak, strict=True):
            size = choose(
                rng, trial, FORMS[label], weak != (number >= GIVE_WAY), LARGE if plan.messy else LEAST_GAP_FLOORS
            )
            if size is None:
                break
            found.append(size)
        if len(found) < len(plan.labels):
            continue
        small = small_ones(rng, trial, {place for size in found for place in size.form.places}) if plan.messy else []
        if plan.messy and len(small) < COUNT:
            continue
        F = trial.shapes
        for size in (*found, *small):
            F = with_effect(F, size.form, size.sizes, size.strength)
        # Held runs were not looked at; a redrawn fitted run would change the sizes found.
        flights = trial.fly(F)
        if not flyable(flights[:FITTED], trial.site) or not redraw(rng, trial, F, 40):
            continue
        return Made(plan, trial, F, found, trial.fly(F), number + 1, small, factors)
    raise NoCase(f"{plan.name}: {' and '.join(plan.labels)} cannot be seen in {TRIES} drawn vehicles")


def answer(made: Made) -> dict[str, Any]:
    """The truth of a case, in the form of the examples' answers, with what each effect shows by itself."""
    plan, trial = made.plan, made.trial
    before = trial.channels(made.flights, trial.vehicle.vector(), trial.shapes, plain=True)
    oracle = trial.channels(made.flights, trial.P, predictable(made.F), plain=False)
    unknown = plan.kind == UNKNOWN
    messy = {} if made.factors is None else {"small": list(map(_setting, made.small)), "factors": asdict(made.factors)}
    return {
        "case": plan.name,
        "kind": plan.kind,
        "labels": ["unknown"] if unknown else list(plan.labels),
        "secret": list(plan.labels) if unknown else [],
        "places": [[list(place) for place in size.form.places] for size in made.magnitudes],
        "settings": [_setting(size) for size in made.magnitudes],
        "visible": min((size.visible for size in made.magnitudes), default=0.0),
        "ratio": total(before[:FITTED]) / total(oracle[:FITTED]),
        "scatter": any(size.form.scatter for size in made.magnitudes),
        "before": before,
        "oracle": oracle,
        "runs": FITTED,
        "mocap": trial.site.mocap,
        "site": trial.site.name,
        "tries": made.tries,
    } | messy


def _setting(size: Magnitude) -> dict[str, Any]:
    found = {name: value for name, value in asdict(size).items() if name not in ("form", "sizes")}
    return {"label": size.form.label, "values": (size.sizes * size.strength).tolist(), **found}


def write_flights(folder: Path, trial: Trial, flights: list[TrialFlight]) -> None:
    """Flights as a case's run data, numbered from 0."""
    runs = [replace(flight.run, name=f"run{n:02d}") for n, flight in enumerate(flights)]
    write_case(
        folder, runs, vehicle=trial.vehicle.name, site=trial.site.name, log_rate_hz=LOG_RATE,
        water_density_kg_m3=DENSITY, motion_capture=trial.site.mocap, suffix=".csv.gz", decimals=DECIMALS,
    )  # fmt: skip


def write(made: Made, cases: Path, held: Path) -> None:
    """The case's run data: the fitted runs under `cases`, the others under `held`."""
    for folder, flights in ((cases, made.flights[:FITTED]), (held, made.flights[FITTED:])):
        write_flights(folder / made.plan.name, made.trial, flights)
