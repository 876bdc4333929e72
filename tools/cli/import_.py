"""`glider import`: other people's recordings into run data."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from glider.tools.cli.common import json_option, print_lines, say
from glider.tools.cli.import_ocean import COMMANDS
from glider.tools.data.errors import need
from glider.tools.data.files import check_writable

if TYPE_CHECKING:
    from glider.tools.data.importers.csvlog import Imported


map_option = click.option("--map", "mapping", metavar="NAME or FILE", help="Mapping: shipped name or TOML file.")
template_option = click.option(
    "--template", type=click.Path(path_type=Path, dir_okay=False), help="Write a mapping to fill in."
)
vehicle_option = click.option(
    "--vehicle", type=click.Path(path_type=Path, dir_okay=False), help="With --template: file of a model of your own."
)
folder_option = click.option(
    "--out", type=click.Path(path_type=Path), help="Folder for the case.  [default: beside the first file]"
)


@click.group("import")
def import_() -> None:
    """Bring other recordings into run data."""


for _command in COMMANDS:
    import_.add_command(_command)


@import_.command("csv")
@click.argument("files", nargs=-1, type=click.Path(path_type=Path))
@map_option
@template_option
@vehicle_option
@folder_option
@click.option("--strict", is_flag=True, help="Refuse damaged rows, also where the mapping leaves them out.")
@json_option
def csv(files, mapping, template, vehicle, out, strict, as_json) -> None:
    """Turn CSV logs (.csv or .csv.gz), one a run, into a case, by a mapping file (docs/how-to/import.md).

    With --template a mapping with every key is written, and nothing imported.
    """
    from glider.tools.data.importers.csvlog import import_csv
    from glider.tools.data.runs.run import run_name
    from glider.tools.own.cases import import_target

    if _asked_for(template, "template.toml", files, mapping, vehicle):
        return
    folder = files[0].parent / f"{run_name(files[0])}.case" if out is None else out
    check_writable(folder)
    imported = import_csv(list(files), mapping, folder, strict, import_target(mapping))
    _say_imported(imported, folder, as_json, {"left_out": imported.left_out})


@import_.command("qualisys")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--log", type=click.Path(path_type=Path), help="Case of the onboard logs, a run for each file in turn.")
@click.option("--body", help="Rigid body.  [default: the first]")
@click.option("--vehicle", default="roughie", show_default=True, help="Without --log: shipped name or file.")
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Folder for the case.")
@json_option
def qualisys(files, log, body, vehicle, out, as_json) -> None:
    """Turn 6DOF exports (TSV) of Qualisys into a case, aligned in time with the onboard logs of another case."""
    from glider.tools.data.importers.captured import import_qualisys
    from glider.tools.data.runs.case import load_runs
    from glider.tools.data.runs.overview import lines, overview

    need("analysis")
    check_writable(out)
    written, offsets = import_qualisys(list(files), log, body, vehicle, out)
    runs = load_runs(out)[1]
    for path, offset in zip(files, offsets, strict=True):
        if offset is not None:
            say(f"{path}: {offset.seconds:+.3f} s to the log's clock (1 sigma {offset.sd:.3f} s)")
    for line in [] if as_json else lines(runs):
        say(line)
    clocks = [{"offset_s": None, "sd_s": None} if o is None else {"offset_s": o.seconds, "sd_s": o.sd} for o in offsets]
    answer = {"case": str(out), "files": [str(path) for path in written], "clocks": clocks}
    print_lines(written, as_json, answer | {"columns": [asdict(one) for one in overview(runs)]})


def _asked_for(
    template: Path | None, shipped: str, files: tuple[Path, ...], mapping: str | None, vehicle: Path | None
) -> bool:
    """Whether a mapping to fill in was asked for, and is written; UsageError where neither that nor an import is."""
    from glider.tools.data.importers.mapping import write_template
    from glider.tools.own.cases import import_template

    if vehicle is not None and template is None:
        raise click.UsageError("--vehicle goes with --template: a mapping names its own")
    if template is not None:
        if files or mapping is not None:
            raise click.UsageError("--template writes a mapping and imports nothing: give neither files nor --map")
        write_template(template, import_template(shipped, vehicle, template))
        say(f"mapping to fill in: {template}")
    elif not files or mapping is None:
        raise click.UsageError("give the logs and --map (--template FILE writes a mapping to fill in)")
    return template is not None


def _say_imported(imported: "Imported", folder: Path, as_json: bool, more: dict[str, Any]) -> None:
    """Notes, then the run files or, as JSON, all that is known of them."""
    from glider.tools.data.runs.overview import lines, overview

    for note in [*imported.notes, *([] if as_json else lines(imported.runs))]:
        say(note)
    print_lines(imported.files, as_json, {
        "columns": [asdict(one) for one in overview(imported.runs)],
        "seconds": [float(run.t[-1] - run.t[0]) for run in imported.runs],
        "case": str(folder), "files": [str(path) for path in imported.files],
        "rows": [run.rows for run in imported.runs], **more, "notes": imported.notes,
    })  # fmt: skip


def _import_streams(files, mapping, template, vehicle, out, as_json, extra, package, read, partial=False) -> None:
    """What `import rosbag` and `import ardusub` have in common; read: the function that reads one file."""
    from glider.tools.data.importers.streams import TEMPLATE, import_streams
    from glider.tools.own.cases import import_target

    if _asked_for(template, TEMPLATE, files, mapping, vehicle):
        return
    need(extra, package)
    folder = files[0].parent / f"{files[0].stem}.case" if out is None else out
    check_writable(folder)
    imported = import_streams(list(files), mapping, folder, read, partial, import_target(mapping))
    _say_imported(imported, folder, as_json, {})


@import_.command("rosbag")
@click.argument("files", metavar="[BAG]...", nargs=-1, type=click.Path(path_type=Path))
@map_option
@template_option
@vehicle_option
@folder_option
@json_option
def rosbag(files, mapping, template, vehicle, out, as_json) -> None:
    """Turn ROS 2 bags (SQLite or MCAP), one a run, into a case, by a mapping file (docs/how-to/import.md).

    A bag is its folder with metadata.yaml, or one of its files. With --template a mapping with every key is written,
    and nothing imported.
    """
    from glider.tools.data.importers.rosbag import read_rosbag

    _import_streams(files, mapping, template, vehicle, out, as_json, "ros", "rosbags", read_rosbag)


@import_.command("ardusub")
@click.argument("files", metavar="[LOG]...", nargs=-1, type=click.Path(path_type=Path))
@map_option
@template_option
@vehicle_option
@folder_option
@click.option("--partial", is_flag=True, help="Import what can be read of a cut or damaged log (default: refuse).")
@json_option
def ardusub(files, mapping, template, vehicle, out, partial, as_json) -> None:
    """Turn logs of ArduSub (DataFlash .BIN or telemetry .tlog), one a run, into a case, by a mapping file.

    The shipped mappings ardusub-bin and ardusub-tlog take attitude, rates and depth. With --template a mapping with
    every key is written, and nothing imported.
    """
    from glider.tools.data.importers.ardusub import read_ardusub

    _import_streams(files, mapping, template, vehicle, out, as_json, "ardupilot", "pymavlink", read_ardusub, partial)
