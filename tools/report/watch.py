"""The report of a watch, drawn from its folder: events, pictures over the runs, then every run; one offline file."""

from pathlib import Path
from typing import Any

import msgspec

from glider.tools.data.errors import InputError
from glider.tools.data.files import write_bytes
from glider.tools.data.plain import read_json
from glider.tools.data.runs.origin import with_flight
from glider.tools.data.vehicle_kinds import UNNAMED, kinds
from glider.tools.diagnose.record import EstimateRecord
from glider.tools.report import words
from glider.tools.report.now import checks_of
from glider.tools.report.page import REPORT, render
from glider.tools.report.run_picture import Point, RunPicture, Span, svg_over_runs
from glider.tools.watch.answer import FILE

MOST_BYTES = 100_000_000


class _Cause(msgspec.Struct):
    label: str
    probability: float
    size: float | None
    ci90: tuple[float, float] | None
    unit: str | None


class _Velocity(msgspec.Struct):
    u_m_s: float
    ci90: tuple[float, float]
    water_w_m_s: float


class _Run(msgspec.Struct):
    run: str
    verdict: str
    causes: list[_Cause]
    gap: float | None
    skipped: str | None
    velocity: _Velocity | None = None


class _SizeOfRun(msgspec.Struct):
    run: str
    size: float | None
    ci90: tuple[float, float] | None


class _Event(msgspec.Struct):
    label: str | None
    where: list[dict[str, Any]]
    group: list[str]
    from_run: str
    to_run: str | None
    course: str
    probability: float
    size: float | None
    ci90: tuple[float, float] | None
    unit: str | None
    sizes: list[_SizeOfRun]
    parameters: dict[str, EstimateRecord] = {}


class _Watch(msgspec.Struct):
    runs: list[_Run]
    events: list[_Event]
    reference: list[str]
    cautions: list[str]
    flights: dict[str, str] = {}
    kind: str = UNNAMED


def read_watch(folder: Path) -> _Watch:
    """watch.json of a folder; InputError where it is missing or no answer of a watch."""
    path = folder / FILE
    if not path.is_file():
        raise InputError("no such file: not a folder of `glider gap watch --out`", source=path)
    return read_json(path, _Watch, MOST_BYTES)


def _size(one: _Cause | _Event) -> str:
    if one.size is None or one.ci90 is None:
        return ""
    unit = "" if one.unit in (None, "1") else f" {one.unit}"
    low, high = one.ci90
    return f"{words.number(one.size)}{unit} (90 %: {words.number(low)} to {words.number(high)})"


def _meaning(one: _Event, kind: str) -> str:
    """What the size of an event means: the quantity that its row of the catalogue multiplies, where it has a row."""
    effect = kinds()[kind].catalogue().get(one.label or "") if kind in kinds() else None
    return "" if effect is None else words.size_of(effect, one.parameters)


def _speed(found: _Velocity | None) -> str:
    if found is None:
        return ""
    low, high = (f"{100.0 * value:.1f}" for value in found.ci90)
    return f"{100.0 * found.u_m_s:.1f} ({low} to {high})"


def _health(found: _Watch) -> str:
    """How the runs stand, in a sentence."""
    judged = [run for run in found.runs if run.skipped is None]
    changed = [run for run in judged if run.verdict != "none"]
    lasting = [one.label or "an unknown change" for one in found.events if one.to_run is None]
    now = f"; in the last run still: {words.joined(lasting)}" if lasting else ""
    return f"{len(judged) - len(changed)} of {len(judged)} runs that could be judged are as before{now}."


def _event(one: _Event, flights: dict[str, str], kind: str) -> dict[str, Any]:
    place = " ".join(str(one.where[0][key]) for key in ("subsystem", "element")) if one.where else ""
    if one.label is None:
        said = f"No effect of the catalogue explains it{f'; most likely in {place}' if place else ''}"
    else:
        plain = words.with_sign(one.label, one.parameters)
        said = words.upper(plain) if plain != one.label else f"Of the {place}"
    others = [label for label in one.group if label != one.label]
    meaning = _meaning(one, kind)
    return {
        "name": one.label or "unknown", "said": said, "size": meaning or _size(one), "alike": words.joined(others),
        "from": with_flight(one.from_run, flights),
        "to": None if one.to_run is None else with_flight(one.to_run, flights),
        "course": one.course, "percent": 100.0 * one.probability,
    }  # fmt: skip


