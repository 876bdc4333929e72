"""`glider gap`: where simulation and sea disagree."""

import sys
from pathlib import Path

import click

from glider.tools.cli import own
from glider.tools.cli.common import (
    compile_diagnosis,
    json_option,
    print_lines,
    print_result,
    progress,
    say,
    say_assumed,
    vehicle_option,
)
from glider.tools.cli.compare import compare
from glider.tools.cli.isolability import isolability
from glider.tools.cli.many import cases_argument, is_many, run_batch_command
from glider.tools.cli.readings import readings
from glider.tools.cli.watch import watch
from glider.tools.data.errors import InputError, need
from glider.tools.data.files import check_writable

STEPS = 7  # of a diagnosis: screen, up to three effects, verdict, how far, report


@click.group()
def gap():
    """Measure and predict: where simulation and sea disagree."""


@gap.command()
@click.argument("case", type=click.Path(path_type=Path))
@click.option("--report", type=click.Path(path_type=Path, dir_okay=False), help="Where the report (HTML) goes.")
@vehicle_option
@json_option
def measure(case: Path, report: Path | None, vehicle: str | None, as_json: bool) -> None:
    """The gap of CASE per run and channel, and how it is spread over the parts of the model.

    Gaps are root mean square errors in tolerances: at 1 the simulator is off by as much as may be. Without --json a
    report is written too, to <case>-gap.html in the working directory unless --report names a file; of a model of one's
    own there is none.
    """
    if (theirs := own.own_vehicle(case, vehicle)) is not None:
        own.measure(theirs, case, as_json)
        return
    from glider.tools import api
    from glider.tools.data.runs.case import load_case
    from glider.tools.data.vehicle_kinds import kind_of

    need("analysis")

    loaded = load_case(case, vehicle)
    say_assumed(loaded.vehicle_name, loaded.assumed)
    if report is None and not as_json:
        report = Path(f"{case.resolve().name}-gap.html")
    if report is not None:
        check_writable(report.parent)
    for text in kind_of(loaded.vehicle).disagreements(loaded):
        say(f"note: {text}")
    compile_diagnosis(loaded)
    with progress("gap", 3) as advance:
        advance(1)
        found = api.measure_gap(loaded)
        advance(1)
        if report is not None:
            found.save(report)
        advance(1)
    print_result(found, as_json)
    if report is not None:
        say(f"report: {report}")


@gap.command()
@click.argument("run", type=click.Path(path_type=Path))
@click.option("--model", default="nominal", show_default=True, help="`nominal`, a shipped vehicle or a vehicle file.")
@click.option("--out", required=True, type=click.Path(path_type=Path, dir_okay=False), help="Predicted run (CSV).")
@vehicle_option
def predict(run: Path, model: str, out: Path, vehicle: str | None) -> None:
    """Predict RUN (a run file beside its case.toml): its rows and columns, no gaps, window by window."""
    from glider.tools.data.runs.case import load_case_of_run
    from glider.tools.data.runs.run import write_run
    from glider.tools.inference.kinds import kind_of
    from glider.tools.inference.load import load_model
    from glider.tools.inference.predict import as_run
    from glider.tools.inference.predict import predict as predict_runs

    if (theirs := own.own_vehicle(run, vehicle if model == "nominal" else model)) is not None:
        check_writable(out.parent)
        own.predict(theirs, run, out)
        return
    case, recorded = load_case_of_run(run, vehicle)
    say_assumed(case.vehicle_name, case.assumed)
    if out.exists() and run.exists() and out.samefile(run):
        raise InputError("would overwrite the run itself: name another file", source=out, column="--out")
    check_writable(out.parent)
    predicted = predict_runs(case, load_model(model, case), [recorded])[0]
    write_run(out, as_run(recorded, predicted, kind_of(case.vehicle)))
    say(f"predicted {recorded.rows} rows of {recorded.name} with {model}: {out}")


@gap.command()
@cases_argument
@click.option("--out", required=True, type=click.Path(path_type=Path, file_okay=False), help="Folder of the answer.")
@click.option(
    "--without", type=click.Choice(["nuisance", "splice", "whiteness", "evidence"]),
    help="Leave one idea of the diagnosis out, to see what it is worth (docs/explanation/diagnosis.md).",
)  # fmt: skip
@click.option(
    "--reference", type=click.Path(path_type=Path, file_okay=False), metavar="CASE0",
    help="Healthy runs of the same vehicle: what its model leaves there is no cause.",
)  # fmt: skip
@vehicle_option
@json_option
def diagnose(
    cases: tuple[Path, ...], jobs: int | None, dask: str | None, again: bool, out: Path, without: str | None,
    reference: Path | None, vehicle: str | None, as_json: bool,
) -> None:  # fmt: skip
    """Where the simulator is wrong about CASE, which effect causes it, and how far the gap shrinks with it.

    With --reference the runs are held against healthy ones of the same vehicle, which no model flies exactly: give the
    vehicle that `glider identify` made of them by --vehicle. A model of one's own needs that vehicle alone.

    Several cases, or one with --jobs, --dask or --again, have their answers in folders of DIR that are called as they
    are; those that are answered are kept.
    """
    if is_many(cases, jobs, dask, again):
        from glider.tools.cli.many_cases import OneCommand

        options = [] if without is None else ["--without", without]
        asked = OneCommand(("gap", "diagnose"), "diagnosis.json", options, vehicle, reference)
        run_batch_command(cases, out, asked, jobs, dask, again, as_json)
        return
    if reference is not None and without is not None:
        raise click.UsageError("--without is of a diagnosis without a --reference")
    _diagnose_one(cases[0], reference, out, without, vehicle, as_json)


