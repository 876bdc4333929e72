"""Diagnosis of ocean gliders: which effect do all runs of a case have, beside what the vehicle file allows?

The watch's parabolas, with one span: all runs (docs/explanation/ocean.md, Diagnosis). Written as docs/reference/gap.md
says.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from glider.sim_backend.ocean.catalogue import NOT_ASKED
from glider.sim_backend.ocean.vehicle import PLACES, OceanVehicle
from glider.tools.data.errors import InputError
from glider.tools.data.files import write_files
from glider.tools.data.plain import as_plain
from glider.tools.data.runs.case import Case
from glider.tools.data.runs.run import Run
from glider.tools.diagnose.cautions import below_floor
from glider.tools.diagnose.noise_probes import VERTICAL_WATER
from glider.tools.diagnose.probabilities import softmax
from glider.tools.diagnose.record import ANSWER, NONE, UNKNOWN
from glider.tools.diagnose.shrink import AFTER, BEFORE, FLOOR, RECALIBRATED, by_channel, shrinkage_of
from glider.tools.gap.measure import RunGap, case_channels, root_mean_square, run_gap
from glider.tools.identify.ocean.files import corrected_text
from glider.tools.identify.ocean.findings import Calibration, far_from_file, one_of_each_group
from glider.tools.identify.ocean.identify import EFFECTIVE_DIVES, precision_of
from glider.tools.identify.ocean.levels import find_levels, some_runs
from glider.tools.identify.ocean.next_run import flown, to_find, to_part
from glider.tools.inference.fit import bounded_step
from glider.tools.inference.hyperparameters import DIAGNOSIS, WATCH
from glider.tools.inference.parameters import NINETY
from glider.tools.inference.predict import fly_windows_from
from glider.tools.inference.problem import Problem, cut, problem_of
from glider.tools.inference.shared_model import About, fit_shared, inflation_of
from glider.tools.inference.shared_parameters import shared_parameters
from glider.tools.inference.steady import first_values
from glider.tools.watch.answer import CAUSE
from glider.tools.watch.lasting import beside_all
from glider.tools.watch.usable import usable_dives
from glider.tools.watch.whole_left import UnexplainedResidual, disturbed, excess_water_noise_of, what_is_left
from glider.tools.watch.whole_search import (
    Model,
    Round,
    SelectionResult,
    Whole,
    forward_select,
    whole_model,
)

ABSENT = 1e-6  # spreads: of an effect that is not asked for
MOST_RUNS = 40
SEED, DRAWS = 20261122, 4
CORRECTED = "corrected.toml"


@dataclass
class OceanDiagnosis:
    """What was found of a case."""

    case: Case
    runs: list[str]
    verdict: str
    selected: list[str]  # the main one first
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
    left: UnexplainedResidual | None  # what no label explains
    flown: list[Run]
    findings: list[Calibration]  # calibrations that the file allows, or nearly, and that are far from it


def diagnose_ocean(case: Case, say: Callable[[str], None] = lambda text: None) -> OceanDiagnosis:
    """The effect that all runs of a case have in common; InputError where none can be judged."""
    usable, out = usable_dives(case.runs)
    skipped = {case.runs[n].name: why for n, why in out.items()}
    if not usable:
        name, why = next(iter(skipped.items()))
        raise InputError(f"no run can be judged: {name}: {why}", source=case.folder)
    runs = [usable[n] for n in sorted(usable)][:MOST_RUNS]
    problem = problem_of(case, runs=runs)
    parts = [problem.part(n) for n in range(len(runs))]
    shared = replace(shared_parameters(problem), allowed=1.0, effects=ABSENT)
    inflation, about = max(1.0, len(runs) / EFFECTIVE_DIVES), About(parts, shared)
    x = fit_shared(parts, shared, first_values(problem, shared.free), inflation, about)
    identified = case.vehicle.identified is not None
    if not identified:  # its noise is any vehicle's
        case = find_levels(case, problem_of(case, runs=some_runs(runs)), *shared.model(problem, x))
        problem = problem_of(case, runs=runs)
        parts = [problem.part(n) for n in range(len(runs))]
        about = About(parts, shared)
        x = fit_shared(parts, shared, x, inflation, about)
    inflation = max(inflation, inflation_of(about(x)))
    start = whole_model(parts, shared, x, inflation, about=about)
    say(f"{len(runs)} runs; what the vehicle file allows, fitted")
    selection = forward_select(parts, start, inflation)
    gaps = left_out_gaps(problem, parts, start, selection.model, inflation)
    if selection.model is not start and not identified and closes(gaps) < problem.kind.material:
        selection.model, gaps = start, left_out_gaps(problem, parts, start, start, inflation)
    model, main = selection.model, selection.main
    say(f"most evident: {main.best}, {main.evidence[main.best]:.1f} nat; {len(model.labels)} effects")
    left = what_is_left(parts, problem, model, gaps[AFTER], gaps[FLOOR])
    noisy = with_excess_water_noise(problem, parts, start, model, inflation, left, gaps)
    chances, group = chances_of(problem, main, bool(model.labels), left.probability)
    groups = groups_beside(problem, main.before, inflation) | {group[0]: group}
    selected = sorted(model.labels, key=lambda label: label != main.best)
    if noisy is not None:
        gaps[FLOOR], left = noisy
        chances = with_water(chances, left.probability)
        selected = [VERTICAL_WATER, *selected]
    unknown = left.probability > WATCH.majority
    verdict = UNKNOWN if unknown else CAUSE if selected else NONE
    selected = [] if unknown else selected
    return OceanDiagnosis(
        case, [run.name for run in runs], verdict, selected, chances, groups,
        sizes(selection, problem.kind.form), places(problem, chances, left if unknown else None), gaps, *closings(gaps),
        main.evidence, skipped, model.shared.model(problem, model.x), open_numbers(problem), left if unknown else None,
        runs, findings(problem, start, inflation),
    )  # fmt: skip


def findings(problem: Problem, start: Whole, inflation: float) -> list[Calibration]:
    """Calibrations that the file allows for, fitted without an effect, where they are far from the file."""
    own = [k for k, one in enumerate(start.shared.free) if not one.label]
    normal, slope = precision_of(start.about, start.shared, start.x, inflation)
    free = [start.shared.free[k] for k in own]
    sentences = far_from_file(
        free, start.x[own], normal[np.ix_(own, own)], slope[own], problem.model.P, [problem.one_group]
    )
    return one_of_each_group(sentences)


def with_excess_water_noise(
    problem: Problem,
    parts: list[Problem],
    start: Whole,
    model: Whole,
    inflation: float,
    left: UnexplainedResidual,
    gaps: dict[str, list[RunGap]],
) -> tuple[list[RunGap], UnexplainedResidual] | None:
    """The floor in water that is as rough as the readings ask for, and what is left then: where that is nothing, and
    where the water explains nearly all that can be explained, and nothing that lasts is beside it.
    """
    if left.probability <= WATCH.majority:
        return None
    found = excess_water_noise_of(problem, left.probed)
    explained = 0.5 * inflation * (start.cost - model.cost)
    if found is None or found.gain < WATCH.water_share * (found.gain + explained):
        return None
    beside = beside_all([disturbed(part, found) for part in parts], model.shared, model.x, inflation)
    moved = beside.moves(problem.kind.measures)
    if beside.chance(WATCH.lasting_odds) > WATCH.majority and moved >= problem.kind.material:
        return None  # water has no lasting direction
    rng = np.random.default_rng(SEED)
    models = [model.shared.model(part, x) for part, x in zip(parts, without_each(model, inflation), strict=True)]
    floor = [floor_of(part, one, disturbed(part, found), rng) for part, one in zip(parts, models, strict=True)]
    then = what_is_left(parts, problem, model, gaps[AFTER], floor)
    return None if then.probability > WATCH.majority else (floor, then)


def with_water(chances: dict[str, float], unknown: float) -> dict[str, float]:
    """Probabilities where excess water noise is the main cause."""
    others = {label: (1.0 - WATCH.water_share) * p for label, p in chances.items() if label != UNKNOWN}
    unknown = max(unknown, DIAGNOSIS.error_rate)
    rest = 1.0 - unknown
    water = rest - sum(others.values())
    return others | {VERTICAL_WATER: water, UNKNOWN: unknown}


def chances_of(problem: Problem, main: Round, there: bool, unknown: float) -> tuple[dict[str, float], list[str]]:
    """Probabilities of the main cause, of none and of an unknown one, and the labels that are one with the best.

    there: whether an effect was taken into the model.
    """
    best, evidence = main.best, main.evidence
    confounded = problem.kind.form_share * max(main.changes[best].gain, 0.0)
    near = {label: value + min(confounded, evidence[best] - value) for label, value in evidence.items()}
    none = DIAGNOSIS.evidence_needed if there else DIAGNOSIS.evidence_needed + max(near.values())
    odds = softmax({NONE: none, **near})
    unknown = max(unknown, DIAGNOSIS.error_rate)
    chances = {label: (1.0 - unknown) * p for label, p in odds.items()} | {UNKNOWN: unknown}
    confounded_group = problem.one_group if best in problem.one_group else ()
    tied = sorted((n for n in near if near[best] - near[n] <= DIAGNOSIS.confounded_evidence), key=lambda n: -near[n])
    return chances, [best, *(n for n in confounded_group or tied if n != best)]


def groups_beside(problem: Problem, model: Whole, inflation: float) -> dict[str, list[str]]:
    """By label those that the dives do not tell from it, all that is allowed beside it free; itself first."""
    shared = model.shared
    A = np.array(sum(one.curvature for one in model.about)) / inflation
    own = [k for k, one in enumerate(shared.free) if not one.label]
    allowed = A[np.ix_(own, own)] + np.diag(shared.prior[own] ** -2.0)
    left = A - A[:, own] @ np.linalg.solve(allowed, A[own, :])
    found = {}
    for label, columns in shared.labels.items():
        group = [label]
        for other, others in shared.labels.items():
            sizes = np.sqrt(np.outer(np.diag(left)[columns], np.diag(left)[others]))
            same = label in problem.one_group and other in problem.one_group
            if other != label and (same or (np.abs(left[np.ix_(columns, others)]) > WATCH.same_cosine * sizes).all()):
                group.append(other)
        found[label] = group
    return found


def places(problem: Problem, chances: dict[str, float], left: UnexplainedResidual | None) -> list[dict[str, Any]]:
    """Where the cause is, by its labels; of an unknown one by the probes that gain, and where none does by the labels
    that come nearest to it.
    """
    effects, where = problem.kind.catalogue(), dict[tuple[str, str], float]()
    gains = [] if left is None else [(one.probe.subsystem, one.probe.element, one.gain) for one in left.probed]
    if sum(gain for _, _, gain in gains) >= DIAGNOSIS.evidence_needed:
        weights = [((s, e), gain) for s, e, gain in gains if gain > 0.0]
    else:
        weights = [(effects[label].place, chance) for label, chance in chances.items() if label in effects]
    whole = sum(weight for _, weight in weights) if left is not None else 1.0
    for place, weight in weights:
        where[place] = where.get(place, 0.0) + weight / max(whole, 1e-12)
    return [{"subsystem": s, "element": e, "probability": p} for (s, e), p in
            sorted(where.items(), key=lambda item: -item[1])]  # fmt: skip


def open_numbers(problem: Problem) -> list[str]:
    """Numbers that [uncertainty] leaves open by more than a tenth of their size."""
    P, sigma = problem.model.P, problem.model.sigma
    names = {place: name for name, place in PLACES.items()}
    free = [int(k) for k in np.flatnonzero(sigma > 0.0) if int(k) in names]
    return [names[k] for k in free if sigma[k] > 0.1 * max(abs(P[k]), 1e-12)]


def left_out_gaps(
    problem: Problem, parts: list[Problem], start: Whole, model: Whole, inflation: float
) -> dict[str, list[RunGap]]:
    """Gaps by run: nominal, recalibrated and corrected without the run, and of simulated runs."""
    rng = np.random.default_rng(SEED)
    recalibrated = without_each(start, inflation)
    after = recalibrated if model is start else without_each(model, inflation)
    gaps: dict[str, list[RunGap]] = {BEFORE: [], RECALIBRATED: [], AFTER: [], FLOOR: []}
    for n, part in enumerate(parts):
        models = {
            BEFORE: (problem.model.P, start.shared.model(part, 0.0 * start.x)[1]),
            RECALIBRATED: start.shared.model(part, recalibrated[n]),
            AFTER: model.shared.model(part, after[n]),
        }
        for name, one in models.items():
            same = name == AFTER and model is start
            gaps[name].append(gaps[RECALIBRATED][n] if same else gap_of(part, one))
        gaps[FLOOR].append(floor_of(part, models[AFTER], part, rng))
    return gaps


def floor_of(part: Problem, model: Model, noisy: Problem, rng: np.random.Generator) -> RunGap:
    """A run's gap to the model that is true of it, over DRAWS simulated runs of the noise that `noisy` knows of."""
    drawn, begins = [], part.filter(*model).X[:1].copy()
    for _ in range(DRAWS):
        z = noisy.simulated(*model, begins.copy(), rng)
        drawn.append(gap_of(replace(part, z=np.where(part.valid, z, np.nan)), model, z))
    channels = case_channels(drawn)
    return replace(drawn[0], channels=channels, total=root_mean_square(channels.values()))


