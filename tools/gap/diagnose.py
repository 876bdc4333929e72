"""The diagnosis of a case: where the simulator is wrong, which effect causes it, how far the gap shrinks (GAP.md)."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sim_backend.effects.base import catalogue
from tools.gap.corrected import corrected_text
from tools.gap.next_run import propose
from tools.gap.problem import pose
from tools.gap.search import Search, run
from tools.gap.shrink import AFTER, BEFORE, FLOOR, RECALIBRATED, Shrinkage, shrink
from tools.gap.verdict import NONE, UNKNOWN, Answer, conclude
from tools.runs.case import Case

UNPREDICTABLE = ("waves", "turbulence")
UNFIT = 5.0  # tolerances that the best explanation still misses by: unknown effects of the blind test left up to 3
WORTH = 0.001  # a smaller probability is not written down


@dataclass
class Diagnosis:
    """Everything a diagnosis found, for the files and the report."""

    case: Case
    search: Search
    answer: Answer
    shrinkage: Shrinkage
    next_run: dict[str, Any]
    mission: str  # its file's text

    @property
    def identify_first(self) -> bool:
        """Whether the log fits the vehicle file so badly that no cause can be asked for yet."""
        return self.verdict == "unknown" and self.shrinkage.after > UNFIT

    @property
    def verdict(self) -> str:
        return {NONE: "none", UNKNOWN: "unknown"}.get(self.answer.main, "cause")


def diagnose(case: Case, say: Callable[[str], None] = lambda text: None) -> Diagnosis:
    """Diagnose a case; `say` is told where the search stands."""
    search = run(pose(case), say)
    answer = conclude(search, say)
    search = answer.search
    say(f"verdict: {answer.main}")
    entry, mission = propose(search)
    return Diagnosis(case, search, answer, shrink(search, answer.course), entry, mission)


def parameters(diagnosis: Diagnosis, label: str) -> dict[str, dict[str, Any]]:
    """Estimate, 90 % interval and unit of each parameter of a selected label, by Laplace's approximation."""
    course = diagnosis.answer.course
    if not len(course.free) or label not in course.labels:
        return {}
    spread = np.sqrt(np.diag(np.linalg.inv(course.precision)))
    found = {}
    for n, free in enumerate(course.free):
        if free.label == label:
            value, sd = course.values[n] * free.spread, 1.645 * spread[n] * free.spread
            low, high = max(value - sd, free.low * free.spread), min(value + sd, free.high * free.spread)
            found[free.name] = {"estimate": value, "ci90": [low, high], "unit": free.unit}
    return found


def places(answer: Answer) -> list[dict[str, Any]]:
    """Where, most probable first: labels' probabilities by place; what is unknown lies where a freed link gains."""
    weight: dict[tuple[str, str], float] = {}
    effects = catalogue()

    def add(place: tuple[str, str], share: float) -> None:
        weight[place] = weight.get(place, 0.0) + share

    known = {label: p for label, p in answer.probabilities.items() if label in effects}
    total = sum(known.values())
    doubt = answer.probabilities[UNKNOWN]
    links = [f for f in answer.freed if f.probe.name not in UNPREDICTABLE and f.gain > 0.0]
    gained = sum(f.gain for f in links)
    for link in links:
        add((link.probe.subsystem, link.probe.element), doubt * link.gain / gained)
    for label, p in known.items():
        likeness = 0.0 if links or total <= 0.0 else doubt * p / total
        add((effects[label].subsystem, effects[label].element), p + likeness)
    for label in answer.selected:
        place = (effects[label].subsystem, effects[label].element)
        weight[place] = max(weight.get(place, 0.0), WORTH)
    ranked = sorted(weight.items(), key=lambda item: -item[1])
    return [{"subsystem": s, "element": e, "probability": p} for (s, e), p in ranked if p >= WORTH]


def gap_table(shrinkage: Shrinkage, answer: Answer) -> dict[str, Any]:
    """The `gap` entry of diagnosis.json."""
    table: dict[str, Any] = {name: shrinkage.channels(name) for name in (BEFORE, RECALIBRATED, AFTER, FLOOR)}
    scatter = bool(answer.selected) and all(label in UNPREDICTABLE for label in answer.selected)
    table["shrinkage"] = {"value": None if scatter else shrinkage.shrinkage, "ci90": list(shrinkage.ci90)}
    table["closed"] = {"value": None if scatter else shrinkage.closed, "ci90": list(shrinkage.closed_ci90)}
    return table


def plain(diagnosis: Diagnosis) -> dict[str, Any]:
    """diagnosis.json."""
    answer = diagnosis.answer
    causes = []
    for label, p in sorted(answer.probabilities.items(), key=lambda item: -item[1]):
        causes.append({
            "label": label, "probability": p, "group": answer.groups.get(label, [label]),
            "parameters": parameters(diagnosis, label),
        })  # fmt: skip
    selected = list(answer.selected)
    return {
        "format": 1,
        "verdict": diagnosis.verdict,
        "where": places(answer),
        "causes": causes,
        "selected": [] if diagnosis.verdict == "none" else selected,
        "gap": gap_table(diagnosis.shrinkage, answer),
        "left": [{"channel": f.channel, "goes_with": f.test, "sigma": f.sigma} for f in answer.findings[:8]],
        "identify_first": diagnosis.identify_first,
        "next_run": diagnosis.next_run,
    }


def effects_of(diagnosis: Diagnosis) -> dict[str, dict[str, float]]:
    """The selected effects with their values, as a corrected model holds them."""
    found: dict[str, dict[str, float]] = {}
    course = diagnosis.answer.course
    for free, value in zip(course.free, course.values, strict=True):
        found.setdefault(free.label, {})[free.name] = float(value * free.spread)
    return found


def write(diagnosis: Diagnosis, out: Path) -> None:
    """diagnosis.json and corrected.toml into a folder."""
    from tools.cli.common import _plain

    out.mkdir(parents=True, exist_ok=True)
    search, course = diagnosis.search, diagnosis.answer.course
    P, F = search.model(course)
    text = corrected_text(diagnosis.case.vehicle_name, search.problem.model.P, P, F, effects_of(diagnosis))
    (out / "next_run.toml").write_text(diagnosis.mission, encoding="utf-8")
    (out / "corrected.toml").write_text(text, encoding="utf-8")
    (out / "diagnosis.json").write_text(json.dumps(_plain(plain(diagnosis)), indent=1) + "\n", encoding="utf-8")
