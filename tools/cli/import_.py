"""`glider import`: other people's recordings into run data."""

from pathlib import Path

import click

from tools.cli.common import json_option, print_json, say


@click.group("import")
def import_() -> None:
    """Bring other recordings into run data."""


@import_.command("csv")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--map", "mapping", required=True, metavar="NAME or FILE", help="Mapping: shipped name or TOML file.")
@click.option("--out", type=click.Path(path_type=Path), help="Folder for the case.  [default: beside the first file]")
@json_option
def csv(files: tuple[Path, ...], mapping: str, out: Path | None, as_json: bool) -> None:
    """Turn CSV logs (.csv or .csv.gz), one a run, into a case, by a mapping file (docs/IMPORT.md)."""
    from tools.importers.csvlog import import_csv
    from tools.runs.run import run_name

    folder = files[0].parent / f"{run_name(files[0])}.case" if out is None else out
    imported = import_csv(list(files), mapping, folder)
    for note in imported.notes:
        say(note)
    if as_json:
        rows = [run.rows for run in imported.runs]
        files_written = [str(path) for path in imported.files]
        print_json({"case": str(folder), "files": files_written, "rows": rows, "notes": imported.notes})
    else:
        for path in imported.files:
            click.echo(path)
