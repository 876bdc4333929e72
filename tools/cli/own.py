"""What the commands on cases do where the vehicle is a model of the user's (docs/how-to/own-vehicle.md)."""

import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from glider.tools.cli.common import compile_observer, print_json, print_lines, say
from glider.tools.data.errors import need
from glider.tools.data.files import write_bytes


def own_vehicle(case: Path, wanted: str | None) -> Any:
    """The user's own model that a case is asked by; None where its vehicle is none."""
    from glider.tools.own.cases import own_vehicle as find

    found = find(case, wanted)
    if found is not None:
        need("analysis")
        if found.level:
            compile_observer()
        if found.level and not found.kernels.compiled:
            say(f"note: the model runs as {found.kernels.said}")
    return found


def tell(text: str) -> None:
    """Progress on standard error."""
    print(text, file=sys.stderr)


def readings(vehicle: Any, case: Path, as_json: bool) -> None:
    """Columns of a case that a user's model follows far better if they are read otherwise."""
    from glider.tools.own.columns_tried import tried
    from glider.tools.own.runs import load_own_runs

    found = tried(vehicle, load_own_runs(case, vehicle.declared))
    lines = [
        f"{one['what']}  channels' errors, multiplied, fall by a factor of {math.exp(one['nat']):.3g} or more"
        for one in found
    ]
    nothing = "no column is followed far better in another unit, with the other sign, or exchanged for another"
    print_lines(lines or [nothing], as_json, {"readings": found})


def _doubted(vehicle: Any, runs: Any) -> None:
    """A note on every column that is followed far better if it is read otherwise."""
    from glider.tools.own.columns_tried import tried

    if vehicle.level and vehicle.kernels.compiled:
        for one in tried(vehicle, runs):
            say(f"note: the model follows these runs far better with {one['what']}")


def measure(vehicle: Any, case: Path, as_json: bool) -> None:
    """Gaps per run and channel of a user's model."""
    from glider.tools.own.measure import measure as measure_runs
    from glider.tools.own.runs import load_own_runs

    runs = load_own_runs(case, vehicle.declared)
    _doubted(vehicle, runs)
    found = measure_runs(vehicle, runs)
    for note in found["notes"]:
        say(f"note: {note}")
    if as_json:
        print_json(found)
        return
    names = list(found["channels"])
    width = max(8, *(len(name) + 2 for name in names))
    click.echo("".ljust(10) + "".join(name.rjust(width) for name in [*names, "total"]))
    for run in [*found["runs"], {"run": "all", "channels": found["channels"], "total": found["total"]}]:
        cells = [f"{run['channels'][name]:.2f}" if name in run["channels"] else "-" for name in names]
        click.echo(run["run"].ljust(10) + "".join(cell.rjust(width) for cell in [*cells, f"{run['total']:.2f}"]))
    limits = ", ".join(f"{name} {value:.3g}" for name, value in found["tolerances"].items())
    click.echo(f"\nin tolerances ({limits}), windows of {found['horizon_s']:.1f} s flown open loop")


def predict(vehicle: Any, run: Path, out: Path) -> None:
    """A run predicted by a user's model."""
    from glider.tools.own.measure import predict as predict_run
    from glider.tools.own.runs import load_own_run

    rows = predict_run(vehicle, load_own_run(run, vehicle.declared), out)
    say(f"predicted {rows} rows of {run.name}: {out}")


def diagnose(vehicle: Any, case: Path, reference: Path | None, out: Path, as_json: bool) -> None:
    """The diagnosis of a case by a user's model; with a reference the vehicle is identified from that first."""
    from glider.tools.api.sentences import verdict_lines
    from glider.tools.own.diagnose import diagnose_own, sentence, write
    from glider.tools.own.runs import load_own_runs

    runs = load_own_runs(case, vehicle.declared)
    if reference is not None:
        vehicle = _identified(vehicle, [reference], out / "reference")
    found, observer = diagnose_own(vehicle, runs, tell)
    answer = write(vehicle, observer, found, case.resolve().name, out)
    from glider.tools.report.own import write_own_report

    write_own_report(out)
    for caution in answer["cautions"]:
        say(f"note: {caution}")
    print_lines([sentence(answer), *verdict_lines(answer)], as_json, answer)
    say(f"answer: {out / 'diagnosis.json'}, report: {out / 'report.html'}")


