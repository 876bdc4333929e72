"""The diagnosis of a user's vehicle: the posterior of a case's runs as an answer (docs/reference/gap.md, Answers)."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.data.intervals import NINETY
from glider.tools.data.plain import as_plain
from glider.tools.own.decision import (
    MATERIAL,
    NONE,
    UNKNOWN,
    Healthy,
    Hypothesis,
    Posterior,
    confounded,
    from_one_session,
    group_of,
    moves_of,
)
from glider.tools.own.effects import NOISE, READ_ROWS, UNEXPLAINED, ModelPoint, effects_of
from glider.tools.own.evidence import interval
from glider.tools.own.healthy import effect_point, healthy_of
from glider.tools.own.identified import toml_text
from glider.tools.own.load import LoadedVehicle
from glider.tools.own.measure import gap_row
from glider.tools.own.model_files import moved_to, write_with_folders
from glider.tools.own.noise_hypotheses import posterior_of
from glider.tools.own.observer import Observer
from glider.tools.own.observers import observer_of
from glider.tools.own.posterior import Engine
from glider.tools.own.runs import OwnRun

ANSWER, CORRECTED = "diagnosis.json", "corrected.toml"
SELECTED = 0.9  # probability that an effect of this label, or of its group, is there
LEAST_PROBABILITY = 0.005
KIND = "own"


def diagnose_own(
    vehicle: LoadedVehicle, runs: Sequence[OwnRun], say: Callable[[str], None] = lambda text: None
) -> tuple[Posterior, Observer]:
    """Posterior of what the runs of a case have, beside what the vehicle file allows for."""
    observer = observer_of(vehicle, list(runs))
    for note in observer.notes:
        say(note)
    return posterior_of(Engine(observer, healthy_of(observer), say)), observer


def verdict_of(chances: dict[str, float]) -> str:
    """none, unknown or cause, whichever is most probable."""
    cause = sum(p for label, p in chances.items() if label not in (NONE, UNKNOWN))
    return max((chances[NONE], NONE), (chances[UNKNOWN], UNKNOWN), (cause, "cause"))[1]


def plain(vehicle: LoadedVehicle, observer: Observer, found: Posterior, case: str) -> dict[str, Any]:
    """diagnosis.json."""
    healthy, best = found.healthy, found.best
    effects = {one.label: one for one in healthy.effects}
    verdict, group = verdict_of(found.chances), group_of(found.chances)
    chosen = _of_verdict(found, verdict, group)
    sizes = _sizes(found, effects)
    selected = [
        label for label in chosen.labels
        if effects[label].family not in UNEXPLAINED and _selected(found, label, group)
    ]  # fmt: skip
    if verdict == "cause" and not selected:
        selected = group[:1]
    if verdict == NONE:
        selected = []
    causes = [
        {"label": label, "probability": p, "group": group if group[:1] == [label] else [label],
         "parameters": {label: sizes[label]} if label in sizes else {}}
        for label, p in sorted((dict.fromkeys(selected, 0.0) | found.chances).items(), key=lambda one: -one[1])
    ]  # fmt: skip
    gap, corrected = _gaps(observer, healthy, chosen, selected, found)
    where: dict[tuple[str, str], float] = {}
    for label, p in found.chances.items():
        if label in effects:
            where[effects[label].where] = where.get(effects[label].where, 0.0) + p
    cautions = list(observer.notes)
    if vehicle.file.identified is None:
        cautions.append(
            "the vehicle file is not identified: `glider identify` on healthy runs says what it leaves of them"
        )
    if verdict == "cause":
        known = [] if vehicle.file.identified is None else from_one_session(healthy.sessions)
        cautions += [*confounded(group, "these runs"), *worse(gap), *known]
    if verdict == NONE and best.labels and max(moves_of(best, healthy, found.reach).values()) < MATERIAL:
        there = ", ".join(_named(label, sizes[label]) for label in best.labels)
        cautions.append(f"{there}: it is there, but moves no channel by {MATERIAL:g} tolerances, so it is no gap")
    if vehicle.level and not vehicle.kernels.compiled:
        cautions.append(f"the model runs as {vehicle.kernels.said}")
    return {
        "format": 1, "kind": KIND, "case": {"name": case, "vehicle": vehicle.name, "runs": len(observer.runs)},
        "verdict": verdict,
        "where": [{"subsystem": s, "element": e, "probability": p}
                  for (s, e), p in sorted(where.items(), key=lambda one: -one[1]) if p >= LEAST_PROBABILITY],
        "causes": causes, "selected": selected, "gap": gap, "next_run": {}, "readings": [], "stages": [],
        "cautions": cautions, "horizon_s": observer.horizon,
        "hypotheses": [
            {"labels": list(one.labels), "log_evidence": one.evidence - best.evidence, "probability": float(weight),
             "left": float(np.sqrt(one.left.mean())), "strange": one.strange}
            for weight, one in sorted(zip(found.weights, found.hypotheses, strict=True), key=lambda one: -one[0])
            if weight >= LEAST_PROBABILITY
        ],
        "corrected": corrected,
    }  # fmt: skip


def worse(gap: dict[str, Any]) -> list[str]:
    """A caution, where the corrected vehicle predicts the runs worse than the one that was given."""
    before, after = gap["before"]["total"], gap["after"]["total"]
    if gap["shrinkage"]["value"] is None or after <= before:
        return []
    return [
        f"with this cause in the model the gap grows, {before:.2f} -> {after:.2f} tolerances: "
        "it explains these runs only together with deviations of each run's own"
    ]


def _of_verdict(found: Posterior, verdict: str, group: Sequence[str]) -> Hypothesis:
    """The most probable hypothesis that the verdict speaks of: of causes, with the most probable one in it."""
    if verdict == NONE:
        return next(one for one in found.hypotheses if not one.labels)
    if verdict == UNKNOWN:
        return found.best
    among = [n for n, one in enumerate(found.hypotheses) if group[0] in one.labels]
    return found.hypotheses[max(among, key=lambda n: found.weights[n])]


def _selected(found: Posterior, label: str, group: Sequence[str]) -> bool:
    """Whether the label, or one that is as good, is in nearly every probable hypothesis."""
    confounded = [label, *(group if label in group else [])]
    return (
        float(
            sum(w for w, one in zip(found.weights, found.hypotheses, strict=True) if set(confounded) & set(one.labels))
        )
        >= SELECTED
    )


def _sizes(found: Posterior, effects) -> dict[str, dict[str, Any]]:
    """Each label's size with its 90 % interval, by the most probable hypothesis that has it."""
    sizes: dict[str, dict[str, Any]] = {}
    for one in sorted(found.hypotheses, key=lambda one: -one.evidence):
        for label, size, sd in zip(one.labels, one.changes, one.sd, strict=True):
            if label not in sizes:
                effect = effects[label]
                sizes[label] = {"estimate": float(size * effect.spread), "ci90": interval(effect, size, sd),
                                "unit": effect.unit}  # fmt: skip
    return sizes


