"""`glider gap watch`: what is different since when."""

import sys
from pathlib import Path

import click

from glider.tools.cli import own
from glider.tools.cli.common import json_option, print_result, progress, say, say_assumed, vehicle_option
from glider.tools.cli.many import cases_argument, is_many, run_batch_command
from glider.tools.data.errors import need
from glider.tools.data.files import check_writable

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
    from the reference, or without one from the first runs (docs/explanation/watch.md).

    Each of several cases is watched by itself. Their answers, or that of one with --jobs, --dask or --again, are in
    folders of DIR that are called as the cases are; those that are answered are kept.
    """
    if is_many(cases, jobs, dask, again):
        from glider.tools.cli.many_cases import OneCommand

        asked = OneCommand(("gap", "watch"), "watch.json", vehicle=vehicle, reference=reference)
        run_batch_command(cases, out, asked, jobs, dask, again, as_json)
        return
    _watch_one(cases[0], reference, vehicle, out, as_json)


def _watch_one(case: Path, reference: Path | None, vehicle: str | None, out: Path | None, as_json: bool) -> None:
    """The watch of one case; its answer in `out`, if there is one."""
    from glider.tools import api
    from glider.tools.data.runs.case import load_case
    from glider.tools.report.page import REPORT
    from glider.tools.watch.answer import FILE

    need("analysis")
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
        found = api.watch(loaded, reference=before, progress=lambda text: print(text, file=sys.stderr))
        advance(1)
    if out is not None:
        found.save(out)
    for caution in found.cautions:
        say(f"note: {caution}")
    print_result(found, as_json)
    if out is not None:
        say(f"answer: {out / FILE}, report: {out / REPORT}")
