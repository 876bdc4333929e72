"""`glider import slocum|seaglider|seaexplorer|og1`: ocean gliders' own files into run data."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from glider.tools.cli.common import json_option, print_lines, progress, say
from glider.tools.data.errors import need
from glider.tools.data.files import check_writable

if TYPE_CHECKING:
    from glider.tools.data.importers.ocean.mission import ImportedMission
    from glider.tools.data.importers.ocean.segment import Segment

SHOWN = 20  # lines about single runs
MANY = 20  # files: reading fewer takes seconds

files_argument = click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
out_option = click.option("--out", required=True, type=click.Path(path_type=Path), help="Folder for the case.")


@click.command("slocum")
@files_argument
@out_option
@click.option("--cache", type=click.Path(path_type=Path), help="Folder of header caches (*.cac), if not by the files.")
@json_option
def slocum(files: tuple[Path, ...], out: Path, cache: Path | None, as_json: bool) -> None:
    """Turn binaries of a Slocum (.dbd with .ebd, .sbd with .tbd, ...) into a case, a run for each segment."""
    need("slocum")
    need("ocean")
    from glider.tools.data.importers.ocean.slocum import read_slocum

    _import(files, out, "slocum", as_json, lambda advance: read_slocum(list(files), cache, advance))


@click.command("seaexplorer")
@files_argument
@out_option
@json_option
def seaexplorer(files: tuple[Path, ...], out: Path, as_json: bool) -> None:
    """Turn a SeaExplorer's navigation and payload tables (.gli., .pld1.) into a case, a run for each segment."""
    need("ocean")
    from glider.tools.data.importers.ocean.seaexplorer import read_seaexplorer

    _import(files, out, "seaexplorer", as_json, lambda advance: read_seaexplorer(list(files), advance))


@click.command("seaglider")
@files_argument
@out_option
@json_option
def seaglider(files: tuple[Path, ...], out: Path, as_json: bool) -> None:
    """Turn a base station's dive files of a Seaglider (p*.nc) into a case, a run for each dive."""
    need("ocean")
    from glider.tools.data.importers.ocean.seaglider import read_seaglider

    _import(files, out, "seaglider", as_json, lambda advance: read_seaglider(list(files), advance))


@click.command("og1")
@click.argument("file", type=click.Path(path_type=Path))
@out_option
@click.option("--vehicle", type=click.Choice(["slocum", "seaglider", "seaexplorer"]), help="Where the file names none.")
@json_option
def og1(file: Path, out: Path, vehicle: str | None, as_json: bool) -> None:
    """Turn a mission in OceanGliders' common format (OG-1.0, NetCDF) into a case, a run for each dive."""
    need("ocean")
    from glider.tools.data.importers.ocean.mission import write_mission
    from glider.tools.data.importers.ocean.og1 import read_og1

    check_writable(out)
    vehicle, segments = read_og1(file, vehicle)
    _show(write_mission(segments, out, vehicle), as_json)


COMMANDS = (slocum, seaglider, seaexplorer, og1)


def _import(
    files: tuple[Path, ...],
    out: Path,
    vehicle: str,
    as_json: bool,
    read: Callable[[Callable[[int], None]], "list[Segment]"],
) -> None:
    from glider.tools.data.importers.ocean.mission import write_mission

    check_writable(out)
    if len(files) < MANY:
        segments = read(lambda _: None)
    else:
        with progress(f"import {vehicle}", len(files)) as advance:
            segments = read(advance)
    _show(write_mission(segments, out, vehicle), as_json)


def _show(mission: "ImportedMission", as_json: bool) -> None:
    """What was left out on standard error; the run files, or all as JSON, on standard output."""
    from glider.tools.data.importers.ocean.mission import total

    for note in mission.notes[:SHOWN]:
        say(note)
    if len(mission.notes) > SHOWN:
        say(f"... and {len(mission.notes) - SHOWN} lines more (--json has them all)")
    everything = total(mission.left_out)
    reasons = ", ".join(f"{samples} {reason}" for reason, samples in everything.items()) or "nothing"
    say(f"{len(mission.runs)} runs, {sum(run.rows for run in mission.runs)} rows; left out: {reasons}")
    print_lines(mission.files, as_json, {
        "case": str(mission.folder), "vehicle": mission.vehicle, "files": [str(path) for path in mission.files],
        "rows": [run.rows for run in mission.runs], "hours_since_start": mission.hours,
        "left_out": mission.left_out, "left_out_in_all": everything, "notes": mission.notes,
    })  # fmt: skip
