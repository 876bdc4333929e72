"""`glider gap`: where simulation and sea disagree."""

import sys
from pathlib import Path
from typing import Any

import click

from glider.tools.cli.challenge import challenge
from glider.tools.cli.common import (
    compile_diagnosis,
    json_option,
    print_json,
    progress,
    say,
    say_assumed,
    vehicle_option,
)
from glider.tools.cli import own
from glider.tools.cli.many import cases_argument, is_many, run_batch_command
from glider.tools.cli.readings import readings
from glider.tools.cli.watch import watch

CAUSES, LEAST = 4, 0.01  # shown of a diagnosis at most; the probability of one that is shown
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
    report is written too, to <case>-gap.html in the working directory unless --report names a file.
    """
    if (theirs := own.own_vehicle(case, vehicle)) is not None:
        own.measure(theirs, case, as_json)
        return
    from glider.sim_backend.ocean.vehicle import OceanVehicle
    from glider.tools.data.errors import need
    from glider.tools.data.files import check_writable
    from glider.tools.data.runs.case import load_case
    from glider.tools.gap.assess import assess

    need("analysis")
    from glider.tools.readings.check import disagreement

    loaded = load_case(case, vehicle)
    say_assumed(loaded.vehicle_name, loaded.assumed)
    if report is None and not as_json:
        report = Path(f"{case.resolve().name}-gap.html")
    if report is not None:
        check_writable(report.parent)
    for text in [] if isinstance(loaded.vehicle, OceanVehicle) else disagreement(loaded.runs):
        say(f"note: {text}")
    compile_diagnosis(loaded)
    with progress("gap", 3) as advance:
        advance(1)
        found = assess(loaded)
        advance(1)
        if report is not None:
            from glider.tools.report.gap import write_report

            write_report(report, found)
        advance(1)
    if as_json:
        print_json(found.plain())
    else:
        _print_table(found)
    if report is not None:
        say(f"report: {report}")


def _print_table(found) -> None:
    """Runs by channels, then the parts, on standard output."""
    from glider.tools.data.runs.origin import flights_of, with_flight

    names, flights = list(found.channels), flights_of(found.case.runs)
    width = max(8, *(len(name) + 2 for name in names))
    runs = {run.name: with_flight(run.name, flights) for run in found.runs}
    first = max(8, *(len(shown) + 2 for shown in runs.values()))

    def line(head: str, cells: list[str]) -> None:
        click.echo(head.ljust(first) + "".join(cell.rjust(width) for cell in cells))

    line("", [*names, "total"])
    for run in found.runs:
        cells = [f"{run.channels[name]:.2f}" if name in run.channels else "-" for name in names]
        line(runs[run.name], [*cells, f"{run.total:.2f}"])
    line("all", [*(f"{found.channels[name]:.2f}" for name in names), f"{found.total:.2f}"])
    click.echo("\nshare of the squared gap")
    for share in found.where:
        name = share.subsystem if share.subsystem == share.element else f"{share.subsystem} {share.element}"
        click.echo(f"  {100.0 * share.share:5.1f} %  {name}")


@gap.command()
@click.argument("run", type=click.Path(path_type=Path))
@click.option("--model", default="nominal", show_default=True, help="`nominal`, a shipped vehicle or a vehicle file.")
@click.option("--out", required=True, type=click.Path(path_type=Path, dir_okay=False), help="Predicted run (CSV).")
@vehicle_option
def predict(run: Path, model: str, out: Path, vehicle: str | None) -> None:
    """Predict RUN (a run file beside its case.toml): its rows and columns, no gaps, window by window."""
    from glider.tools.data.errors import InputError
    from glider.tools.data.files import check_writable
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
    help="Leave one idea of the diagnosis out, to see what it is worth (docs/DIAGNOSIS.md).",
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
    vehicle that `glider identify` made of them by --vehicle.

    Several cases, or one with --jobs, --dask or --again, have their answers in folders of DIR that are called as they
    are; those that are answered are kept.
    """
    if is_many(cases, jobs, dask, again):
        from glider.tools.study.many_cases import OneCommand

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
    from glider.sim_backend.ocean.vehicle import OceanVehicle
    from glider.tools.data.errors import InputError, need
    from glider.tools.data.files import check_writable
    from glider.tools.data.runs.case import load_case
    from glider.tools.diagnose.against_healthy import form_stands_out
    from glider.tools.diagnose.diagnosis import diagnose as run_diagnosis
    from glider.tools.diagnose.diagnosis import plain, write
    from glider.tools.inference.rules import Rules
    from glider.tools.report.diagnosis import write_report
    from glider.tools.report.words import sentence

    need("analysis")
    if (theirs := own.own_vehicle(case, vehicle)) is not None:
        check_writable(out)
        own.diagnose(theirs, case, reference, out, as_json)
        return
    loaded = load_case(case, vehicle)
    check_writable(out)
    if isinstance(loaded.vehicle, OceanVehicle):
        if reference is not None:
            raise InputError("what changed of an ocean glider asks `glider gap watch --reference CASE0`", source=case)
        _diagnose_ocean(loaded, out, as_json)
        return
    say_assumed(loaded.vehicle_name, loaded.assumed)
    compile_diagnosis(loaded)
    if reference is not None or (without is None and form_stands_out(loaded)):
        _diagnose_against(loaded, None if reference is None else load_case(reference, vehicle), out, as_json)
        return
    done = 0
    with progress("diagnose", STEPS) as advance:

        def step(text: str) -> None:
            nonlocal done
            print(text, file=sys.stderr)  # not by click, which would write past the bar into its line
            if done < STEPS - 2:
                done += 1
                advance(1)

        found = run_diagnosis(loaded, step, Rules() if without is None else Rules().without(without))
        advance(STEPS - 1 - done)
        write(found, out)
        record = write_report(out)
        advance(1)
    _print_answer(plain(found), sentence(record), out, as_json)


