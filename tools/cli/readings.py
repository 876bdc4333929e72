"""`glider gap readings`: what is wrong with the readings of a case, without any vehicle file."""

from pathlib import Path

import click

from glider.tools.cli.common import json_option, print_lines, progress
from glider.tools.data.errors import need


@click.command()
@click.argument("case", type=click.Path(path_type=Path))
@json_option
def readings(case: Path, as_json: bool) -> None:
    """What is wrong with the readings of CASE: each held against the others, without a vehicle file.

    A finding has a size with its 90 % interval, the catalogue's label where it has one, and says whether later stages
    see the reading corrected (docs/explanation/readings.md).
    """
    from glider.tools import api
    from glider.tools.data.runs.case import load_case

    need("analysis")
    with progress("readings", 2) as advance:
        loaded = load_case(case)
        advance(1)
        found = api.readings(loaded)
        advance(1)
    print_lines([found.summary()], as_json, {"readings": found.answer})