def _gaps(observer: Observer, healthy: Healthy, chosen: Hypothesis, selected: Sequence[str], found: Posterior):
    """Gaps of the case's runs before, recalibrated, after and floor; the corrected vehicle's numbers."""
    names = [one.name for one in observer.declared.outputs]
    nothing = next(one for one in found.hypotheses if not one.labels)
    size = dict(zip(chosen.labels, chosen.changes, strict=True))
    changed = effect_point(observer, healthy, selected, np.array([size[label] for label in selected]))
    recalibrated = effect_point(observer, healthy, [one.label for one in healthy.effects], nothing.shared)
    tables = {}
    for name, point in (("before", observer.point), ("recalibrated", recalibrated), ("after", changed)):
        tables[name] = np.array([observer.gaps(n, point, observer.horizon) for n in range(len(observer.runs))])
    runs = {name: np.sqrt(np.nanmean(one**2, axis=1)) for name, one in tables.items()}
    floor = healthy.errors.scales

    gap: dict[str, Any] = {name: gap_row(names, table) for name, table in tables.items()}
    gap["floor"] = {**dict(zip(names, map(float, floor), strict=True)), "total": float(np.sqrt(np.mean(floor**2)))}
    # noise is not predicted: it shrinks no gap
    shrinking = any(one.family != NOISE for one in healthy.effects if one.label in selected)
    before, after, low = gap["before"]["total"], gap["after"]["total"], gap["floor"]["total"]
    gap["shrinkage"] = {"value": 1.0 - after / before if shrinking else None, "ci90": _interval(runs, None)}
    gap["closed"] = {"value": (before - after) / (before - low) if shrinking and before > low else None,
                     "ci90": _interval(runs, low)}  # fmt: skip
    return gap, _numbers(observer, changed)


