"""`glider gap watch`: what is different since when."""

import sys
from dataclasses import replace
from pathlib import Path

import click

from glider.tools.cli import own
from glider.tools.cli.common import json_option, print_json, progress, say, say_assumed, vehicle_option
from glider.tools.cli.many import cases_argument, is_many, run_batch_command

folder = click.Path(path_type=Path, file_okay=False)


@click.command()
@cases_argument
@click.option("--reference", type=folder, metavar="CASE0", help="Runs of the same vehicle before anything changed.")
@vehicle_option
@click.option("--out", type=folder, help="Folder of the answer; needed with several cases.")
@json_option
def watch(
    cases: tuple[Path, ...], jobs: int | None, dask: str | None, again: bool, reference: Path | None,
    vehicle: str | None, out: Path | None, as_json: bool,
) -> None:  # fmt: skip
    """What changed over the runs of CASE, in their order: in which run, from when to when, why, and how much.

    What all runs share, a model that is not quite right or a sensor that is a little off, is no change: it is learned
    from the reference, or without one from the first runs (docs/WATCH.md).

    Each of several cases is watched by itself. Their answers, or that of one with --jobs, --dask or --again, are in
    folders of DIR that are called as the cases are; those that are answered are kept.
    """
    if is_many(cases, jobs, dask, again):
        from glider.tools.study.many_cases import OneCommand

        asked = OneCommand(("gap", "watch"), "watch.json", vehicle=vehicle, reference=reference)
        run_batch_command(cases, out, asked, jobs, dask, again, as_json)
        return
    _watch_one(cases[0], reference, vehicle, out, as_json)


def _watch_one(case: Path, reference: Path | None, vehicle: str | None, out: Path | None, as_json: bool) -> None:
    """The watch of one case; its answer in `out`, if there is one."""
    from glider.tools.data.errors import need

    need("analysis")
    from glider.tools.data.files import check_writable, write_bytes
    from glider.tools.data.runs.case import load_case
    from glider.tools.data.runs.origin import flights_of
    from glider.tools.report.page import REPORT
    from glider.tools.report.watch import write_watch_report
    from glider.tools.watch.answer import FILE
    from glider.tools.watch.watch import watch as watch_runs

    if (theirs := own.own_vehicle(case, vehicle)) is not None:
        if out is not None:
            check_writable(out)
        own.watch(theirs, case, reference, out, as_json)
        return
    loaded = load_case(case, vehicle)
    say_assumed(loaded.vehicle_name, loaded.assumed)
    before = None if reference is None else load_case(reference, vehicle)
    if out is not None:
        check_writable(out)
    with progress("watch", 2) as advance:
        advance(1)
        found = watch_runs(loaded, before, lambda text: print(text, file=sys.stderr))
        found = replace(found, flights=flights_of(loaded.runs))
        advance(1)
    if out is not None:
        import json

        from glider.tools.data.plain import as_plain

        out.mkdir(parents=True, exist_ok=True)
        write_bytes(out / FILE, (json.dumps(as_plain(found.plain()), indent=1) + "\n").encode())
        write_watch_report(out)
    for caution in found.cautions:
        say(f"note: {caution}")
    if as_json:
        print_json(found.plain())
    else:
        for line in lines(found):
            click.echo(line)
    if out is not None:
        say(f"answer: {out / FILE}, report: {out / REPORT}")


def lines(found) -> list[str]:
    """The answer for a terminal: runs, then events."""
    from glider.tools.data.runs.origin import with_flight

    sentences = []
    names = {run.run: with_flight(run.run, found.flights) for run in found.runs}
    width = max(map(len, names.values()), default=0)
    for run in found.runs:
        name = names[run.run].ljust(max(width, 12))
        if run.skipped is not None:
            sentences.append(f"{name} skipped  {run.skipped}")
            continue
        causes = ", ".join(f"{cause.label} {_size(cause.sized)}" for cause in run.causes[:2])
        gap = "-" if run.gap is None else f"{run.gap:.2f}"
        sentences.append(f"{name} {run.verdict:8} gap {gap:>6}  {causes}".rstrip())
    sentences.append("")
    if not found.events:
        sentences.append("nothing changed, as far as these runs can show")
    for event in found.events:
        until = "and is still there" if event.to_run is None else f"to {names.get(event.to_run, event.to_run)}"
        place = f"{event.where[0]['subsystem']} {event.where[0]['element']}" if event.where else ""
        name = event.label or f"unknown ({place})"
        others = [label for label in event.group if label != event.label]
        confounded = f"; may as well be {', '.join(others)}" if others else ""
        size = _size(event.sized)
        since = names.get(event.from_run, event.from_run)
        sentences.append(f"{name} {size} from {since} {until}, {event.course}, {event.probability:.2f}{confounded}")
    return sentences


def _size(sized) -> str:
    if sized.size is None or sized.ci90 is None:
        return ""
    low, high = sized.ci90
    unit = "" if sized.unit in ("1", None) else f" {sized.unit}"
    return f"{sized.size:.3g}{unit} ({low:.3g} to {high:.3g})"
