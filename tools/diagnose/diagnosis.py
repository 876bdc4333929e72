"""The diagnosis of a case: where the simulator is wrong, which effect causes it, how far the gap shrinks (GAP.md)."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sim_backend.effects.catalogue import catalogue
from tools.data.plain import as_plain
from tools.data.runs.case import Case
from tools.diagnose.cautions import cautions, not_asked
from tools.diagnose.correction import Correction, correct
from tools.diagnose.doubt import UNFIT
from tools.diagnose.next_run import propose
from tools.diagnose.probes import UNPREDICTABLE
from tools.diagnose.search import Search, run
from tools.diagnose.shrink import AFTER, BEFORE, FLOOR, RECALIBRATED, Further, Shrinkage, by_channel, shrink_further
from tools.diagnose.verdict import NONE, UNKNOWN, Answer, conclude, strongest_left
from tools.inference.corrected import corrected_text
from tools.inference.fit import Course
from tools.inference.problem import ALL, pose
from tools.inference.rules import Rules

CORRECTION_FILE = "data_driven.toml"
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
    correction: Correction | None = None  # of an unknown gap
    further: Further | None = None  # with that correction

    @property
    def identify_first(self) -> bool:
        """Whether the log fits the vehicle file so badly that no cause can be asked for yet."""
        return self.shrinkage.after > UNFIT

    @property
    def cautions(self) -> list[str]:
        """What these runs cannot say, a line each."""
        found = cautions(self.answer.search.problem)
        if self.identify_first:
            found.insert(0, (
                f"the vehicle file misses these runs by {self.shrinkage.after:.1f} tolerances whatever is added to it: "
                "check vehicle, units and calibrations, identify the vehicle first"
            ))  # fmt: skip
        return found

    @property
    def verdict(self) -> str:
        return {NONE: "none", UNKNOWN: "unknown"}.get(self.answer.main, "cause")


def diagnose(case: Case, say: Callable[[str], None] = lambda text: None, rules: Rules = ALL) -> Diagnosis:
    """Diagnose a case; `say` is told where the search stands."""
    search = run(pose(case, rules=rules), say)
    answer = conclude(search, say)
    search = answer.search
    say(f"verdict: {answer.main}")
    entry, mission = propose(search)
    found = Diagnosis(case, search, answer, answer.shrinkage, entry, mission)
    if found.verdict == "unknown":
        learn(found, say)
    return found


def learn(diagnosis: Diagnosis, say: Callable[[str], None]) -> None:
    """What an unknown gap does, as a correction, and how far it shrinks the gap; nothing where that would not help."""
    answer, shrinkage = diagnosis.answer, diagnosis.shrinkage
    correction = correct(answer.search, answer.course, answer.freed, say)
    if correction is None:
        return
    further = shrink_further(correction.search, correction.course, shrinkage.runs[BEFORE])
    if further.after < shrinkage.after:
        diagnosis.correction, diagnosis.further = correction, further


def unexplained(diagnosis: Diagnosis) -> dict[str, Any] | None:
    """The `unknown` entry of diagnosis.json: channel, axis and what the gap goes with, and its correction."""
    if diagnosis.verdict != "unknown":
        return None
    strongest, goes = strongest_left(diagnosis.answer.findings)
    found: dict[str, Any] = {
        "channel": None if strongest is None else strongest.channel,
        "goes_with": None if goes is None else {"channel": goes.channel, "what": goes.test, "sigma": goes.sigma},
        "correction": None,
    }
    if diagnosis.correction is not None and diagnosis.further is not None:
        further = diagnosis.further
        found["correction"] = diagnosis.correction.plain() | {
            "model": CORRECTION_FILE,
            "gap": by_channel(further.runs),
            "shrinkage": {"value": further.shrinkage, "ci90": list(further.ci90)},
        }
    return found


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
        "unknown": unexplained(diagnosis),
        "cautions": diagnosis.cautions,
        "not_asked": not_asked(diagnosis.answer.search.problem),
        "identify_first": diagnosis.identify_first,
        "next_run": diagnosis.next_run,
    }


def effects_of(course: Course) -> dict[str, dict[str, float]]:
    """A candidate's effects with their values, as a corrected model holds them."""
    found: dict[str, dict[str, float]] = {}
    for free, value in zip(course.free, course.values, strict=True):
        if free.label in catalogue():
            found.setdefault(free.label, {})[free.name] = float(value * free.spread)
    return found


def write(diagnosis: Diagnosis, out: Path) -> None:
    """diagnosis.json and corrected.toml into a folder."""
    out.mkdir(parents=True, exist_ok=True)

    def model(search: Search, course: Course) -> str:
        P, F = search.model(course)
        return corrected_text(diagnosis.case.vehicle_name, search.problem.model.P, P, F, effects_of(course))

    (out / "next_run.toml").write_text(diagnosis.mission, encoding="utf-8")
    (out / "corrected.toml").write_text(model(diagnosis.search, diagnosis.answer.course), encoding="utf-8")
    if diagnosis.correction is not None:
        text = model(diagnosis.correction.search, diagnosis.correction.course)
        (out / CORRECTION_FILE).write_text(text, encoding="utf-8")
    (out / "diagnosis.json").write_text(json.dumps(as_plain(plain(diagnosis)), indent=1) + "\n", encoding="utf-8")
