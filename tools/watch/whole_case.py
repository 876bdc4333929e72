"""Diagnosis of ocean gliders: which effect do all runs of a case have, beside what the vehicle file allows?

The watch's parabolas, with one span: all runs (docs/OCEAN.md, Diagnosis). Written as docs/GAP.md says.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from sim_backend.ocean.catalogue import NOT_ASKED
from sim_backend.ocean.vehicle import PLACES, OceanVehicle
from tools.data.errors import InputError
from tools.data.plain import as_plain
from tools.data.runs.case import Case
from tools.data.runs.csvfile import write_bytes
from tools.diagnose.record import ANSWER, NONE, UNKNOWN
from tools.diagnose.search import EVIDENCE_NEEDED
from tools.diagnose.shrink import AFTER, BEFORE, FLOOR, RECALIBRATED, by_channel, shrinkage_of
from tools.diagnose.verdict import ERROR_RATE, TIE, softmax
from tools.gap.measure import RunGap, run_gap
from tools.identify.ocean.files import corrected_text
from tools.identify.ocean.identify import WORTH, parted_by
from tools.inference.expansion import Expansion, expand
from tools.inference.fit import bounded_step
from tools.inference.parameters import NINETY
from tools.inference.predict import fly_windows_from
from tools.inference.problem import Problem, cut, problem_of
from tools.inference.shared_model import fit_shared, heat_of
from tools.inference.shared_parameters import SharedParameters, shared_parameters
from tools.inference.steady import first_values
from tools.watch.answer import CAUSE
from tools.watch.events import STEP, Change, Joint, Span
from tools.watch.watch import usable_runs

ABSENT = 1e-6  # spreads: of an effect that is not asked for
MOST_RUNS = 40
SEED = 20261122
CORRECTED = "corrected.toml"
Model = tuple[np.ndarray, np.ndarray]


@dataclass
class OceanDiagnosis:
    """What was found of a case."""

    case: Case
    runs: list[str]
    verdict: str
    selected: str | None
    probabilities: dict[str, float]
    groups: dict[str, list[str]]
    sizes: dict[str, tuple[float, float, str, str]]  # by label: size, 1 sigma, unit, name of the parameter
    where: list[dict[str, Any]]
    gaps: dict[str, list[RunGap]]
    shrinkage: tuple[float, float, float]  # with its 90 % interval over runs
    closed: tuple[float, float, float]
    evidence: dict[str, float]  # nat over no effect
    skipped: dict[str, str]
    model: Model
    allowed: list[str]  # what the vehicle file leaves so open that no effect beside it can be seen


def diagnose_ocean(case: Case, say: Callable[[str], None] = lambda text: None) -> OceanDiagnosis:
    """The effect that all runs of a case have in common; InputError where none can be judged."""
    usable, out = usable_runs(case.runs, True)
    skipped = {case.runs[n].name: why for n, why in out.items()}
    if not usable:
        name, why = next(iter(skipped.items()))
        raise InputError(f"no run can be judged: {name}: {why}", source=case.folder)
    runs = [usable[n] for n in sorted(usable)][:MOST_RUNS]
    problem = problem_of(case, runs=runs)
    parts = [problem.part(n) for n in range(len(runs))]
    shared = replace(shared_parameters(problem), allowed=1.0, effects=ABSENT)
    heat = max(1.0, len(runs) / WORTH)
    x = fit_shared(parts, shared, first_values(problem, shared.free), heat)
    say(f"{len(runs)} runs; what the vehicle file allows, fitted")
    found = [expand(part, shared, x) for part in parts]
    heat = max(heat, heat_of(found))
    listed = Joint(shared, [one.cooled(heat) for one in found], []).changes([Span(0, len(runs), STEP)])
    evidence = {one.label: one.evidence for one in listed}
    by_label = {one.label: one for one in listed}
    best = max(evidence, key=lambda label: evidence[label])
    say(f"most evident: {best}, {evidence[best]:.1f} nat")
    with_best, y = fitted_with(parts, shared, by_label[best], x, heat)
    gaps = left_out_gaps(problem, parts, (shared, x), (with_best, y), found, heat)
    matters = moves(gaps) >= problem.kind.matters
    selected = best if evidence[best] >= EVIDENCE_NEEDED and matters else None
    if selected is None:
        gaps[AFTER] = gaps[RECALIBRATED]
    alike = problem.kind.form_share * max(by_label[best].gain, 0.0)
    near = {label: value + min(alike, evidence[best] - value) for label, value in evidence.items()}
    odds = softmax({NONE: EVIDENCE_NEEDED if matters else EVIDENCE_NEEDED + max(near.values()), **near})
    chances = {label: (1.0 - ERROR_RATE) * p for label, p in odds.items()} | {UNKNOWN: ERROR_RATE}
    alike_group = problem.one_group if best in problem.one_group else ()
    tied = sorted((n for n in near if near[best] - near[n] <= TIE), key=lambda n: -near[n])
    group = [best, *(n for n in alike_group or tied if n != best)]
    effects = problem.kind.catalogue()
    where: dict[tuple[str, str], float] = {}
    for label, chance in chances.items():
        if label in effects:
            where[effects[label].place] = where.get(effects[label].place, 0.0) + chance
    places = [{"subsystem": s, "element": e, "probability": p} for (s, e), p in
              sorted(where.items(), key=lambda item: -item[1])]  # fmt: skip
    return OceanDiagnosis(
        case, [run.name for run in runs], NONE if selected is None else CAUSE, selected, chances,
        {} if selected is None else {best: group}, sizes(shared, listed, problem.kind.form), places, gaps,
        *closings(gaps), evidence, skipped,
        shared.model(problem, x) if selected is None else with_best.model(problem, y), open_numbers(problem),
    )  # fmt: skip


def fitted_with(
    parts: list[Problem], shared: SharedParameters, change: Change, x: np.ndarray, heat: float
) -> tuple[SharedParameters, np.ndarray]:
    """The model with an effect in all runs, fitted, from what its parabola promises."""
    own = set(shared.labels[change.label])
    free = [replace(one, label="") if k in own else one for k, one in enumerate(shared.free)]
    asked = replace(shared, free=free)
    y = x.copy()
    y[shared.labels[change.label]] += change.size
    return asked, fit_shared(parts, asked, np.clip(y, asked.low, asked.high), heat)


def open_numbers(problem: Problem) -> list[str]:
    """Numbers that [uncertainty] leaves open by more than a tenth of their size."""
    P, sigma = problem.model.P, problem.model.sigma
    names = {place: name for name, place in PLACES.items()}
    free = [int(k) for k in np.flatnonzero(sigma > 0.0) if int(k) in names]
    return [names[k] for k in free if sigma[k] > 0.1 * max(abs(P[k]), 1e-12)]


def left_out_gaps(
    problem: Problem, parts: list[Problem], plain: tuple[SharedParameters, np.ndarray],
    more: tuple[SharedParameters, np.ndarray], found: list[Expansion], heat: float,
) -> dict[str, list[RunGap]]:
    """Gaps by run: nominal, recalibrated and corrected without the run, and of simulated runs."""
    rng = np.random.default_rng(SEED)
    about = [expand(part, more[0], more[1]) for part in parts]
    steps = {RECALIBRATED: without_each(*plain, found, heat), AFTER: without_each(*more, about, heat)}
    gaps: dict[str, list[RunGap]] = {BEFORE: [], RECALIBRATED: [], AFTER: [], FLOOR: []}
    for n, part in enumerate(parts):
        models = {
            BEFORE: (problem.model.P, plain[0].model(part, 0.0 * plain[1])[1]),
            RECALIBRATED: plain[0].model(part, steps[RECALIBRATED][n]),
            AFTER: more[0].model(part, steps[AFTER][n]),
        }
        for name, model in models.items():
            gaps[name].append(gap_of(part, model))
        model = models[AFTER]
        z = part.simulated(*model, part.filter(*model).X[:1].copy(), rng)
        gaps[FLOOR].append(gap_of(replace(part, z=np.where(part.valid, z, np.nan)), model, z))
    return gaps


def without_each(
    shared: SharedParameters, x: np.ndarray, found: list[Expansion], heat: float
) -> list[np.ndarray]:
    """Values fitted without each run, to first order; of a single run those fitted to it."""
    if len(found) == 1:
        return [x]
    prior = np.diag(shared.prior**-2.0)
    normal = sum(one.curvature for one in found) / heat + prior
    slope = sum(one.slope for one in found) / heat + prior @ x
    low, high = np.minimum(shared.low - x, 0.0), np.maximum(shared.high - x, 0.0)
    still = bounded_step(normal, slope, low, high)
    return [
        x + np.clip(bounded_step(normal - one.curvature / heat, slope - one.slope / heat, low, high) - still, low, high)
        for one in found
    ]


def gap_of(part: Problem, model: Model, z: np.ndarray | None = None) -> RunGap:
    """A run's gap to a model whose own filter finds where windows start; z (rows, N_Y) instead of what was measured."""
    Y = fly_windows_from(part, *model, part.filter(*model))
    return run_gap(part.kind.measures, part.runs[0], Y, cut(part).listed[0], z)


