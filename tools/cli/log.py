"""`glider log`: look into, export, repair an onboard log, or fetch it off the vehicle."""

import json
from pathlib import Path
from typing import Any

import click

from glider.tools.cli.common import DONE, FAILED, json_option, print_json, print_lines, progress, say, show
from glider.tools.cli.replay import replay
from glider.tools.data.errors import InputError
from glider.tools.data.files import check_writable

LEVELS = {10: "debug", 20: "info", 30: "warn", 40: "error", 50: "fatal"}
_SHOWN_EVENTS = 20


@click.group()
def log() -> None:
    """Export, look into, repair an onboard log, or fetch it off the vehicle."""


def _file(path: Path) -> Path:
    if path.is_dir():
        raise InputError("a folder, where a log was expected", source=path)
    return path


def _state(the_log: Any) -> str:
    """Complete or cut, in words."""
    if the_log.complete and not the_log.damages:
        return "complete"
    words = ["complete" if the_log.complete else f"cut at byte {the_log.end} of {the_log.size}"]
    words += [f"damaged at byte {item.offset}, {item.length} bytes: {item.what}" for item in the_log.damages]
    return "; ".join(words)


def _parts(the_log: Any) -> list[str]:
    """A flight's files, one a line, with what is missing before each; none for a log of one file."""
    from glider.tools.data.log.parts import FlightLog

    if not isinstance(the_log, FlightLog):
        return []
    lines = {part.number: f"{part.log.path.name}: {_state(part.log)}{_before(part)}" for part in the_log.parts}
    lines |= {number: f"{file.name}: is not there; never begun, or gone" for number, file in the_log.absent.items()}
    return [*(lines[number] for number in sorted(lines)), *the_log.left_out]


def _before(part: Any) -> str:
    lost = ", ".join(f"{count} of {name}" for name, count in part.lost.items() if count)
    return f"; missing before it: {lost} ({part.gap_s:.2f} s)" if lost else ""


def _headline(the_log: Any) -> str:
    """How it is with a log, in words."""
    from glider.hal.recorder.logfile import PART
    from glider.tools.data.log.parts import FlightLog

    if isinstance(the_log, FlightLog):
        return f"in {len(the_log.parts)} parts"
    number = the_log.metadata.get(PART)
    return _state(the_log) if number is None else f"part {number} of a flight, alone; {_state(the_log)}"


def _parts_summary(the_log: Any) -> dict[str, Any]:
    """What --json says of a flight's parts; nothing for a log of one file."""
    from glider.tools.data.log.parts import FlightLog

    if not isinstance(the_log, FlightLog):
        return {}
    parts = [
        {
            "part": part.number, "file": str(part.log.path), "bytes": part.log.size, "complete": part.log.complete,
            "read_to": part.log.end, "damaged": [vars(item) for item in part.log.damages],
            "missing_before": part.lost, "gap_s": part.gap_s,
        }
        for part in the_log.parts
    ]  # fmt: skip
    return {"parts": parts, "absent": [str(f) for f in the_log.absent.values()], "left_out": the_log.left_out}


def _summary(the_log: Any) -> dict[str, Any]:
    return {
        "file": str(the_log.path),
        "bytes": the_log.size,
        "complete": the_log.complete,
        "read_to": the_log.end,
        "damaged": [vars(item) for item in the_log.damages],
        "began": the_log.began or None,
        "duration_s": the_log.duration_s,
        "topics": {
            name: {
                "records": topic.count,
                "missing": topic.missing,
                "schema": topic.schema_name,
                "fields": [item.name for item in topic.fields],
            }
            for name, topic in the_log.topics.items()
        },
        "attachments": {name: len(text.encode()) for name, text in the_log.attachments.items()},
        "metadata": the_log.metadata,
        "ending": the_log.ending,
        "events": [vars(event) for event in the_log.events],
        **_parts_summary(the_log),
    }


