"""`glider import`: other people's recordings into run data."""

from pathlib import Path

import click

from glider.tools.cli.common import json_option, print_json, say
from glider.tools.cli.import_ocean import COMMANDS


@click.group("import")
def import_() -> None:
    """Bring other recordings into run data."""


for _command in COMMANDS:
    import_.add_command(_command)


@import_.command("csv")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--map", "mapping", required=True, metavar="NAME or FILE", help="Mapping: shipped name or TOML file.")
@click.option("--out", type=click.Path(path_type=Path), help="Folder for the case.  [default: beside the first file]")
@click.option("--strict", is_flag=True, help="Refuse damaged rows, also where the mapping leaves them out.")
@json_option
def csv(files: tuple[Path, ...], mapping: str, out: Path | None, strict: bool, as_json: bool) -> None:
    """Turn CSV logs (.csv or .csv.gz), one a run, into a case, by a mapping file (docs/IMPORT.md)."""
    from glider.tools.data.files import check_writable
    from glider.tools.data.importers.csvlog import import_csv
    from glider.tools.data.runs.run import run_name

    folder = files[0].parent / f"{run_name(files[0])}.case" if out is None else out
    check_writable(folder)
    imported = import_csv(list(files), mapping, folder, strict)
    for note in imported.notes:
        say(note)
    if as_json:
        print_json({
            "case": str(folder), "files": [str(path) for path in imported.files],
            "rows": [run.rows for run in imported.runs], "left_out": imported.left_out, "notes": imported.notes,
        })  # fmt: skip
    else:
        for path in imported.files:
            click.echo(path)


@import_.command("qualisys")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--log", type=click.Path(path_type=Path), help="Case of the onboard logs, a run for each file in turn.")
@click.option("--body", help="Rigid body.  [default: the first]")
@click.option("--vehicle", default="roughie", show_default=True, help="Without --log: shipped name or file.")
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Folder for the case.")
@json_option
def qualisys(files, log, body, vehicle, out, as_json) -> None:
    """Turn 6DOF exports (TSV) of Qualisys into a case, aligned in time with the onboard logs of another case."""
    from glider.tools.data.errors import need
    from glider.tools.data.files import check_writable
    from glider.tools.data.importers.captured import import_qualisys

    need("analysis")
    check_writable(out)
    written, offsets = import_qualisys(list(files), log, body, vehicle, out)
    for path, offset in zip(files, offsets, strict=True):
        if offset is not None:
            say(f"{path}: {offset.seconds:+.3f} s to the log's clock (1 sigma {offset.sd:.3f} s)")
    if as_json:
        rows = [
            {"offset_s": None, "sd_s": None} if o is None else {"offset_s": o.seconds, "sd_s": o.sd} for o in offsets
        ]
        print_json({"case": str(out), "files": [str(path) for path in written], "clocks": rows})
    else:
        for path in written:
            click.echo(path)
