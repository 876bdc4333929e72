"""How well an ocean glider's mean speed is known: twin missions, identified and asked.

See docs/explanation/ocean.md, Velocity.

python -m glider.tools.verify.figures.ocean_speed --seed 90731 --missions 12
python -m glider.tools.verify.figures.ocean_speed --seed 90741 --missions 12 --changed
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np

from glider.tools.data.intervals import NINETY
from glider.tools.data.runs.case import load_case
from glider.tools.gap.velocity import Velocity, velocities
from glider.tools.identify.ocean.files import vehicle_text
from glider.tools.identify.ocean.identify import identify_ocean
from glider.tools.inference.model import nominal_model
from glider.tools.verify.challenge.ocean_cases import TRUTH_EVERY, draw_case, write_dives
from glider.tools.verify.challenge.ocean_plan import CRAFTS, MissionPlan
from glider.tools.verify.challenge.watch_plan import CHANGED, STEP, UNCHANGED, WatchCounts
from glider.tools.watch.watch import watch

LEARNED, ASKED = 12, 8  # dives
CHANGE = 3  # of the dives that are asked, the first that is changed
LABELS = ("drag", "net_buoyancy", "attitude_scale", "density_bias")
CM = 100.0


@dataclass
class SpeedQuery:
    """Of one mission's dives, m/s: error of the mean speed, what is said of it, and of its rows, all 1 sigma."""

    speed: bool
    errors: np.ndarray
    said: np.ndarray
    rows: np.ndarray


def plan_of(number: int, changed: bool) -> MissionPlan:
    """Crafts in turn, every other three missions with a speed log; changes in turn, steps from dive CHANGE on."""
    vehicle_class, speed = CRAFTS[number % 3], (number // 3) % 2 == 1
    if not changed:
        return MissionPlan(number, UNCHANGED, None, None, None, None, False, vehicle_class, speed)
    label = LABELS[(number // 6 + number) % len(LABELS)]
    return MissionPlan(number, CHANGED, label, STEP, CHANGE, None, False, vehicle_class, speed)


def asked(seed: int, plan: MissionPlan, folder: Path) -> SpeedQuery:
    """A mission drawn, identified from its first dives, and asked for the speed of the others.

    Of one that changes the watch is asked, with the first dives for its reference, and the changed dives are taken; an
    interval that is not even about its mean counts as half its width about its middle.
    """
    made = draw_case(seed, plan, WatchCounts(1, 1, LEARNED + ASKED, LEARNED))
    write_dives(folder / "before", plan.vehicle_class, made.runs[:LEARNED])
    write_dives(folder / "asked", plan.vehicle_class, made.runs[LEARNED:])
    vehicle, before = folder / "identified.toml", load_case(folder / "before")
    vehicle.write_text(vehicle_text(identify_ocean(before)), encoding="utf-8")
    case, true = load_case(folder / "asked", str(vehicle)), made.truth[LEARNED:]
    found = velocities(case, nominal_model(case))
    errors = np.array([mean_error(one, own) for one, own in zip(found, true, strict=True)])
    said = np.array([one.sd_mean_u for one in found])
    rows = np.array([one.columns["sd_u_m_s"][one.steady].mean() for one in found])
    if plan.kind == CHANGED:
        watched = [run.velocity for run in watch(case, load_case(folder / "before", str(vehicle))).runs]
        ends = np.array([one["ci90"] for one in watched if one is not None])
        errors += ends.mean(axis=1) - [float(one.columns["u_m_s"][one.steady].mean()) for one in found]
        said = np.ptp(ends, axis=1) / (2.0 * NINETY)
        errors, said, rows = errors[CHANGE:], said[CHANGE:], rows[CHANGE:]
    return SpeedQuery(plan.speed, errors, said, rows)


def mean_error(found: Velocity, true: np.ndarray) -> float:
    """Mean horizontal speed found less the true one (every TRUTH_EVERY s), where the vehicle flies steadily, m/s."""
    at_rows = np.interp(found.run.t, TRUTH_EVERY * np.arange(len(true)), true)
    return float((found.columns["u_m_s"] - at_rows)[found.steady].mean())


def summary(missions: list[SpeedQuery]) -> str:
    """A line: root mean squares over missions in cm/s, z of missions, dives within their 90 % intervals."""
    means = np.array([one.errors.mean() for one in missions])
    said, rows = (np.array([getattr(one, name).mean() for one in missions]) for name in ("said", "rows"))
    within = float(np.sqrt(np.mean([one.errors.var(ddof=1) for one in missions])))
    held = np.concatenate([np.abs(one.errors) <= NINETY * one.said for one in missions])
    rms = [CM * float(np.sqrt(np.mean(values**2))) for values in (means, said, rows)]
    z = means / said
    return (
        f"{len(missions)} missions: error {rms[0]:.2f}, said of the mean {rms[1]:.2f}, of rows {rms[2]:.2f} cm/s; "
        f"z {np.sqrt(np.mean(z**2)):.2f}, farthest {np.abs(z).max():.2f}; dives differ by {CM * within:.3f} cm/s; "
        f"held {100.0 * held.mean():.0f} % of {len(held)} dives"
    )


@click.command()
@click.option("--seed", required=True, type=click.IntRange(0, 2**63 - 1))
@click.option("--missions", default=12, show_default=True, type=click.IntRange(1, 1000))
@click.option("--changed", is_flag=True, help="Missions that change, and what `gap watch` says of their changed dives.")
def main(seed: int, missions: int, changed: bool) -> None:
    """Crafts in turn, three missions without a speed log, three with, and so on."""
    found = []
    for number in range(missions):
        with tempfile.TemporaryDirectory() as folder:
            found.append(asked(seed, plan_of(number, changed), Path(folder)))
        error, said = (CM * values.mean() for values in (found[-1].errors, found[-1].said))
        click.echo(f"{number} {CRAFTS[number % 3]}: {error:.2f} of {said:.2f}", err=True)
    for name, speed in (("depth alone", False), ("with speed", True)):
        if any(one.speed == speed for one in found):
            click.echo(f"{name}, {summary([one for one in found if one.speed == speed])}")


if __name__ == "__main__":
    main()
