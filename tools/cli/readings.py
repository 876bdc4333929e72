"""`glider gap readings`: what is wrong with the readings of a case, without any vehicle file."""

from pathlib import Path

import click

from glider.tools.cli import own
from glider.tools.cli.common import json_option, print_lines, progress
from glider.tools.data.errors import need


@click.command()
@click.argument("case", type=click.Path(path_type=Path))
@click.option("--vehicle", help="File of a model of your own, if case.toml names none.")
@json_option
def readings(case: Path, vehicle: str | None, as_json: bool) -> None:
    """What is wrong with the readings of CASE: each held against the others, without a vehicle file.

    Of a model of your own: columns that it follows far better in another unit, with the other sign, or exchanged.

    A finding has a size with its 90 % interval, the catalogue's label where it has one, and says whether later stages
    see the reading corrected (docs/explanation/readings.md).
    """
    from glider.tools import api
    from glider.tools.data.runs.case import load_case

    need("analysis")
    if (theirs := own.own_vehicle(case, vehicle)) is not None:
        own.readings(theirs, case, as_json)
        return
    with progress("readings", 2) as advance:
        loaded = load_case(case)
        advance(1)
        found = api.readings(loaded)
        advance(1)
    print_lines([found.summary()], as_json, {"readings": found.answer})
