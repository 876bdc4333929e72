"""What `glider identify` is worth on vehicles of another form: gaps of healthy runs left out, before and after.

    python -m glider.tools.verify.figures.form_identify --seed 3101 --vehicles 12

Vehicles are drawn and flown as in `gap challenge make --form`, all runs healthy; those left out have motion capture,
and those fitted unless --no-mocap. Beside the file's and the identified vehicle stands the nearest of equation (4),
fitted to true states, from true starts.
"""

import tempfile
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import click
import numpy as np

from glider.tools.cli.common import progress
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import Case, load_case
from glider.tools.data.sources import load_vehicle
from glider.tools.gap.measure import RunGap, run_gap, with_total
from glider.tools.identify.files import VEHICLE as IDENTIFIED
from glider.tools.identify.files import write
from glider.tools.identify.pipeline import identify
from glider.tools.inference.channels import ROUGHIE_MEASURES
from glider.tools.inference.model import nominal_model
from glider.tools.inference.predict import predict
from glider.tools.study.workers import work_here
from glider.tools.verify.challenge.form_cases import draw_healthy, write_flights
from glider.tools.verify.challenge.form_fit import fit_flights, fit_forces, formless
from glider.tools.verify.challenge.make import VEHICLE
from glider.tools.verify.challenge.trial import by_channel, total

TRIES, REFINING = 20, 6
NAMES = ("file", "identified", "nearest")


@dataclass
class Gaps:
    """Each model's gaps by channel, `total` among them, over runs left out; fitted: the identified's over its own."""

    held: dict[str, dict[str, float]]
    fitted: float


def gaps_of(folder: Path, vehicle: str | None) -> list[RunGap]:
    """Each run's gaps as `gap predict` predicts it with a vehicle, None: the case's."""
    case = load_case(folder, vehicle)
    flown = predict(case, nominal_model(case), case.runs)
    return [
        run_gap(ROUGHIE_MEASURES, run, Y, ROUGHIE_MEASURES.windows(run.t))
        for run, Y in zip(case.runs, flown, strict=True)
    ]


def without_capture(case: Case) -> Case:
    """The case as its onboard instruments have it."""
    runs = [
        replace(run, columns={name: values for name, values in run.columns.items() if name not in names.MOCAP})
        for run in case.runs
    ]
    return replace(case, runs=runs, motion_capture=False)


def measure(seed: int, runs: int, held: int, mocap: bool, number: int) -> Gaps:
    """One vehicle drawn, identified from `runs` runs and judged on `held` others."""
    for attempt in range(TRIES):
        rng = np.random.default_rng(np.random.SeedSequence([seed, number, attempt]))
        found = draw_healthy(rng, load_vehicle(VEHICLE), runs + held)
        if found is not None:
            break
    else:
        raise RuntimeError(f"vehicle {number}: none in {TRIES} draws is plausible and flyable")
    trial, flights = found
    near = fit_flights(trial, flights[:REFINING], fit_forces(trial, flights[:runs]))
    nearest = trial.channels(flights[runs:], near, formless(trial.shapes), plain=True)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        write_flights(folder / "fitted", trial, flights[:runs])
        write_flights(folder / "held", trial, flights[runs:])
        case = load_case(folder / "fitted")
        write(identify(case if mocap else without_capture(case)), folder / "identified")
        vehicle = str(folder / "identified" / IDENTIFIED)
        after = with_total(gaps_of(folder / "held", vehicle))
        fitted = with_total(gaps_of(folder / "fitted", vehicle))["total"]
        before = with_total(gaps_of(folder / "held", None))
    gaps = dict(zip(NAMES, (before, after, by_channel(nearest) | {"total": total(nearest)}), strict=True))
    return Gaps(gaps, fitted)


def table(found: list[Gaps]) -> list[str]:
    """Lines: by channel each model's median over the vehicles and its worst; then how often identifying was worse."""
    lines = [f"{'channel':10}" + "".join(f"{name:>12}{'worst':>8}" for name in NAMES)]
    for channel in found[0].held["file"]:
        columns = [[one.held[name][channel] for one in found] for name in NAMES]
        lines.append(f"{channel:10}" + "".join(f"{np.median(values):12.2f}{max(values):8.2f}" for values in columns))
    worse = sum(one.held["identified"]["total"] > one.held["file"]["total"] for one in found)
    fitted = np.median([one.fitted for one in found])
    ratios = [one.held["identified"]["total"] / one.held["nearest"]["total"] for one in found]
    lines.append(f"identified over nearest: median {np.median(ratios):.2f}, worst {max(ratios):.2f}")
    lines.append(
        f"{len(found)} vehicles; identified worse than the file in {worse}; in its own runs, median {fitted:.2f}"
    )
    return lines


@click.command()
@click.option("--seed", required=True, type=click.IntRange(0))
@click.option("--vehicles", default=12, show_default=True, type=click.IntRange(1), help="How many are drawn.")
@click.option("--runs", default=12, show_default=True, type=click.IntRange(2), help="Runs each is identified from.")
@click.option("--held", default=4, show_default=True, type=click.IntRange(1), help="Runs that are left out.")
@click.option("--jobs", default=1, show_default=True, type=click.IntRange(0), help="Processes; 0: one a core.")
@click.option("--mocap/--no-mocap", default=True, show_default=True, help="Whether fitted runs have motion capture.")
def main(seed: int, vehicles: int, runs: int, held: int, jobs: int, mocap: bool) -> None:
    """Gaps in tolerances, by channel."""
    answers: dict[int, Gaps] = {}
    with progress("vehicles", vehicles) as advance:
        for number, found in work_here(partial(measure, seed, runs, held, mocap), range(vehicles), jobs):
            answers[number] = found
            one = " ".join(f"{name} {found.held[name]['total']:.2f}" for name in NAMES)
            click.echo(f"vehicle {number}: {one}, in its own runs {found.fitted:.2f}")
            advance(1)
    for line in table([answers[number] for number in range(vehicles)]):
        click.echo(line)


if __name__ == "__main__":
    main()