def _devices(text: str) -> list[str]:
    """Error counts of the devices at the flight's end, one a line, out of the log's closing entry."""
    from glider.tools.flight.device_counts import errors_text

    try:
        return [f"{name}: {errors_text(health) or 'no errors'}" for name, health in json.loads(text).items()]
    except (ValueError, KeyError, AttributeError, TypeError, RecursionError):  # not the recorder's
        return [text]


@log.command()
@click.argument("file", type=click.Path(path_type=Path))
@json_option
def info(file: Path, as_json: bool) -> None:
    """What is in a log, with the parts it goes on in: topics, counts, texts, events, and whether it is complete."""
    from glider.tools.data.log.parts import read_flight

    the_log = read_flight(_file(file))
    if the_log.size == 0:
        raise InputError("empty: nothing was recorded in it", source=file)
    if as_json:
        print_json(_summary(the_log))
        return
    show(f"{file}: {_headline(the_log)}; {f'{the_log.began}, ' if the_log.began else ''}{the_log.duration_s:.2f} s")
    for line in _parts(the_log):
        show(f"  {line}")
    for name, topic in the_log.topics.items():
        missing = f", {topic.missing} missing" if topic.missing else ""
        show(f"  {name:<10} {topic.count} records{missing} ({topic.schema_name}, {len(topic.fields)} numbers)")
    for name, text in the_log.attachments.items():
        show(f"  {name:<20} {len(text.encode())} bytes")
    for name, text in {**the_log.metadata, **the_log.ending}.items():
        for line in _devices(text) if name == "devices" else [text]:
            show(f"  {name:<20} {line}")
    for event in the_log.events[:_SHOWN_EVENTS]:
        show(f"  {event.time_s:9.2f} s  {LEVELS.get(event.severity, event.severity):<5} {event.text}")
    if len(the_log.events) > _SHOWN_EVENTS:
        show(f"  and {len(the_log.events) - _SHOWN_EVENTS} more events (--json has them all)")


log.add_command(replay)