def without_each(model: Whole, inflation: float) -> list[np.ndarray]:
    """Values fitted without each run, to first order; of a single run those fitted to it."""
    shared, x, found = model.shared, model.x, model.about
    if len(found) == 1:
        return [x]
    prior = np.diag(shared.prior**-2.0)
    normal = sum(one.curvature for one in found) / inflation + prior
    slope = sum(one.slope for one in found) / inflation + prior @ x
    low, high = np.minimum(shared.low - x, 0.0), np.maximum(shared.high - x, 0.0)
    still = bounded_step(normal, slope, low, high)
    return [
        x
        + np.clip(
            bounded_step(normal - one.curvature / inflation, slope - one.slope / inflation, low, high) - still,
            low,
            high,
        )
        for one in found
    ]


def gap_of(part: Problem, model: Model, z: np.ndarray | None = None) -> RunGap:
    """A run's gap to a model whose own filter finds where windows start; z (rows, N_Y) instead of what was measured."""
    Y = fly_windows_from(part, *model, part.filter(*model))
    return run_gap(part.kind.measures, part.runs[0], Y, cut(part).listed[0], z)


def closes(gaps: dict[str, list[RunGap]]) -> float:
    """By how much the effects close a channel's gap on left-out runs at most: root of the difference of squares.

    Asked for where the vehicle was not identified: a file of any such vehicle says too little of one to hold it to.
    """
    before, after = by_channel(gaps[RECALIBRATED]), by_channel(gaps[AFTER])
    return float(np.sqrt(max([0.0, *(before[name] ** 2 - after[name] ** 2 for name in after if name in before)])))