def watch(vehicle: Any, case: Path, reference: Path | None, out: Path | None, as_json: bool) -> None:
    """What changed over the runs of a case, by a user's model."""
    from glider.tools.data.plain import as_plain
    from glider.tools.own.runs import load_own_runs
    from glider.tools.own.watch import watch as watch_runs

    runs = load_own_runs(case, vehicle.declared)
    before = [] if reference is None else load_own_runs(reference, vehicle.declared)
    answer = watch_runs(vehicle, runs, before, tell).plain()
    if out is not None:
        from glider.tools.report.watch import write_watch_report

        out.mkdir(parents=True, exist_ok=True)
        write_bytes(out / "watch.json", (json.dumps(as_plain(answer), indent=1) + "\n").encode())
        write_watch_report(out)
        say(f"answer: {out / 'watch.json'}, report: {out / 'report.html'}")
    for caution in answer["cautions"]:
        say(f"note: {caution}")
    if as_json:
        print_json(answer)
        return
    for run in answer["runs"]:
        causes = ", ".join(f"{one['label']} {_size(one)}" for one in run["causes"][:2])
        click.echo(f"{run['run']:<12} {run['verdict']:8} gap {run['gap']:6.2f}  {causes}".rstrip())
    click.echo("")
    for session in answer["sessions"]:
        click.echo(f"another session begins with {session['from_run']}: what changed with it may be no more than that")
    if not answer["events"] and not answer["sessions"]:
        click.echo("nothing changed, as far as these runs can show")
    for event in answer["events"]:
        until = "and is still there" if event["to_run"] is None else f"to {event['to_run']}"
        others = [label for label in event["group"] if label != event["label"]]
        confounded = f"; may as well be {', '.join(others)}" if others else ""
        name = event["label"] or f"unknown ({event['where'][0]['subsystem']} {event['where'][0]['element']})"
        click.echo(f"{name} {_size(event)} from {event['from_run']} {until}, {event['probability']:.2f}{confounded}")


def _size(one: dict[str, Any]) -> str:
    low, high = one["ci90"]
    return f"{one['size']:.3g} {one['unit']} ({low:.3g} to {high:.3g})"


def _identified(vehicle: Any, cases: Sequence[Path], out: Path) -> Any:
    """The vehicle identified from cases, as a file in a folder, read again."""
    from glider.tools.own.check import load_own
    from glider.tools.own.identified import VEHICLE, write
    from glider.tools.own.identify import identify as identify_runs
    from glider.tools.own.runs import load_own_runs

    write(identify_runs(vehicle, [load_own_runs(case, vehicle.declared) for case in cases], tell), out)
    return load_own(out / VEHICLE)


def identify(vehicle: Any, cases: Sequence[Path], out: Path | None, as_json: bool) -> None:
    """A user's model identified from healthy runs; every case is a session."""
    from glider.tools.own.identified import VEHICLE, plain, write
    from glider.tools.own.identify import identify as identify_runs
    from glider.tools.own.runs import load_own_runs

    sessions = [load_own_runs(case, vehicle.declared) for case in cases]
    _doubted(vehicle, [run for session in sessions for run in session])
    found = identify_runs(vehicle, sessions, tell)
    if out is not None:
        write(found, out)
        say(f"vehicle: {out / VEHICLE}")
    answer = plain(found)
    for note in answer["notes"]:
        say(f"note: {note}")
    if as_json:
        print_json(answer)
        return
    gap = answer["gap"]
    click.echo(
        f"runs left out: {gap['before']['total']:.2f} -> {gap['after']['total']:.2f} tolerances, channels by "
        f"{answer['channel_ratio']:.2f} on average; handed out: {answer['handed_out']}"
    )
    for name in (name for name in gap["before"] if name != "total" and gap["before"][name] is not None):
        click.echo(f"  {name:<12} {gap['before'][name]:6.2f} -> {gap['after'][name]:6.2f}")
    for case, one in zip(cases, answer["sessions"], strict=True) if len(cases) > 1 else ():
        click.echo(f"  session {case.name}: {one['before']['total']:.2f} -> {one['after']['total']:.2f}")
    click.echo(f"{'':<16} {'file':>10} {'mean':>10} {'sd':>9}   90 % interval")
    for one in answer["parameters"]:
        low, high = one["ci90"]
        click.echo(
            f"{one['name']:<16} {one['file']:>10.4g} {one['mean']:>10.4g} {one['sd']:>9.2g}   "
            f"{low:.4g} to {high:.4g} {one['unit']}"
        )
    points = answer["operating_points"]
    if points["scatter"]:
        units = {one.name: one.unit for one in found.vehicle.declared.noises}
        said = ", ".join(f"{name} {value:.2g} {units[name]}" for name, value in points["scatter"].items())
        click.echo(f"what goes with the operating point ({points['count']} of them), 1 sigma: {said}")
    for group in answer["groups"]:
        click.echo(f"these runs do not tell apart: {', '.join(group)}")