@log.command()
@click.argument("sources", metavar="FILE...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), help="Folder for the case; for run data, the log to write.")
@click.option("--vehicle", help="Vehicle file or name, in place of the log's own.")
@json_option
def export(sources: tuple[Path, ...], out: Path | None, vehicle: str | None, as_json: bool) -> None:
    """Turn logs into run data (a case folder, a run a log), or run data (a case's folder or run file) into a log."""
    run_data = [source for source in sources if source.is_dir() or source.name.endswith((".csv", ".csv.gz"))]
    if run_data and len(sources) > 1:
        raise InputError("run data, which is exported one by one", source=run_data[0])
    if run_data:
        files = _to_logs(run_data[0], out)
        result = {"files": [str(path) for path in files], "notes": []}
    else:
        result = _to_case(sources, out, vehicle)
    for note in result["notes"]:
        say(note)
    print_lines(result["files"], as_json, result)


def _to_case(sources: tuple[Path, ...], out: Path | None, vehicle: str | None) -> dict[str, Any]:
    from glider.tools.data.log.parts import read_flight
    from glider.tools.data.log.rundata import export_case

    logs = [read_flight(source) for source in sources]
    folder = _case_beside(sources[0]) if out is None else out
    check_writable(folder)
    exported = export_case(logs[0], folder, vehicle=vehicle, more=logs[1:])
    states = [line for log in logs if not log.whole for line in _parts(log) or [_state(log)]]
    notes = [*states, *exported.notes]
    return {"case": str(folder), "files": [str(path) for path in exported.files], "rows": exported.rows, "notes": notes}


def _case_beside(source: Path) -> Path:
    name = source.name.removesuffix(".mcap")
    return source.with_name(f"{name}.case" if name == source.name else name)


def _to_logs(source: Path, out: Path | None) -> list[Path]:
    """One log a run: --out names it, or for several runs the folder that takes them; else beside the run."""
    from glider.tools.data.log.rundata import write_log
    from glider.tools.data.runs.case import load_case, load_case_of_run

    if source.is_dir():
        case = load_case(source)
        runs = case.runs
    else:
        case, run = load_case_of_run(source)
        runs = [run]
    if len(runs) > 1:
        folder = case.folder if out is None else out
        folder.mkdir(parents=True, exist_ok=True)
        return [write_log(folder / f"{run.name}.mcap", case, run) for run in runs]
    return [write_log(case.folder / f"{runs[0].name}.mcap" if out is None else out, case, runs[0])]


@log.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), help="Log to write.  [default: NAME.repaired.mcap]")
@json_option
def repair(file: Path, out: Path | None, as_json: bool) -> None:
    """Write what can be trusted of a cut or damaged log as a complete one; a flight's parts become one log.

    The originals stay.
    """
    from glider.tools.data.log.repair import repair as repair_log

    report = repair_log(_file(file), out)
    lost = [vars(item) for item in report.damages]
    if as_json:
        print_json(
            {
                "file": None if report.out is None else str(report.out),
                "was_complete": report.was_complete,
                "messages": report.messages,
                "torn_bytes": report.torn_bytes,
                "damaged": lost,
                "parts": [str(path) for path in report.parts],
                "absent": [str(path) for path in report.absent],
                "left_out": report.left_out,
            }
        )
    elif report.out is None:
        say(f"{file}: complete; nothing to repair")
    else:
        say(
            f"{report.messages} records kept; lost: {report.torn_bytes} bytes of a torn end, {len(lost)} damaged places"
        )
        for item in report.damages:
            say(f"  at byte {item.offset}, {item.length} bytes: {item.what}")
        if len(report.parts) > 1:
            say(f"  written from {', '.join(path.name for path in report.parts)}")
        for line in (*(f"{path.name}: is not there; never begun, or gone" for path in report.absent), *report.left_out):
            say(f"  {line}")
        click.echo(report.out)
    raise SystemExit(DONE if report.out is None or report.messages else FAILED)


@log.command()
@click.argument("host")
@click.argument("names", nargs=-1)
@click.option("--dir", "folder", default="/var/lib/glider/logs", show_default=True, help="Folder of the onboard logs.")
@click.option("--out", type=click.Path(path_type=Path, file_okay=False), default=Path("logs"), show_default=True)
@json_option
def fetch(host: str, names: tuple[str, ...], folder: str, out: Path, as_json: bool) -> None:
    """Bring logs off the vehicle by ssh: all that are not here yet, or those NAMES (sawtooth-001, spiral-*).

    HOST is what ssh knows, user@glider. A fetch that broke off goes on where it was; a log counts as here only when it
    has its check sum onboard. Nothing is deleted or written onboard. Exit code 1: not all are here; run it again.
    """
    from glider.tools.data.log import fetch as logs
    from glider.tools.data.remote import host as connect

    done: list[logs.Fetched] = []

    def tell(one: logs.Fetched) -> None:
        done.append(one)
        say(one.message or f"{one.name}: {one.bytes} bytes, {one.became}")

    failure = ""
    try:
        with connect(host) as vehicle:
            sizes = logs.list_logs(vehicle, folder, names)
            if not sizes:
                failure = f"{host}:{folder}: no log{f' named {chr(32).join(names)}' if names else ''}"
            with progress(f"from {host}", sum(sizes.values())) as advance:
                logs.fetch(vehicle, folder, sizes, out, tell, advance)
    except logs.RemoteError as error:
        failure = f"{error}{'; fetch again, it goes on where it was' if error.lost else ''}"
    if failure:
        say(f"glider: {failure}")
    if as_json:
        print_json({"out": str(out), "logs": [vars(one) for one in done], "message": failure})
    raise SystemExit(FAILED if failure or any(one.became == "refused" for one in done) else DONE)
