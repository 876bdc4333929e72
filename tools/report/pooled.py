"""The report of a diagnosis that asks for what all runs of a case share, drawn from its diagnosis.json.

An ocean glider's (docs/explanation/ocean.md, Diagnosis), or one against healthy runs (docs/explanation/diagnosis.md,
Against healthy runs).
"""

from pathlib import Path
from typing import Any

import msgspec

from glider.tools.data.files import write_bytes
from glider.tools.data.vehicle_kinds import UNNAMED, kinds
from glider.tools.diagnose.record import AGAINST_HEALTHY, ANSWER, CauseRecord, Gap, number, read_as
from glider.tools.report import words
from glider.tools.report.now import checks_of
from glider.tools.report.page import REPORT, render

MOST_RANKED, LEAST_PROBABILITY = 8, 0.005
MEANS = words.MEANS | {"none": "nothing beyond what the vehicle file allows"}
HEALTHY_MEANS = words.MEANS | {"none": "nothing that the healthy runs have not"}


class _Stage(msgspec.Struct):
    stage: str
    gap: dict[str, float | None]


class _Left(msgspec.Struct):
    """What no label explains."""

    channel: str
    excess: float
    regime: str
    runs: list[str]


class _Case(msgspec.Struct):
    name: str
    vehicle: str
    runs: int


class _Reference(msgspec.Struct):
    count: int


class _Answer(msgspec.Struct):
    case: _Case
    verdict: str
    causes: list[CauseRecord]
    selected: list[str]
    gap: Gap
    stages: list[_Stage]
    cautions: list[str]
    skipped: dict[str, str]
    next_run: dict[str, Any]
    kind: str
    left: _Left | None = None
    reference: _Reference | None = None

    @property
    def effects(self):
        """The catalogue of its labels."""
        return kinds()[UNNAMED if self.kind == AGAINST_HEALTHY else self.kind].catalogue()


def which(found: _Answer) -> str:
    """The runs or dives that figures are of: of a single one nothing can be left out."""
    one = "run" if found.kind == AGAINST_HEALTHY else "dive"
    return f"{one}s left out" if found.case.runs > 1 else f"this {one}, to which all was fitted,"


def size(found: _Answer, label: str) -> str:
    """The size of a selected label, behind a semicolon."""
    cause = next(one for one in found.causes if one.label == label)
    said = words.size_of(found.effects[label], cause.parameters)
    return f"; {said}" if said else ""


def sure(found: _Answer) -> str:
    """How sure the main cause is."""
    return f"{words.small_percent(found.causes[0].probability)} sure"


def against_healthy(found: _Answer) -> str:
    """The verdict of a diagnosis against healthy runs in one plain sentence."""
    before, after, floor = (words.number(number(one["total"])) for one in
                            (found.gap.before, found.gap.after, found.gap.floor))  # fmt: skip
    gaps = f"the total gap of {which(found)} is {before} tolerances, of healthy runs {floor}"
    named = words.joined(found.selected)
    if found.verdict == "none":
        below = f" above {floor} tolerances, and one below cannot be seen" if words.blind(found.gap) else ""
        return f"No change{below}: {gaps}."
    if found.verdict == "unknown":
        beside = f"; nearest to it comes {named}, with which {after} are left" if named else ""
        return f"A change that no label explains: {gaps}{beside}."
    label = found.causes[0].label
    confounded = [name for name in found.causes[0].group if name != label]
    other = f"; these runs cannot tell it from {words.joined(confounded)}" if confounded else ""
    more = f", and {words.joined(found.selected[1:])}" if found.selected[1:] else ""
    return (
        f"{words.upper(found.effects[label].summary)} ({label}{size(found, label)}; {sure(found)})"
        f"{more}{other}; {gaps}, and with it {after}."
    )