def _names(found: _Watch) -> list[tuple[str, str]]:
    """Name and date of every run; the date is what its flight's record ends with."""
    dates = {run: flight.rpartition(", ")[2] for run, flight in found.flights.items() if ", " in flight}
    return [(run.run, dates.get(run.run, "")) for run in found.runs]


def _pictures(found: _Watch) -> list[dict[str, str]]:
    """Gap over runs, then the size of every event over them."""
    numbers = {run.run: n for n, run in enumerate(found.runs)}
    names, last = _names(found), len(found.runs) - 1

    def span(one: _Event, sized: bool) -> Span:
        ends = numbers[one.from_run], last if one.to_run is None else numbers[one.to_run]
        return Span(*ends, *((one.size, one.ci90) if sized else ()))

    gaps = [
        None if run.gap is None else Point(
            run.gap, None, "skipped" if run.skipped else run.verdict,
            f"{with_flight(run.run, found.flights)}: gap {words.number(run.gap)}, {run.skipped or run.verdict}",
        ) for run in found.runs
    ]  # fmt: skip
    title = "total gap of every run, tolerances"
    drawn = [(title, RunPicture(title, names, gaps, [span(one, False) for one in found.events]))]
    for one in found.events:
        if one.size is None or one.label is None:
            continue
        points: list[Point | None] = [None] * len(found.runs)
        for own in one.sizes:
            if own.size is not None:
                sized = _Cause(one.label, 1.0, own.size, own.ci90, one.unit)
                said = f"{with_flight(own.run, found.flights)}: {_size(sized)}"
                points[numbers[own.run]] = Point(own.size, own.ci90, "cause", said)
        unit = "" if one.unit in (None, "1") else f", {one.unit}"
        title = f"{one.label}{unit}: size with its 90 % interval"
        drawn.append((title, RunPicture(title, names, points, [span(one, not any(points))])))
    return [{"title": title, "svg": svg_over_runs(picture)} for title, picture in drawn]


def report_html(found: _Watch) -> str:
    """The page's text; MissingExtra without jinja2."""
    runs = [
        {
            "name": with_flight(run.run, found.flights),
            "verdict": run.skipped or run.verdict, "kind": "skipped" if run.skipped else run.verdict,
            "gap": "" if run.gap is None else words.number(run.gap),
            "causes": ", ".join(f"{one.label} {_size(one)}".strip() for one in run.causes[:2]),
            "speed": _speed(run.velocity),
            "water": "" if run.velocity is None else f"{100.0 * run.velocity.water_w_m_s:.2f}",
        }
        for run in found.runs
    ]  # fmt: skip
    context = {
        "events": [_event(one, found.flights, found.kind) for one in found.events],
        "runs": runs, "cautions": found.cautions, "pictures": _pictures(found), "steps": _steps(found),
        "reference": words.joined(found.reference), "health": _health(found),
        "speeds": any(run.velocity is not None for run in found.runs),
    }  # fmt: skip
    return render("watch.html", context).replace(" %", "\N{NO-BREAK SPACE}%")


def _steps(found: _Watch) -> list[dict[str, Any]]:
    """What to check on the vehicle, for every change that is still there."""
    lasting = [(one.label, one.where) for one in found.events if one.to_run is None and one.label is not None]
    places = {label: (str(where[0]["subsystem"]), str(where[0]["element"])) for label, where in lasting if where}
    labels = [label for label, _ in lasting]
    confounded = [label for one in found.events if one.to_run is None for label in one.group]
    return checks_of([*labels, *confounded], labels, places)


def write_watch_report(folder: Path) -> str:
    """Draw the report of a watch from its folder, into it; what changed, in a sentence."""
    found = read_watch(folder)
    write_bytes(folder / REPORT, report_html(found).encode("utf-8"))
    if not found.events:
        return "Nothing changed, as far as these runs can show."
    named = [
        f"{one.label or 'an unknown change'} since {with_flight(one.from_run, found.flights)}" for one in found.events
    ]
    return f"{words.upper(words.joined(named))}."