def _interval(runs: dict[str, np.ndarray], floor: float | None) -> list[float | None]:
    """90 % of a shrinkage over runs, from its scatter; None for a single run."""
    before, after = runs["before"], runs["after"]
    if len(before) < 2:
        return [None, None]
    below = before - (0.0 if floor is None else floor)
    values = (before - after) / np.where(np.abs(below) > 1e-9, below, np.nan)
    mean, error = float(np.nanmean(values)), float(np.nanstd(values, ddof=1) / np.sqrt(len(values)))
    return [mean - NINETY * error, mean + NINETY * error]


def _numbers(observer: Observer, point: ModelPoint) -> dict[str, Any]:
    """The corrected vehicle as numbers: parameters, what sensors read wrongly, what inputs do wrongly."""
    declared, base = observer.declared, observer.point
    theta = {one.name: float(value) for one, value in zip(declared.parameters, point.theta, strict=True)}
    sensors = {
        one.name: {kind: float(value) for kind, value, known in zip(READ_ROWS, *rows, strict=True) if value != known}
        for one, *rows in zip(declared.outputs, point.reading.T, base.reading.T, strict=True)
    }
    inputs = {declared.inputs[n].name: wrong for n, wrong in point.driven.items()}
    return {"parameters": theta, "sensors": {name: one for name, one in sensors.items() if one}, "inputs": inputs,
            "effects": effects_of(declared, point)}  # fmt: skip


def write(vehicle: LoadedVehicle, observer: Observer, found: Posterior, case: str, out: Path) -> dict[str, Any]:
    """diagnosis.json and corrected.toml into a folder; the answer."""
    import tomllib

    answer = plain(vehicle, observer, found, case)
    given = tomllib.loads(vehicle.text)
    for name, value in answer["corrected"]["parameters"].items():
        given.setdefault("parameters", {}).setdefault(name, {})["value"] = value
    given["effects"] = answer["corrected"]["effects"]
    files, given = moved_to(out, vehicle, given)
    files[out / ANSWER] = (json.dumps(as_plain(answer), indent=1) + "\n").encode("utf-8")
    files[out / CORRECTED] = toml_text(given).encode("utf-8")
    write_with_folders(files)
    return answer


def sentence(answer: dict[str, Any]) -> str:
    """The verdict in one sentence: label, size with its interval, what is as good."""
    if answer["verdict"] == NONE:
        return "nothing beyond what healthy runs leave"
    if answer["verdict"] == UNKNOWN:
        left = answer["gap"]["before"]["total"]
        return f"more is left than healthy runs leave, and no label explains it ({left:.2f} tolerances)"
    cause = next(one for one in answer["causes"] if one["label"] not in (NONE, UNKNOWN))
    others = [label for label in cause["group"] if label != cause["label"]]
    confounded = f"; these runs do not tell it from {', '.join(others)}" if others else ""
    beside = [_named(one["label"], one["parameters"][one["label"]]) for one in answer["causes"]
              if one["label"] in answer["selected"] and one["label"] not in cause["group"]]  # fmt: skip
    text = f"{_named(cause['label'], cause['parameters'].get(cause['label']))}, probability {cause['probability']:.2f}"
    return text + confounded + (f"; beside it {', '.join(beside)}" if beside else "")


def _named(label: str, size: dict[str, Any] | None) -> str:
    """A label with its size and the interval of that."""
    if size is None:
        return label
    unit = "" if size["unit"] == "1" else f" {size['unit']}"
    return f"{label} {size['estimate']:+.3g}{unit} (90 %: {size['ci90'][0]:.3g} to {size['ci90'][1]:.3g})"