def sentence(found: _Answer) -> str:
    """The verdict in one plain sentence."""
    if found.kind == AGAINST_HEALTHY:
        return against_healthy(found)
    before, again, after = (words.number(number(one["total"])) for one in
                            (found.gap.before, found.gap.recalibrated, found.gap.after))  # fmt: skip
    if found.left is not None:
        regime = f", most of it {found.left.regime}" if found.left.regime else ""
        runs = f", most in {words.joined(found.left.runs)}" if found.left.runs else ""
        return (
            f"An effect that no label names: the {found.left.channel} of {which(found)} is off by "
            f"{words.number(found.left.excess)} tolerances beyond what noise leaves{regime}{runs}."
        )
    if not found.selected:
        none = "No effect beyond what the vehicle file allows"
        if words.blind(found.gap):
            floor = words.number(number(found.gap.floor["total"]))
            none = f"No effect above {floor} tolerances, which noise alone leaves, and one below cannot be seen"
        return (
            f"{none}: the total gap of {which(found)} is {before} tolerances "
            f"with the file's numbers and {again} with them fitted."
        )
    label = found.selected[0]
    confounded = [name for name in found.causes[0].group if name != label]
    more = f", and {words.joined(found.selected[1:])}" if found.selected[1:] else ""
    other = f"; these dives cannot tell it from {words.joined(confounded)}" if confounded else ""
    return (
        f"{words.upper(found.effects[label].summary)} ({label}{size(found, label)}; {sure(found)})"
        f"{more}{other}; the total gap of {which(found)} is {before} tolerances with the file's numbers, {again} with "
        f"them fitted and {after} with {'these effects' if more else 'that effect'}."
    )


def _ranking(found: _Answer) -> list[dict[str, Any]]:
    effects, means = found.effects, HEALTHY_MEANS if found.kind == AGAINST_HEALTHY else MEANS
    return [
        {
            "label": one.label, "percent": 100.0 * one.probability, "shown": words.small_percent(one.probability),
            "means": means.get(one.label) or effects[one.label].summary,
        }
        for n, one in enumerate(found.causes[:MOST_RANKED]) if one.probability >= LEAST_PROBABILITY or n < 3
    ]  # fmt: skip


def _sizes(found: _Answer) -> list[dict[str, str]]:
    rows = []
    for label in found.selected:
        cause = next(one for one in found.causes if one.label == label)
        for name, entry in cause.parameters.items():
            value, low, high = (words.number(number(v)) for v in (entry.estimate, *entry.ci90))
            unit = "" if entry.unit == "1" else entry.unit
            rows.append({"name": f"{label}, {name}", "value": value, "low": low, "high": high, "unit": unit})
    return rows


def report_html(found: _Answer) -> str:
    """The page's text; MissingExtra without jinja2."""
    gap = found.gap
    highest = max([number(one.gap["total"]) for one in found.stages], default=1.0)
    healthy = found.reference
    confounded = found.causes[0].group if found.verdict == "cause" else []
    context = {
        "which": which(found).removesuffix(","),
        "blind": found.verdict == "none" and words.blind(gap),
        "runs": "run" if healthy is not None else "dive",
        "asked": "Probabilities of the one effect that all dives have beside what the vehicle file allows."
        if healthy is None
        else f"Probabilities of the main change from {healthy.count} healthy runs.",
        "floor": "what noise and vertical water alone leave" if healthy is None
        else "what the identified vehicle leaves of healthy runs that its fit has not seen",
        "case": found.case, "verdict": found.verdict, "sentence": sentence(found), "ranking": _ranking(found),
        "sizes": _sizes(found), "cautions": [words.upper(line) for line in found.cautions], "skipped": found.skipped,
        "stages": [
            {"name": one.stage, "total": words.number(number(one.gap["total"])),
             "percent": 100.0 * number(one.gap["total"]) / highest}
            for one in found.stages
        ],
        "table": [
            {"name": name, "cells": [words.number(number(one.get(name))) for one in
                                     (gap.before, gap.recalibrated, gap.after, gap.floor)]}
            for name in gap.before
        ],
        "steps": checks_of([*found.selected, *confounded], found.selected, {}),
        "next_run": found.next_run.get("text", ""),
    }  # fmt: skip
    return render("pooled.html", context).replace(" %", "\N{NO-BREAK SPACE}%")


def write_pooled_report(folder: Path) -> str:
    """Draw the report of such a diagnosis from its folder, into it; the verdict, in a sentence."""
    found = read_as(folder / ANSWER, _Answer)
    write_bytes(folder / REPORT, report_html(found).encode("utf-8"))
    return sentence(found)
