"""`glider log`: look into, export or repair an onboard log."""

from pathlib import Path
from typing import Any

import click

from tools.cli.common import DONE, FAILED, json_option, print_json, say

LEVELS = {10: "debug", 20: "info", 30: "warn", 40: "error", 50: "fatal"}
_SHOWN_EVENTS = 20


@click.group()
def log() -> None:
    """Export, look into or repair an onboard log."""


def _show(line: str) -> None:
    """A line that holds what a file says: nothing in it steers the terminal."""
    click.echo("".join(letter if letter.isprintable() else "\ufffd" for letter in line))


def _file(path: Path) -> Path:
    from tools.errors import InputError

    if path.is_dir():
        raise InputError("a folder, where a log was expected", source=path)
    return path


def _state(the_log: Any) -> str:
    """Complete or cut, in words."""
    if the_log.whole:
        return "complete"
    parts = ["complete" if the_log.complete else f"cut at byte {the_log.end} of {the_log.size}"]
    parts += [f"damaged at byte {item.offset}, {item.length} bytes: {item.what}" for item in the_log.damages]
    return "; ".join(parts)


def _summary(the_log: Any) -> dict[str, Any]:
    return {
        "file": str(the_log.path),
        "bytes": the_log.size,
        "complete": the_log.complete,
        "read_to": the_log.end,
        "damaged": [vars(item) for item in the_log.damages],
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
    }


@log.command()
@click.argument("file", type=click.Path(path_type=Path))
@json_option
def info(file: Path, as_json: bool) -> None:
    """What is in a log: topics, counts, texts, events, and whether it is complete."""
    from tools.log.reader import read_log

    the_log = read_log(_file(file))
    if as_json:
        print_json(_summary(the_log))
        return
    _show(f"{file}: {_state(the_log)}; {the_log.duration_s:.2f} s")
    for name, topic in the_log.topics.items():
        missing = f", {topic.missing} missing" if topic.missing else ""
        _show(f"  {name:<10} {topic.count} records{missing} ({topic.schema_name}, {len(topic.fields)} numbers)")
    for name, text in the_log.attachments.items():
        _show(f"  {name:<20} {len(text.encode())} bytes")
    for name, text in {**the_log.metadata, **the_log.ending}.items():
        _show(f"  {name:<20} {text}")
    for event in the_log.events[:_SHOWN_EVENTS]:
        _show(f"  {event.time_s:9.2f} s  {LEVELS.get(event.severity, event.severity):<5} {event.text}")
    if len(the_log.events) > _SHOWN_EVENTS:
        _show(f"  and {len(the_log.events) - _SHOWN_EVENTS} more events (--json has them all)")


@log.command()
@click.argument("source", metavar="FILE", type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), help="Folder for the case; for run data, the log to write.")
@click.option("--vehicle", help="Vehicle file or name, in place of the log's own.")
@json_option
def export(source: Path, out: Path | None, vehicle: str | None, as_json: bool) -> None:
    """Turn a log into run data (a case folder), or run data (a case's folder or run file) into a log."""
    if source.is_dir() or source.name.endswith((".csv", ".csv.gz")):
        files = _to_logs(source, out)
        result = {"files": [str(path) for path in files], "notes": []}
    else:
        result = _to_case(source, out, vehicle)
    for note in result["notes"]:
        say(note)
    if as_json:
        print_json(result)
    else:
        for path in result["files"]:
            click.echo(path)


def _to_case(source: Path, out: Path | None, vehicle: str | None) -> dict[str, Any]:
    from tools.log.reader import read_log
    from tools.log.rundata import export_case

    the_log = read_log(source)
    folder = _case_beside(source) if out is None else out
    exported = export_case(the_log, folder, vehicle=vehicle)
    notes = list(exported.notes) if the_log.whole else [_state(the_log), *exported.notes]
    return {
        "case": str(folder),
        "files": [str(path) for path in exported.files],
        "rows": exported.run.rows,
        "notes": notes,
    }


def _case_beside(source: Path) -> Path:
    name = source.name.removesuffix(".mcap")
    return source.with_name(f"{name}.case" if name == source.name else name)


def _to_logs(source: Path, out: Path | None) -> list[Path]:
    """One log a run: --out names it, or for several runs the folder that takes them; else beside the run."""
    from tools.log.rundata import write_log
    from tools.runs.case import load_case, load_case_of_run

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
    """Write what can be trusted of a cut or damaged log as a complete one; the original stays."""
    from tools.log.repair import repair as repair_log

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
        click.echo(report.out)
    raise SystemExit(DONE if report.out is None or report.messages else FAILED)