def closings(gaps: dict[str, list[RunGap]]) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Shrinkage and how much is closed, each with a 90 % interval over runs."""
    found = shrinkage_of(gaps, {})
    return (found.shrinkage, *found.ci90), (found.closed, *found.closed_ci90)


def sizes(selection: SelectionResult, form: float) -> dict[str, tuple[float, float, str, str]]:
    """Each label's size, SI: of those of the model by its fit, of others alone, as their parabola has it."""
    found, model = {}, selection.model
    for one in selection.main.changes.values():
        columns = model.shared.labels[one.label]
        free = model.shared.free[columns[0]]
        size = model.x[columns] if one.label in model.labels else one.size
        value = float(size[0]) * free.spread
        sigma = float(np.sqrt(np.linalg.inv(one.precision)[0, 0])) * free.spread
        found[one.label] = value, float(np.hypot(sigma, form * value)), free.unit, free.name
    return found


def plain(found: OceanDiagnosis) -> dict[str, Any]:
    """diagnosis.json (docs/reference/gap.md, Answers)."""
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
    how = flown(found.flown)
    if found.left is not None:
        sentences = to_find(found.left.regime, how)
    else:
        sentences = to_part([*(found.groups.get(label, []) for label in found.selected),
                        *(one.group for one in found.findings)], how)  # fmt: skip
    return {
        "format": 1,
        "kind": "ocean",
        "case": {"name": found.case.folder.resolve().name, "vehicle": found.case.vehicle.name, "runs": len(found.runs)},
        "verdict": found.verdict,
        "where": found.where,
        "causes": causes,
        "selected": found.selected,
        "gap": table,
        "next_run": {"text": sentences} if sentences else {},
        "readings": [],
        "stages": [
            {"stage": "nominal", "gap": table[BEFORE]}, {"stage": "recalibrated", "gap": table[RECALIBRATED]},
            *([{"stage": "".join(f"+ {one} " for one in found.selected).strip(), "gap": table[AFTER]}]
              if found.selected else []),
        ],
        "findings": [one.plain() for one in found.findings],
        "cautions": cautions(found),
        "not_asked": NOT_ASKED,
        "skipped": found.skipped,
        "evidence": found.evidence,
        "left": None if found.left is None else found.left.plain(),
    }  # fmt: skip


def cautions(found: OceanDiagnosis) -> list[str]:
    """What has to be said with the answer."""
    sentences = []
    if found.allowed:
        sentences.append(
            f"the vehicle file leaves {', '.join(found.allowed)} open: what they can make up for is no effect here; "
            "identify the vehicle first (glider identify), and ask for what changed (glider gap watch)"
        )
    sentences += [one.sentence for one in found.findings]
    if found.left is not None:
        sentences.append(found.left.sentence)
    if len(found.runs) == 1:
        sentences.append("one dive only: the gaps are those of the dive that was fitted, and not checked on other data")
    return sentences + below_floor(by_channel(found.gaps[FLOOR]))


def write(found: OceanDiagnosis, out: Path) -> None:
    """diagnosis.json and corrected.toml into a folder."""
    vehicle = found.case.of(OceanVehicle)
    out.mkdir(parents=True, exist_ok=True)
    answer = (json.dumps(as_plain(plain(found)), indent=1) + "\n").encode()
    write_files({out / CORRECTED: corrected_text(vehicle, *found.model).encode("utf-8"), out / ANSWER: answer})
