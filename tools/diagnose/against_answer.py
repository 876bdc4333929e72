"""The answer of a diagnosis against healthy runs: gaps, sizes and places, as docs/reference/gap.md has them, into a
folder."""

import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.data.files import write_files
from glider.tools.data.plain import as_plain
from glider.tools.diagnose.against_healthy import AgainstHealthy, Comparison
from glider.tools.diagnose.cautions import below_floor
from glider.tools.diagnose.correction import links_of
from glider.tools.diagnose.noise_probes import probes
from glider.tools.diagnose.record import AGAINST_HEALTHY, ANSWER, UNKNOWN
from glider.tools.diagnose.shrink import AFTER, BEFORE, FLOOR, RECALIBRATED, by_channel, shrinkage_of
from glider.tools.gap.measure import RunGap, root_mean_square, run_gap
from glider.tools.inference.corrected import corrected_text
from glider.tools.inference.hyperparameters import HEALTHY
from glider.tools.inference.model import effect_vector, effects_in, nominal_model
from glider.tools.inference.parameters import NINETY, model_at
from glider.tools.inference.predict import fly
from glider.tools.inference.problem import Problem, cut

FEW_HEALTHY_RUNS = 4  # healthy runs
LEAST_PROBABILITY = 0.005  # a smaller probability is not written down
CORRECTED = "corrected.toml"


def model_of(compared: Comparison, values: np.ndarray, labels: Iterable[str]) -> tuple[np.ndarray, np.ndarray]:
    """The identified vehicle with labels at values (n,), and nothing else changed."""
    bare = np.zeros(len(values))
    for label in labels:
        bare[compared.places[label]] = values[compared.places[label]]
    return model_at(compared.problem, compared.free, bare)


def gaps_of(answer: AgainstHealthy) -> dict[str, list[RunGap]]:
    """Gaps of the case's runs by the identified vehicle, by a fit of it and with the change, each without the run; and
    what healthy runs leave."""
    compared, labels = answer.compared, answer.selected
    problem = compared.problem
    parts = [problem.part(n) for n in range(len(problem.runs))]
    found: dict[str, list[RunGap]] = {BEFORE: [], RECALIBRATED: [], AFTER: []}
    nominal = nominal_model(problem.case)
    for n, part in enumerate(parts):
        found[BEFORE].append(gap_of(part, nominal.P, effect_vector(nominal)))
        found[RECALIBRATED].append(gap_of(part, *model_at(problem, compared.free, answer.nothing.others[n])))
        changed = model_of(compared, answer.best.others[n], labels)
        found[AFTER].append(gap_of(part, *changed) if labels else found[BEFORE][-1])
    channels = compared.healthy.scales
    whole = root_mean_square(channels.values())
    found[FLOOR] = [replace(one, channels=dict(channels), total=whole) for one in found[BEFORE]]
    return found


def gap_of(part: Problem, P: np.ndarray, F: np.ndarray) -> RunGap:
    """A run's gap to a model (docs/reference/gap.md, Measures)."""
    return run_gap(part.kind.measures, part.runs[0], fly(part, P, F), cut(part).listed[0])


def sizes(answer: AgainstHealthy) -> dict[str, dict[str, dict[str, Any]]]:
    """Each label's parameters with 90 % intervals, SI: the fit's, less what the file is off by as healthy runs show it;
    the share `form_error` of the change may not be as the label's equations have it."""
    compared, one = answer.compared, answer.best
    found: dict[str, dict[str, dict[str, Any]]] = {}
    for label in answer.selected:
        found[label], usual = {}, answer.healthy.usual[label]
        variance = one.sigma[compared.places[label]] ** 2 + np.diag(usual.covariance)
        change = one.values[compared.places[label]] - usual.mean
        for k, value, sd in zip(
            compared.places[label], change, np.sqrt(variance + (HEALTHY.form_error * change) ** 2), strict=True
        ):
            free = compared.free[k]
            low, middle, high = (
                float(np.clip(value + side * NINETY * sd, free.low, free.high)) * free.spread for side in (-1, 0, 1)
            )
            found[label][free.name] = {"estimate": middle, "ci90": [low, high], "unit": free.unit}
    return found


