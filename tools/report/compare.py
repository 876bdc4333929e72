"""Two answers of a diagnosis side by side: verdicts, probabilities, sizes with their difference, gaps by channel."""

import math
from pathlib import Path
from typing import Any

import msgspec

from glider.tools.data.errors import InputError
from glider.tools.data.intervals import NINETY
from glider.tools.diagnose.record import ANSWER, CauseRecord, EstimateRecord, Number, read_as
from glider.tools.report import words

SHOWN_PROBABILITY = 0.01  # of a label in one of the two, from which it is listed
DIFFERENT_SD = NINETY  # standard deviations of the difference, beyond which its 90 % interval leaves 0 out
GAPS = ("before", "after")


class _Gap(msgspec.Struct):
    before: dict[str, Number]
    after: dict[str, Number]


class _Side(msgspec.Struct):
    verdict: str
    causes: list[CauseRecord]
    selected: list[str]
    gap: _Gap


def read_side(path: Path) -> _Side:
    """The answer of a folder of `glider gap diagnose`, or of its diagnosis.json; InputError where it is none."""
    if not path.exists():
        raise InputError("no such file or folder", source=path)
    return read_as(path / ANSWER if path.is_dir() else path, _Side)


def compare(first: Path, second: Path) -> dict[str, Any]:
    """What two answers say of the same things, as `--json` prints it.

    Args:
        first: folder or diagnosis.json of A.
        second: the same of B.

    Returns:
        `verdict` and `selected` of `a` and `b`; `labels`: probabilities; `parameters`: estimates with their 90 %
        intervals, and `difference` (b - a, with the standard deviation `sd` of it and `differs`, whether its 90 %
        interval leaves 0 out) where both have one; `gap`: by channel, tolerances, before and after.
    """
    a, b = read_side(first), read_side(second)
    return {
        "format": 1, "a": _head(first, a), "b": _head(second, b), "labels": _labels(a, b),
        "parameters": _parameters(a, b),
        "gap": [
            {"channel": name, **{side: {which: getattr(one.gap, which).get(name) for which in GAPS}
                                 for side, one in (("a", a), ("b", b))}}
            for name in dict.fromkeys([*a.gap.before, *b.gap.before])
        ],
    }  # fmt: skip


def _head(path: Path, side: _Side) -> dict[str, Any]:
    return {"path": str(path), "verdict": side.verdict, "selected": side.selected}


def _labels(a: _Side, b: _Side) -> list[dict[str, Any]]:
    """Probabilities of labels that count in one of the two, the largest first; null where a label was not judged."""
    shares = [{cause.label: cause.probability for cause in side.causes} for side in (a, b)]
    named = sorted({**shares[0], **shares[1]}, key=lambda label: (-max(one.get(label, 0.0) for one in shares), label))
    return [
        {"label": label, "a": shares[0].get(label), "b": shares[1].get(label)} for label in named
        if max(one.get(label, 0.0) for one in shares) >= SHOWN_PROBABILITY
    ]  # fmt: skip


def _parameters(a: _Side, b: _Side) -> list[dict[str, Any]]:
    """Sizes of labels that are selected in one of the two, and by how much they differ."""
    sides = [{cause.label: cause.parameters for cause in side.causes} for side in (a, b)]
    rows = []
    for label in dict.fromkeys([*a.selected, *b.selected]):
        known = [side.get(label, {}) for side in sides]
        for name in dict.fromkeys([*known[0], *known[1]]):
            ours, theirs = (one.get(name) for one in known)
            unit = next(one.unit for one in (ours, theirs) if one is not None)
            rows.append({
                "label": label, "parameter": name, "unit": unit, "a": _plain(ours), "b": _plain(theirs),
                **_difference(ours, theirs),
            })  # fmt: skip
    return rows


def _plain(one: EstimateRecord | None) -> dict[str, Any] | None:
    return None if one is None else {"estimate": one.estimate, "ci90": list(one.ci90)}


def _difference(a: EstimateRecord | None, b: EstimateRecord | None) -> dict[str, Any]:
    """b - a with its standard deviation, by the widths of the 90 % intervals; nulls where one is missing."""
    ends = [end for one in (a, b) if one is not None for end in (one.estimate, *one.ci90)]
    if a is None or b is None or None in ends or a.unit != b.unit:
        return {"difference": None, "sd": None, "differs": None}
    low_a, high_a, low_b, high_b = map(float, (*a.ci90, *b.ci90))  # type: ignore[arg-type]
    sd = math.hypot(high_a - low_a, high_b - low_b) / (2.0 * NINETY)
    difference = float(b.estimate) - float(a.estimate)  # type: ignore[arg-type]
    return {"difference": difference, "sd": sd, "differs": abs(difference) > DIFFERENT_SD * sd}


def lines(found: dict[str, Any]) -> list[str]:
    """The comparison as printed, a line each."""
    a, b = found["a"], found["b"]
    rows: list[tuple[str, ...]] = [("", a["path"], b["path"]), ("verdict", a["verdict"], b["verdict"])]
    rows.append(("selected", *(", ".join(one["selected"]) or "-" for one in (a, b))))
    rows += [(), ("probability of the main cause",)]
    for one in found["labels"]:
        rows.append((f"  {one['label']}", *("-" if one[side] is None else f"{one[side]:.2f}" for side in "ab")))
    if found["parameters"]:
        rows += [(), ("size, with its 90 % interval",)]
    for one in found["parameters"]:
        verdict = {None: "", True: "differs", False: "agrees"}[one["differs"]]
        shown = (_sized(one[side], one["unit"]) for side in "ab")
        rows.append((f"  {one['label']} {one['parameter']}", *shown, verdict))
    rows += [(), ("gap of runs left out, in tolerances: before -> after",)]
    for one in found["gap"]:
        cells = (" -> ".join("-" if one[side][which] is None else f"{one[side][which]:.2f}" for which in GAPS)
                 for side in "ab")  # fmt: skip
        rows.append((f"  {one['channel']}", *cells))
    widths = [max(len(row[n]) for row in rows if len(row) > max(n, 1)) for n in range(3)]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, (*widths, 0), strict=False)).rstrip()
            for row in rows]  # fmt: skip


def _sized(one: dict[str, Any] | None, unit: str) -> str:
    if one is None:
        return "-"
    return words.sized(EstimateRecord(one["estimate"], tuple(one["ci90"]), unit)).replace(", 90 %:", ",")
