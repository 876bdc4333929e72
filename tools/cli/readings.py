"""`glider gap readings`: what is wrong with the readings of a case, without any vehicle file."""

from pathlib import Path

import click

from glider.tools.cli.common import json_option, print_json, progress


@click.command()
@click.argument("case", type=click.Path(path_type=Path))
@json_option
def readings(case: Path, as_json: bool) -> None:
    """What is wrong with the readings of CASE: each held against the others, without a vehicle file.

    A finding has a size with its 90 % interval, the catalogue's label where it has one, and says whether later stages
    see the reading corrected (docs/READINGS.md).
    """
    from glider.sim_backend.ocean.vehicle import OceanVehicle
    from glider.tools.data.errors import InputError, need
    from glider.tools.data.runs.case import load_case
    from glider.tools.readings.check import check

    need("analysis")
    with progress("readings", 2) as advance:
        loaded = load_case(case)
        if isinstance(loaded.vehicle, OceanVehicle):
            raise InputError("an ocean glider: its readings are held against each other by gap watch", source=case)
        advance(1)
        found = check(loaded.runs)
        advance(1)
    if as_json:
        print_json({"readings": [one.plain() for one in found.findings]})
        return
    if not found.findings:
        click.echo("nothing found: the readings agree with each other as far as these flights can show")
    for one in found.findings:
        label = f"  [{one.label}]" if one.label else ""
        click.echo(f"{one.finding:11}{one.text}{label}{'  (corrected)' if one.mended else ''}")
