"""`glider gap challenge`: a blind test of the diagnosis, made, run and scored."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from glider.tools.cli.common import fail, json_option, print_json, progress, say
from glider.tools.cli.many import again_option, dask_option, jobs_option, need_for
from glider.tools.data.errors import InputError, need
from glider.tools.data.files import check_writable, write_bytes

folder = click.Path(path_type=Path, file_okay=False)
COUNT = click.IntRange(0, 1000)


@click.group()
def challenge():
    """A blind test: sealed cases with unknown effects, and the score of answers to them."""


@challenge.command()
@click.option("--out", required=True, type=folder, help="Folder for cases, held, answers.zip and manifest.json.")
@click.option("--seed", required=True, type=click.IntRange(0, 2**63 - 1), help="All cases follow from it.")
@click.option("--messy", is_flag=True, help="Beside the effect four small ones; noise that is not what the file says.")
@click.option("--single", type=COUNT, help="Cases with one effect: 100.")
@click.option("--none", "none", type=COUNT, help="Without a gap: 60; messy, without a large effect: 20.")
@click.option("--pairs", type=COUNT, help="With two effects: 30; messy: 0.")
@click.option("--unknown", type=COUNT, help="Outside the catalogue: 30; messy: 20.")
@click.option("--answers", type=click.Path(path_type=Path, dir_okay=False), help="Where the sealed answers go.")
@click.option("--jobs", default=0, type=click.IntRange(0, 256), help="Processes; one a core by default.")
@click.option("--watch", is_flag=True, help="A blind test of `gap watch`: vehicles, of which some change.")
@click.option("--ocean", is_flag=True, help="With --watch: missions of ocean gliders, runs being dives.")
@click.option("--form", is_flag=True, help="Vehicles of another form than equation (4), identified before they change.")
@click.option("--changed", type=COUNT, help="With --form: vehicles changed by something of the catalogue: 30.")
@click.option("--outside", type=COUNT, help="With --form: by something outside the catalogue: 10.")
@click.option("--vehicles", type=click.IntRange(1, 1000), help="With --watch: 40; missions 60.")
@click.option("--unchanged", type=click.IntRange(0, 1000), help="Of the vehicles: 10; missions 12; --form 20.")
@click.option("--runs", type=click.IntRange(4, 200), help="Of each vehicle: 14; dives 40.")
@click.option("--reference", type=click.IntRange(1, 100), help="Of the runs, the first: 5; dives 12; --form 12.")
def make(
    out: Path, seed: int, messy: bool, single: int | None, none: int | None, pairs: int | None, unknown: int | None,
    answers: Path | None, jobs: int,
    watch: bool, ocean: bool, form: bool, changed: int | None, outside: int | None, vehicles: int | None,
    unchanged: int | None, runs: int | None, reference: int | None,
) -> None:  # fmt: skip
    """Draw, fly and seal a blind test. Cases that are there are kept: call again to go on after a stop."""
    from glider.tools.verify.challenge.make import Order
    from glider.tools.verify.challenge.make import make as make_all
    from glider.tools.verify.challenge.ocean_make import OceanOrder
    from glider.tools.verify.challenge.ocean_plan import MISSIONS
    from glider.tools.verify.challenge.plan import MESSY, Counts
    from glider.tools.verify.challenge.seal import ARCHIVE, MANIFEST, read_manifest
    from glider.tools.verify.challenge.watch_make import WatchOrder
    from glider.tools.verify.challenge.watch_plan import LEAST_WATCHED, WatchCounts

    _check_kind(watch, ocean, form)
    check_writable(out)
    if form:
        from glider.tools.verify.challenge.form_make import FormOrder
        from glider.tools.verify.challenge.form_plan import FormCounts

        asked = {"changed": changed, "unchanged": unchanged, "outside": outside, "reference": reference}
        formed = replace(FormCounts(), **_given(asked))
        if not formed.total:
            raise click.UsageError("no cases: all counts are 0")
        order: Order = FormOrder(out, seed, formed, answers or out / ARCHIVE)
        total = formed.total
    elif watch:
        asked = {"vehicles": vehicles, "unchanged": unchanged, "runs": runs, "reference": reference}
        watched = replace(MISSIONS if ocean else WatchCounts(), **_given(asked))
        if watched.unchanged > watched.vehicles or watched.judged < LEAST_WATCHED:
            few = f"--unchanged at most --vehicles, and {LEAST_WATCHED} runs at least behind the reference"
            raise click.UsageError(few)
        order = (OceanOrder if ocean else WatchOrder)(out, seed, watched, answers or out / ARCHIVE)
        total = watched.vehicles
    else:
        asked = {"single": single, "none": none, "pairs": pairs, "unknown": unknown}
        counts = replace(MESSY if messy else Counts(), **_given(asked))
        total = counts.total
        if not total:
            raise click.UsageError("no cases: all counts are 0")
        order = Order(out, seed, counts, answers or out / ARCHIVE, messy)
    with progress("cases", total) as advance:
        made, wrong = make_all(order, jobs, advance)
    if wrong:
        fail("\n".join([*wrong, "nothing sealed: take another seed, or other counts"]))
    say(f"{made} cases made, {total - made} were there: {out}")
    say(f"SHA-256 of {order.archive}: {read_manifest(out / MANIFEST)['answers']['sha256']}")


def _check_kind(watch: bool, ocean: bool, form: bool) -> None:
    if ocean and not watch:
        raise click.UsageError("--ocean goes with --watch")
    if form and watch:
        raise click.UsageError("--form or --watch, not both")


def _given(asked: dict[str, int | None]) -> dict[str, int]:
    return {name: count for name, count in asked.items() if count is not None}


@challenge.command()
@click.option("--cases", required=True, type=folder, help="A blind test's folder, or a folder of cases.")
@click.option("--out", required=True, type=folder, help="Where the diagnoses go, one folder a case.")
@click.option("--only", multiple=True, metavar="CASE", help="This case only; may be given again.")
@jobs_option
@dask_option
@again_option
@click.option("--watch", is_flag=True, help="`glider gap watch` on every vehicle, with its reference.")
@click.option("--ocean", is_flag=True, help="With --watch: `glider identify` on the reference first; velocity last.")
@click.option(
    "--form", is_flag=True, help="`glider identify` on the healthy runs first, then diagnose with that vehicle."
)
@click.argument("extra", nargs=-1, type=click.UNPROCESSED)
def run(
    cases: Path, out: Path, only: tuple[str, ...], jobs: int | None, dask: str | None, again: bool, watch: bool,
    ocean: bool, form: bool, extra: tuple[str, ...],
) -> None:  # fmt: skip
    """Run `glider gap diagnose` on every case; those that have a diagnosis are kept.

    What stands after `--` is handed on to `gap diagnose`. A case's time counts its whole process.
    """
    from glider.tools.verify.challenge.diagnose_all import DIAGNOSIS, FORM, MISSION, WATCH, count_cases
    from glider.tools.verify.challenge.diagnose_all import run as run_all

    need_for(jobs, dask)
    check_writable(out)
    _check_kind(watch, ocean, form)
    kind = (MISSION if ocean else WATCH) if watch else FORM if form else DIAGNOSIS
    with progress("diagnosed", len(set(only)) or count_cases(cases)) as advance:
        done, wrong = run_all(cases, out, extra, 1 if jobs is None else jobs, advance, only, kind, dask, again)
    say(f"{done} diagnosed: {out}")
    if wrong:
        fail("\n".join(wrong))


@challenge.command()
@click.option("--cases", required=True, type=folder, help="The blind test's folder, or its folder of cases.")
@click.option("--answers", required=True, type=click.Path(path_type=Path), help="answers.zip, or a folder of *.json.")
@click.option("--diagnoses", required=True, type=folder, help="Folder of <case>/diagnosis.json.")
@click.option("--manifest", type=click.Path(path_type=Path, dir_okay=False), help="As published; else the one there.")
@click.option("--partial", is_flag=True, help="Score answered cases only; else a case without an answer is wrong.")
@click.option("--no-closed", is_flag=True, help="Do not fly the corrected models on the held runs.")
@click.option("--watch", is_flag=True, help="The answers are those of `gap watch`: <case>/watch.json.")
@click.option("--ocean", is_flag=True, help="With --watch: of missions; their velocity is scored too.")
@click.option("--form", is_flag=True, help="Of vehicles of another form: their identified vehicles are scored too.")
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="Write the result for docs/results.")
@click.option("--commit", help="With --out: the commit that answered.  [default: as the answers name it]")
@json_option
def score(
    cases: Path, answers: Path, diagnoses: Path, manifest: Path | None, partial: bool, no_closed: bool, watch: bool,
    ocean: bool, form: bool, out: Path | None, commit: str | None, as_json: bool,
) -> None:  # fmt: skip
    """Open the sealed answers, check them against the manifest, and score the diagnoses.

    See docs/explanation/blind-tests.md.
    """
    from glider.tools.verify.challenge.diagnose_all import count_cases
    from glider.tools.verify.challenge.form_score import judge_forms
    from glider.tools.verify.challenge.judge import judge
    from glider.tools.verify.challenge.ocean_score import judge_missions
    from glider.tools.verify.challenge.result import Kind, as_file, result_of
    from glider.tools.verify.challenge.score import ChallengeScore
    from glider.tools.verify.challenge.watch_score import WatchScore, judge_watches

    need("analysis")
    if manifest is not None and not manifest.is_file():
        raise InputError("no such file", source=manifest, column="--manifest")
    _check_kind(watch, ocean, form)
    if out is not None:
        check_writable(out.parent)
    judged: Callable[..., ChallengeScore | WatchScore] = judge_forms if form else judge
    how: dict[str, Any] = {"manifest": manifest, "partial": partial}
    if watch:
        judged = judge_missions if ocean else judge_watches
    else:
        how["closing"] = not no_closed
    with progress("scored", count_cases(cases)) as advance:
        found = judged(cases, answers, diagnoses, **how, advance=advance)
    if out is not None:
        kind: Kind = ("ocean" if ocean else "watch") if watch else "form" if form else "single"
        write_bytes(out, as_file(result_of(found, kind, answers, diagnoses, commit)))
        say(f"result: {out}")
    if as_json:
        print_json(found.plain())
    elif isinstance(found, WatchScore):
        _print_figures(found.figures)
        _print_watches(found)
    else:
        _print_score(found)


def _print_watches(found) -> None:
    """One line a vehicle."""
    click.echo(f"\n{'vehicle':10}{'changed by':24}{'runs':>8}  {'called':24}{'runs':>14}{'wrong':>7}{'missed':>7}")
    for row in found.plain()["cases"]:
        last = "" if row["to_run"] is None else row["to_run"]
        true = "" if row["from_run"] is None else f"{row['from_run']}-{last}"
        called = "" if row["said"] is None else f"{row['said_from']}-{row['said_to'] or ''}"
        click.echo(
            f"{row['name']:10}{row['label'] or '-':24}{true:>8}  {row['said'] or '-':24}{called:>14}"
            f"{row['called_wrongly']:7d}{row['not_found']:7d}"
        )


def _print_figures(figures) -> None:
    """One line a figure."""
    for figure in figures:
        bound, target = "<=" if figure.at_most else ">=", ""
        if figure.count is None:
            value = "-" if figure.value is None else f"{figure.value:.2f}"
            target = target if figure.target is None else f"{bound} {figure.target:g}"
            counted = f"{figure.of} cases"
        else:
            value = "-" if figure.value is None else f"{100.0 * figure.value:.1f} %"
            target = target if figure.target is None else f"{bound} {100.0 * figure.target:.0f} %"
            low, high = figure.interval
            counted = f"{figure.count} of {figure.of}, {100.0 * low:.1f} to {100.0 * high:.1f} %"
        mark = {None: "", True: "met", False: "missed"}[figure.met]
        click.echo(f"{figure.name:46}{value:>9}  {target:8} {mark:7} {counted}")


def _print_score(found) -> None:
    """The figures, then the labels, on standard output."""
    _print_figures(found.figures)
    unanswered = sum(case.said is None for case in found.cases)
    if unanswered:
        click.echo(f"{unanswered} cases without an answer count as wrong")
    heads = "".join(head.rjust(6) for head in ("cases", "seen", "first", "group", "three", "place"))
    click.echo(f"\n{'label':24}{heads}{'closed':>8}  called")
    for label, row in found.plain()["labels"].items():
        counts = "".join(f"{row[key]:6d}" for key in ("cases", "seen", "first", "group", "three", "subsystem"))
        closed = "-" if row["closed"] is None else f"{row['closed']:.2f}"
        wrong = ", ".join(f"{name} {count}" for name, count in sorted(row["called"].items()))
        click.echo(f"{label:24}{counts}{closed:>8}  {wrong}")