def _diagnose_one(
    case: Path, reference: Path | None, out: Path, without: str | None, vehicle: str | None, as_json: bool
) -> None:
    """The diagnosis of one case, in `out`."""
    from glider.tools import api
    from glider.tools.data.runs.case import load_case
    from glider.tools.report.page import REPORT

    need("analysis")
    if (theirs := own.own_vehicle(case, vehicle)) is not None:
        check_writable(out)
        own.diagnose(theirs, case, reference, out, as_json)
        return
    loaded = load_case(case, vehicle)
    check_writable(out)
    say_assumed(loaded.vehicle_name, loaded.assumed)
    compile_diagnosis(loaded)
    healthy, done = None if reference is None else load_case(reference, vehicle), 0
    with progress("diagnose", STEPS) as advance:

        def step(text: str) -> None:
            nonlocal done
            print(text, file=sys.stderr)  # not by click, which would write past the bar into its line
            if done < STEPS - 2:
                done += 1
                advance(1)

        found = api.diagnose(loaded, reference=healthy, without=without, progress=step)
        advance(STEPS - 1 - done)
        found.save(out)
        advance(1)
    for caution in found.cautions:
        say(f"note: {caution}")
    print_result(found, as_json)
    say(f"answer: {out / 'diagnosis.json'}, report: {out / REPORT}")


@gap.command()
@click.argument("case", type=click.Path(path_type=Path))
@click.option("--model", default="nominal", show_default=True, help="`nominal`, a shipped vehicle or a vehicle file.")
@click.option("--out", required=True, type=click.Path(path_type=Path, file_okay=False), help="Folder of the CSV files.")
@json_option
def velocity(case: Path, model: str, out: Path, as_json: bool) -> None:
    """Velocity through the water of an ocean glider, with its standard deviation: a CSV for each run of CASE."""
    from glider.tools.data.runs.case import load_case
    from glider.tools.gap.heading import heading_test
    from glider.tools.gap.velocity import velocities, write
    from glider.tools.inference.load import load_model

    loaded = load_case(case, None if model == "nominal" else model)
    check_writable(out)
    found = velocities(loaded, load_model("nominal", loaded))
    speeds = [(one.columns["vn_m_s"], one.columns["ve_m_s"]) for one in found]
    heading = heading_test(loaded.folder, loaded.runs, speeds)
    files = write(found, out, heading)
    say(f"heading: {heading.get('says') or heading['why']}")
    print_lines(files, as_json, {"files": [str(path) for path in files], "heading": heading})


@gap.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option(
    "--foxglove", type=click.Path(path_type=Path, file_okay=False), metavar="OUT",
    help="Write the drawn runs as MCAP (measured, nominal, corrected pose) and Foxglove's layout into OUT, and stop.",
)  # fmt: skip
def report(folder: Path, foxglove: Path | None) -> None:
    """Draw report.html again from what `glider gap diagnose` or `glider gap watch` left in DIR; print its verdict."""
    if foxglove is not None:
        _replay(folder, foxglove)
        return
    import json

    from glider.tools.api.sentences import verdict_lines
    from glider.tools.diagnose.record import ANSWER, QuestionRecord, is_pooled, read_as
    from glider.tools.own.diagnose import KIND as OWN
    from glider.tools.report.diagnosis import write_report
    from glider.tools.report.own import write_own_report
    from glider.tools.report.page import REPORT
    from glider.tools.report.pooled import write_pooled_report
    from glider.tools.report.watch import write_watch_report
    from glider.tools.report.words import sentence
    from glider.tools.watch.answer import FILE

    need("analysis")
    if (folder / FILE).is_file():
        said = write_watch_report(folder)
    elif (folder / ANSWER).is_file() and read_as(folder / ANSWER, QuestionRecord).kind == OWN:
        said = write_own_report(folder)
    else:
        said = write_pooled_report(folder) if is_pooled(folder) else sentence(write_report(folder))
    click.echo(said)
    if not (folder / FILE).is_file():
        for line in verdict_lines(json.loads((folder / ANSWER).read_text(encoding="utf-8"))):
            click.echo(line)
    say(f"report: {folder / REPORT}")


def _replay(folder: Path, out: Path) -> None:
    """The drawn runs of a diagnosis for Foxglove."""
    from glider.tools.report.foxglove import write_foxglove

    need("live")
    check_writable(out)
    for path in write_foxglove(folder, out):
        click.echo(path)


gap.add_command(compare)
gap.add_command(isolability)
gap.add_command(readings)
gap.add_command(watch)
