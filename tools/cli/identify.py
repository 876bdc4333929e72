"""`glider identify`: parameters and their distribution from runs."""

import sys
from pathlib import Path
from typing import Any

import click

from glider.tools.cli import own
from glider.tools.cli.common import json_option, print_result, say, vehicle_option
from glider.tools.data.errors import need
from glider.tools.data.files import check_writable


@click.command()
@click.argument("cases", metavar="CASE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), help="Folder for vehicle file and report.")
@click.option("--seed", type=click.IntRange(0, 2**31), default=1, show_default=True, help="Of the chains.")
@click.option(
    "--likelihood", type=click.Choice(["flights", "accelerations"]), default="flights", show_default=True,
    help="Flights held to the recordings, or the paper's: equation (1) along smoothed motion capture.",
)  # fmt: skip
@vehicle_option
@json_option
def identify(
    cases: tuple[Path, ...], out: Path | None, seed: int, likelihood: str, vehicle: str | None, as_json: bool
) -> None:
    """Identify the vehicle of CASE from its healthy runs: its numbers, and how sure they are.

    What is handed out flies runs that its fit has not seen no worse than the file does. Of ROUGHIE, the twelve
    coefficients by MCMC; runs that cannot be fitted are named and left out. With --out: identified.toml (a vehicle file
    that says where it comes from), report.html, posterior.nc (ArviZ).

    A model of one's own takes several cases, each a session of its own; --out has identified.toml and identified.json.
    """
    from glider.tools import api
    from glider.tools.data.runs.case import load_case
    from glider.tools.data.vehicle_kinds import kind_of

    if out is not None:
        check_writable(out)
    if (theirs := own.own_vehicle(cases[0], vehicle)) is not None:
        own.identify(theirs, cases, out, as_json)
        return
    if len(cases) > 1:
        raise click.UsageError("several cases are for a model of one's own; this vehicle takes one")
    loaded = load_case(cases[0], vehicle, leave_out=True)
    need(kind_of(loaded.vehicle).extra)
    from glider.tools.identify.files import VEHICLE
    from glider.tools.report.page import REPORT

    how: Any = likelihood
    found = api.identify(loaded, seed=seed, likelihood=how, progress=lambda text: print(text, file=sys.stderr))
    for note in found.notes:
        say(note)
    if out is not None:
        found.save(out)
        say(f"vehicle: {out / VEHICLE}{f', report: {out / REPORT}' if found.has_report else ''}")
    print_result(found, as_json)
