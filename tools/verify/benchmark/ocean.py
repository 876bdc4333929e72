"""Ocean gliders: identification and watch, beside today's practice (glider_flight.py) on the same dives.

Both learn from a mission's first dives and judge the rest. The vertical water that either's numbers leave is taken by
one yardstick, the quasi-steady glide, on the same samples of the dives that were not learned from. Of a watch's
verdicts those count that depth rate could show: a list that is called roll is none. Missions are another simulator's:
half of them unchanged, half with a step of drag; and the cases of a folder, of which nothing is taken for changed.
"""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from glider.sim_backend.ocean.vehicle import KIND, OceanVehicle, decode_ocean_vehicle
from glider.tools.data.runs.case import CASE_FILE, Case, load_case
from glider.tools.identify.ocean.files import vehicle_text
from glider.tools.identify.ocean.identify import identify_ocean
from glider.tools.verify.benchmark.glider_flight import practise, water_rms
from glider.tools.verify.benchmark.registry import Settings
from glider.tools.verify.benchmark.timing import seconds
from glider.tools.verify.challenge.ocean_cases import example_mission
from glider.tools.verify.challenge.ocean_plan import CRAFTS
from glider.tools.watch.answer import NONE
from glider.tools.watch.watch import watch

DIVES, REFERENCE, FIRST = 20, 8, 14  # of a mission; learned from; the first changed dive
DRAG = 0.3
SEED = 7
FEWEST_RUNS = 6  # of a case
MOST_REFERENCE = 12
CENTIMETRES = 100.0


@dataclass
class Judged:
    """One mission judged by one way; (judged dives,) bool."""

    called: np.ndarray
    changed: np.ndarray  # the truth
    rms: float  # m/s, of unchanged dives
    seconds: float


def ours(case: Case, reference: int, changed: np.ndarray) -> Judged:
    """Identified from the first dives, and watched."""
    first, rest = replace(case, runs=case.runs[:reference]), replace(case, runs=case.runs[reference:])
    found: dict[str, Any] = {}

    def whole() -> None:
        vehicle = decode_ocean_vehicle(vehicle_text(identify_ocean(first)), "identified")
        found["vehicle"] = vehicle
        found["watch"] = watch(flown_by(rest, vehicle), flown_by(first, vehicle))

    taken = seconds(whole)
    vehicle, runs = found["vehicle"], found["watch"].runs
    called = np.array([
        run.verdict != NONE and not (run.causes and run.causes[0].label == "roll_trim") for run in runs
    ])  # fmt: skip
    rms = rms_of(vehicle, rest, changed, vehicle.hydrodynamics.Cd0, vehicle.buoyancy.volume)
    return Judged(called, changed, rms, taken)


def flown_by(case: Case, vehicle: OceanVehicle) -> Case:
    """The case with another vehicle file."""
    return replace(case, vehicle=vehicle, sensors=vehicle.sensors, disturbance=vehicle.disturbance)


def theirs(case: Case, reference: int, changed: np.ndarray) -> Judged:
    """Drag and volume fitted, and a threshold."""
    vehicle, found = case.of(OceanVehicle), []
    taken = seconds(lambda: found.append(practise(vehicle, case.runs, reference)))
    rest = replace(case, runs=case.runs[reference:])
    rms = rms_of(vehicle, rest, changed, found[0].reference_drag, found[0].volume)
    return Judged(found[0].changed[reference:], changed, rms, taken)


def rms_of(vehicle: OceanVehicle, rest: Case, changed: np.ndarray, drag: float, volume: float) -> float:
    """Of the vertical water in the dives that are unchanged, m/s."""
    return water_rms(vehicle, [run for run, c in zip(rest.runs, changed, strict=True) if not c], drag, volume)


def figures(own: list[Judged], practice: list[Judged], head: str = "") -> dict[str, Any]:
    """What both ways make of the same missions."""
    figures_by_name: dict[str, Any] = {}
    for name, listed in (("", own), ("practice_", practice)):
        called, changed = (np.concatenate([getattr(one, key) for one in listed]) for key in ("called", "changed"))
        figures_by_name[f"{head}{name}w_rms_cm_s"] = CENTIMETRES * float(
            np.sqrt(np.mean([one.rms**2 for one in listed]))
        )
        figures_by_name[f"{head}{name}false_alarms"] = float(called[~changed].mean())
        if changed.any():
            figures_by_name[f"{head}{name}found"] = float(called[changed].mean())
        figures_by_name[f"{head}{name}seconds"] = sum(one.seconds for one in listed)
    for key in ("w_rms_cm_s", "seconds"):
        figures_by_name[f"{head}{key}_ratio"] = (
            figures_by_name[f"{head}{key}"] / figures_by_name[f"{head}practice_{key}"]
        )
    figures_by_name[f"{head}dives"] = int(sum(len(one.called) for one in own))
    return figures_by_name


def made_missions(folder: Path) -> list[tuple[Case, np.ndarray]]:
    """Missions of every craft, unchanged and with more drag, with which of the judged dives are changed."""
    made = []
    for vehicle_class in CRAFTS:
        for change in (None, ("drag", DRAG, FIRST)):
            own = folder / f"{vehicle_class}-{'same' if change is None else 'drag'}"
            example_mission(own, vehicle_class, DIVES, SEED, change)
            changed = np.arange(REFERENCE, DIVES) >= (DIVES if change is None else FIRST)
            made.append((load_case(own), changed))
    return made


def measure(settings: Settings) -> dict[str, Any]:
    """Of our own missions: w_rms_cm_s, false_alarms, found, seconds, each beside practice_ and some as _ratio; dives.

    Of every case in settings.ocean_cases that has enough dives the same, under its name.
    """
    with tempfile.TemporaryDirectory() as folder:
        missions = made_missions(Path(folder))
        case, changed = missions[0]
        ours(replace(case, runs=case.runs[:3]), 2, changed[:1])  # compiles
        both = [(ours(case, REFERENCE, changed), theirs(case, REFERENCE, changed)) for case, changed in missions]
    figures_by_name = figures([one for one, _ in both], [other for _, other in both])
    for path in [] if settings.ocean_cases is None else sorted(settings.ocean_cases.iterdir()):
        if not (path / CASE_FILE).is_file():
            continue
        case = load_case(path)
        if case.vehicle.kind != KIND or len(case.runs) < FEWEST_RUNS:
            continue
        reference = min(MOST_REFERENCE, len(case.runs) // 2)
        same = np.zeros(len(case.runs) - reference, dtype=bool)
        figures_by_name |= figures([ours(case, reference, same)], [theirs(case, reference, same)], f"{path.name}_")
    return figures_by_name