def _diagnose_against(case, reference, out: Path, as_json: bool) -> None:
    """The same against healthy runs (docs/DIAGNOSIS.md, Against healthy runs)."""
    from glider.tools.diagnose.against_answer import write
    from glider.tools.diagnose.against_healthy import diagnose_against_healthy
    from glider.tools.report.pooled import write_pooled_report

    found = diagnose_against_healthy(case, reference, lambda text: print(text, file=sys.stderr))
    answer = write(found, out)
    _print_answer(answer, write_pooled_report(out), out, as_json)


def _diagnose_ocean(case, out: Path, as_json: bool) -> None:
    """The same of an ocean glider (docs/OCEAN.md, Diagnosis)."""
    from glider.tools.report.pooled import write_pooled_report
    from glider.tools.watch.whole_case import diagnose_ocean, plain, write

    found = diagnose_ocean(case, lambda text: print(text, file=sys.stderr))
    write(found, out)
    _print_answer(plain(found), write_pooled_report(out), out, as_json)


def _print_answer(answer: dict[str, Any], sentence: str, out: Path, as_json: bool) -> None:
    """Print the verdict on standard output, or the answer alone as JSON; what limits it on standard error."""
    from glider.tools.report.page import REPORT

    for caution in answer["cautions"]:
        say(f"note: {caution}")
    if as_json:
        print_json(answer)
    else:
        for line in (sentence, *_verdict(answer)):
            click.echo(line)
    say(f"answer: {out / 'diagnosis.json'}, report: {out / REPORT}")


def _verdict(answer: dict[str, Any]) -> list[str]:
    """The verdict, causes with their probabilities and groups, and the gap, a line each."""
    lines = [f"verdict: {answer['verdict']}{''.join(f', {label}' for label in answer['selected'])}"]
    for n, cause in enumerate(answer["causes"][:CAUSES]):
        if n == 0 or cause["probability"] >= LEAST:
            others = [label for label in cause["group"] if label != cause["label"]]
            confounded = f"  or {', '.join(others)}, which these data cannot distinguish" if others else ""
            lines.append(f"  {cause['probability']:.2f}  {cause['label']}{confounded}")
    totals = {name: answer["gap"][name]["total"] for name in ("before", "recalibrated", "after", "floor")}
    gaps = ", ".join(f"{name} {value:.2f}" for name, value in totals.items() if value is not None)
    return [*lines, f"gap in tolerances: {gaps}"]


@gap.command()
@click.argument("case", type=click.Path(path_type=Path))
@click.option("--model", default="nominal", show_default=True, help="`nominal`, a shipped vehicle or a vehicle file.")
@click.option("--out", required=True, type=click.Path(path_type=Path, file_okay=False), help="Folder of the CSV files.")
@json_option
def velocity(case: Path, model: str, out: Path, as_json: bool) -> None:
    """Velocity through the water of an ocean glider, with its standard deviation: a CSV for each run of CASE."""
    from glider.tools.data.files import check_writable
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
    if as_json:
        print_json({"files": [str(path) for path in files], "heading": heading})
    else:
        for path in files:
            click.echo(path)


@gap.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
def report(folder: Path) -> None:
    """Draw report.html again from what `glider gap diagnose` or `glider gap watch` left in DIR; print its verdict."""
    import json

    from glider.tools.data.errors import need
    from glider.tools.diagnose.record import ANSWER, is_pooled
    from glider.tools.report.diagnosis import write_report
    from glider.tools.report.page import REPORT
    from glider.tools.report.pooled import write_pooled_report
    from glider.tools.report.watch import write_watch_report
    from glider.tools.report.words import sentence
    from glider.tools.watch.answer import FILE

    need("analysis")
    if (folder / FILE).is_file():
        said = write_watch_report(folder)
    else:
        said = write_pooled_report(folder) if is_pooled(folder) else sentence(write_report(folder))
    click.echo(said)
    if not (folder / FILE).is_file():
        for line in _verdict(json.loads((folder / ANSWER).read_text(encoding="utf-8"))):
            click.echo(line)
    say(f"report: {folder / REPORT}")


gap.add_command(challenge)
gap.add_command(readings)
gap.add_command(watch)