def places_of(compared: Comparison, chances: dict[str, float], links: dict[str, float]) -> list[dict[str, Any]]:
    """Where, most probable first: an unknown change lies at its link; without one, where the labels lie that come
    nearest to it."""
    effects, where = compared.problem.kind.catalogue(), dict[tuple[str, str], float]()
    known = {label: p for label, p in chances.items() if label in effects}
    likeness = 1.0 + (chances[UNKNOWN] - sum(links.values())) / max(sum(known.values()), 1e-12)
    for label, p in known.items():
        where[effects[label].place] = where.get(effects[label].place, 0.0) + p * likeness
    for probe in probes(compared.problem):
        for link in links_of(probe):
            place = probe.subsystem, probe.element
            where[place] = where.get(place, 0.0) + links.get(link, 0.0)
    ranked = sorted(where.items(), key=lambda item: -item[1])
    return [{"subsystem": s, "element": e, "probability": p} for (s, e), p in ranked if p >= LEAST_PROBABILITY]


def plain(found: AgainstHealthy) -> dict[str, Any]:
    """diagnosis.json (docs/reference/gap.md, Answers)."""
    estimates, gaps = sizes(found), gaps_of(found)
    shrinkage = shrinkage_of(gaps, {})
    chances = dict.fromkeys(found.selected, 0.0) | found.probabilities  # a second effect need not be a main cause
    causes = [
        {"label": label, "probability": p, "group": found.group if found.group[:1] == [label] else [label],
         "parameters": estimates.get(label, {})}
        for label, p in sorted(chances.items(), key=lambda item: -item[1])
    ]  # fmt: skip
    table: dict[str, Any] = {name: by_channel(gaps[name]) for name in (BEFORE, RECALIBRATED, AFTER, FLOOR)}
    for name, value, ci in (("shrinkage", shrinkage.shrinkage, shrinkage.ci90),
                            ("closed", shrinkage.closed, shrinkage.closed_ci90)):  # fmt: skip
        table[name] = {"value": value, "ci90": list(ci)}
    changed = [{"stage": " ".join(f"+ {one}" for one in found.selected), "gap": table[AFTER]}]
    runs = [run.name for run in found.case.runs]
    return {
        "format": 1,
        "kind": AGAINST_HEALTHY,
        "case": {"name": found.case.folder.resolve().name, "vehicle": found.case.vehicle_name, "runs": len(runs)},
        "verdict": found.verdict,
        "where": places_of(found.compared, found.probabilities, found.links),
        "causes": causes,
        "selected": found.selected,
        "gap": table,
        "next_run": {},
        "readings": [],
        "stages": [{"stage": "identified", "gap": table[BEFORE]}, *(changed if found.selected else [])],
        "cautions": cautions(found),
        "skipped": {},
        "evidence": found.evidence,
        "reference": {
            "runs": found.healthy.runs,
            "count": found.healthy.count,
            "left": found.healthy.scales,
            "times": found.left,
        },
    }


def cautions(found: AgainstHealthy) -> list[str]:
    """What has to be said with the answer."""
    sentences = []
    if found.healthy.count < FEW_HEALTHY_RUNS:
        sentences.append(f"{found.healthy.count} healthy runs: how much runs differ though nothing changed is assumed")
    if found.case.roughie.identified is None:
        sentences.append("the vehicle file is not identified: what it misses healthy runs by hides small changes")
    if found.verdict == UNKNOWN:
        sentences.append("turbulence, waves and a clock that wanders are not asked for here: each would be unknown")
    if not found.healthy.runs:
        sentences.append(
            "what the vehicle's form leaves of healthy runs is taken from its file: --reference HEALTHY says it of "
            "these readings"
        )
    if len(found.case.runs) == 1:
        sentences.append("one run only: the gaps are those of the run that was fitted, and not checked on other data")
    left = found.compared.healthy.scales
    floor = {**left, "total": root_mean_square(left.values())}
    return sentences + below_floor(floor, "healthy runs leave")


def write(found: AgainstHealthy, out: Path) -> dict[str, Any]:
    """diagnosis.json and corrected.toml into a folder; the answer."""
    nominal, answer = nominal_model(found.case), plain(found)
    P, F = model_of(found.compared, found.best.values, found.selected)
    own = F - effect_vector(nominal)
    text = corrected_text(found.case.vehicle_name, nominal.P, P, own, effects_in(own))
    out.mkdir(parents=True, exist_ok=True)
    answered = (json.dumps(as_plain(answer), indent=1) + "\n").encode()
    write_files({out / CORRECTED: text.encode("utf-8"), out / ANSWER: answered})
    return answer
