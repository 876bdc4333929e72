"""`glider export`: cases in the formats of others."""

from pathlib import Path

import click

from glider.tools.cli.common import json_option, print_json, say


@click.group("export")
def export() -> None:
    """Write a case in a format that others read."""


@export.command("og1")
@click.argument("case", type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path), help="NetCDF file to write.")
@click.option(
    "--with", "answers", multiple=True, metavar="DIR", type=click.Path(path_type=Path),
    help="Folder of `gap velocity`, `watch` or `diagnose`: its answer goes into the file. Several may be given.",
)  # fmt: skip
@json_option
def og1(case: Path, out: Path, answers: tuple[Path, ...], as_json: bool) -> None:
    """Write an ocean glider's case as a mission in OceanGliders' common format (OG-1.0)."""
    from glider.tools.data.errors import need

    need("ocean")
    from glider.tools.data.files import check_writable

    check_writable(out.parent)
    from glider.tools.data.exporters.og1 import export_og1

    found = export_og1(case, out, list(answers))
    for one in found:
        say(f"{one.name}: {one.long_name}")
    if as_json:
        print_json({"case": str(case), "file": str(out), "variables": [one.name for one in found]})
    else:
        click.echo(out)