def moves(gaps: dict[str, list[RunGap]]) -> float:
    """By how much the effect closes a channel's gap on left-out runs at most: root of the difference of squares."""
    before, after = by_channel(gaps[RECALIBRATED]), by_channel(gaps[AFTER])
    return float(np.sqrt(max([0.0, *(before[name] ** 2 - after[name] ** 2 for name in after if name in before)])))


def closings(gaps: dict[str, list[RunGap]]) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Shrinkage and how much is closed, each with a 90 % interval over runs."""
    found = shrinkage_of(gaps, {})
    return (found.shrinkage, *found.ci90), (found.closed, *found.closed_ci90)


def sizes(shared: SharedParameters, listed: list[Change], form: float) -> dict[str, tuple[float, float, str, str]]:
    """Each label's size alone, SI."""
    found = {}
    for one in listed:
        free = shared.free[shared.labels[one.label][0]]
        value = float(one.size[0]) * free.spread
        sigma = float(np.sqrt(np.linalg.inv(one.precision)[0, 0])) * free.spread
        found[one.label] = value, float(np.hypot(sigma, form * value)), free.unit, free.name
    return found


def plain(found: OceanDiagnosis) -> dict[str, Any]:
    """diagnosis.json (docs/GAP.md, Answers)."""
    causes = []
    for label, p in sorted(found.probabilities.items(), key=lambda item: -item[1]):
        own = {}
        if label in found.sizes:
            size, sigma, unit, name = found.sizes[label]
            ci = [size - NINETY * sigma, size + NINETY * sigma]
            own = {name: {"estimate": size, "ci90": ci, "unit": unit}}
        causes.append({"label": label, "probability": p, "group": found.groups.get(label, [label]), "parameters": own})
    table: dict[str, Any] = {name: by_channel(found.gaps[name]) for name in (BEFORE, RECALIBRATED, AFTER, FLOOR)}
    for name, value in (("shrinkage", found.shrinkage), ("closed", found.closed)):
        table[name] = {"value": value[0], "ci90": list(value[1:])}
    group = found.groups.get(found.selected or "", [])
    told = parted_by(GROUP_NAMES.get(label, label) for label in group)
    return {
        "format": 1,
        "kind": "ocean",
        "case": {"name": found.case.folder.resolve().name, "vehicle": found.case.vehicle.name, "runs": len(found.runs)},
        "verdict": found.verdict,
        "where": found.where,
        "causes": causes,
        "selected": [] if found.selected is None else [found.selected],
        "gap": table,
        "next_run": {"text": told} if told else {},
        "readings": [],
        "stages": [
            {"stage": "nominal", "gap": table[BEFORE]}, {"stage": "recalibrated", "gap": table[RECALIBRATED]},
            *([] if found.selected is None else [{"stage": f"+ {found.selected}", "gap": table[AFTER]}]),
        ],
        "cautions": cautions(found),
        "not_asked": NOT_ASKED,
        "skipped": found.skipped,
        "evidence": found.evidence,
    }  # fmt: skip


GROUP_NAMES = {"drag": "Cd0", "lift": "lift_slope", "attitude_scale": "pitch_scale", "net_buoyancy": "volume",
               "ballast_scale": "oil_scale"}  # fmt: skip


def cautions(found: OceanDiagnosis) -> list[str]:
    """What has to be said with the answer."""
    told = []
    if found.allowed:
        told.append(
            f"the vehicle file leaves {', '.join(found.allowed)} open: what they can make up for is no effect here; "
            "identify the vehicle first (glider identify), and ask for what changed (glider gap watch)"
        )
    if len(found.runs) == 1:
        told.append("one run only: nothing is left out, the gaps are those of runs that were fitted")
    return told


def write(found: OceanDiagnosis, out: Path) -> None:
    """diagnosis.json and corrected.toml into a folder."""
    vehicle = found.case.vehicle
    assert isinstance(vehicle, OceanVehicle)
    out.mkdir(parents=True, exist_ok=True)
    write_bytes(out / CORRECTED, corrected_text(vehicle, *found.model).encode("utf-8"))
    write_bytes(out / ANSWER, (json.dumps(as_plain(plain(found)), indent=1) + "\n").encode())
