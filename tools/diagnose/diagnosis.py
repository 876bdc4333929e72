"""The diagnosis of a case: where the simulator is wrong, why, how far the gap shrinks.

See docs/reference/gap.md, Answers.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from glider.firmware.model.vehicle import COEFFICIENTS
from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.data.intervals import NINETY
from glider.tools.data.runs.case import Case
from glider.tools.data.runs.columns import COMMANDS
from glider.tools.data.runs.origin import flights_of
from glider.tools.data.version import software
from glider.tools.diagnose import by_readings
from glider.tools.diagnose.cautions import below_floor, cautions, not_asked
from glider.tools.diagnose.chain import noise_of, panels
from glider.tools.diagnose.correction import Correction, correct
from glider.tools.diagnose.entries import numbers_to_enter
from glider.tools.diagnose.next_run import propose
from glider.tools.diagnose.noise_probes import UNPREDICTABLE
from glider.tools.diagnose.record import NONE, UNKNOWN, Curves, Data, Details, Noise, Panel, Picture, write_record
from glider.tools.diagnose.regressors import regressors
from glider.tools.diagnose.residuals import strongest_left
from glider.tools.diagnose.search import Search, run
from glider.tools.diagnose.shrink import (
    AFTER,
    BEFORE,
    FLOOR,
    RECALIBRATED,
    Further,
    Shrinkage,
    by_channel,
    shrink_further,
    shrinkage_of,
)
from glider.tools.diagnose.staged import Staged, staged
from glider.tools.diagnose.staged_answer import (
    by_gap_left,
    certain_by_readings,
    conclusion,
    findings_in,
    identified_text,
    weighed,
)
from glider.tools.diagnose.unknown import unfit
from glider.tools.diagnose.verdict import Answer, conclude
from glider.tools.diagnose.waterfall import Stage, stages_of
from glider.tools.gap.corrected import findings_of, fix_axes_signs_units, submerged
from glider.tools.inference.corrected import corrected_text
from glider.tools.inference.hyperparameters import DIAGNOSIS
from glider.tools.inference.model import effect_vector, effects_in, nominal_model
from glider.tools.inference.problem import ALL, problem_of
from glider.tools.inference.rules import Rules
from glider.tools.readings.findings import WHOLE, Finding
from glider.tools.readings.pictures import pictures_of

CORRECTION_FILE = "data_driven.toml"
LEAST_PROBABILITY = 0.001  # a smaller probability is not written down
DRAWN_RUNS = 6  # with the largest gaps


@dataclass
class Diagnosis:
    """Everything a diagnosis found, for the files and the report."""

    case: Case
    search: Search
    answer: Answer
    shrinkage: Shrinkage
    next_run: dict[str, Any]
    mission: str  # its file's text
    panels: list[Panel]
    noise: Noise | None
    correction: Correction | None = None  # of an unknown gap
    further: Further | None = None  # with that correction
    readings: list[Finding] = field(default_factory=list)  # what they say of each other
    stages: list[Stage] = field(default_factory=list)
    staged: Staged | None = None  # of a vehicle far from its file

    @property
    def identify_first(self) -> bool:
        """Whether the log fits the vehicle file so badly that the vehicle had to be identified first."""
        return self.staged is not None

    @property
    def cautions(self) -> list[str]:
        """What these runs cannot say, a line each."""
        found = cautions(self.answer.search.problem)
        found += [
            f"{label} is there ({nat:.0f} nat of evidence), but moves no channel of any window by "
            f"{DIAGNOSIS.material:g} of its tolerance: no gap"
            for label, nat in self.answer.negligible.items()
        ]
        found += below_floor(self.shrinkage.channels(FLOOR))
        if self.staged is not None:
            found.insert(0, identified_text(self.staged))
        return [*(one.text for one in self.readings if one.finding in WHOLE and not one.mended), *found]

    @property
    def verdict(self) -> str:
        return verdict_of(self.answer)


def verdict_of(answer: Answer) -> str:
    """none, cause or unknown."""
    return answer.main if answer.main in (NONE, UNKNOWN) else "cause"


def diagnose(case: Case, say: Callable[[str], None] = lambda text: None, rules: Rules = ALL) -> Diagnosis:
    """Diagnose a case; `say` hears how far the search is."""
    readings, recorded, case = findings_of(case.runs), case, submerged(case)
    runs = fix_axes_signs_units(case.runs, readings)
    search = run(problem_of(case, runs=runs, rules=rules), say)
    answer = conclude(search, say)
    search = answer.search
    entry, mission = propose(search)
    noise, shares = noise_of(answer), panels(verdict_of(answer), answer)
    found = Diagnosis(case, search, answer, answer.shrinkage, entry, mission, shares, noise, readings=readings)
    off = (1.0 if never_identified(case) else unfit(answer.shrinkage, answer.noise)) if rules == ALL else 0.0
    if off > 0.0:
        take(found, staged(recorded, say), off)
    if found.staged is None:
        found.stages = stages_of(answer, case, runs)
        if found.verdict == "unknown":
            learn(found, say)
    found.answer = certain_by_readings(found.answer, readings)
    unearned = found.verdict == NONE and not found.answer.selected
    say(f"verdict: {found.answer.main}{' (no candidate earned its place)' if unearned else ''}")
    return found


def never_identified(case: Case) -> bool:
    """Whether the vehicle file itself calls the water's forces a guess: then the vehicle is not its file's."""
    return any(name in COEFFICIENTS for name in case.assumed)


def take(diagnosis: Diagnosis, found: Staged, off: float) -> None:
    """The diagnosis with what the stages of a vehicle far from its file came to; off: how probably it is, before them.

    The model is the one of the two that leaves less of the gap of runs left out.
    """
    before = diagnosis.answer.shrinkage
    runs = before.runs | {AFTER: found.stages[-1].gaps, FLOOR: found.floor}
    shrinkage = shrinkage_of(runs, before.predictions | {AFTER: found.predictions})
    far = conclusion(diagnosis.answer, found, shrinkage)
    diagnosis.answer = weighed(diagnosis.answer, far, by_gap_left(off, found, before.after, shrinkage.after))
    if shrinkage.after < before.after:
        diagnosis.staged, diagnosis.stages, diagnosis.readings = found, found.stages, findings_in(found)
        diagnosis.shrinkage = shrinkage
    diagnosis.panels = panels(verdict_of(diagnosis.answer), diagnosis.answer)


def learn(diagnosis: Diagnosis, say: Callable[[str], None]) -> None:
    """What an unknown gap does, as a correction, and how far it shrinks the gap; nothing where that would not help."""
    answer, shrinkage = diagnosis.answer, diagnosis.shrinkage
    correction = correct(answer.search, answer.hypothesis, answer.probed, say)
    if correction is None:
        return
    further = shrink_further(correction.search, correction.hypothesis, shrinkage.runs[BEFORE])
    if further.after < shrinkage.after:
        diagnosis.correction, diagnosis.further = correction, further


def unexplained(diagnosis: Diagnosis) -> dict[str, Any] | None:
    """The `unknown` entry of diagnosis.json: channel, strongest correlation, and its correction."""
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
    """Estimate, 90 % interval and unit of each parameter of a selected label, by Laplace's approximation.

    Of one that is not in the corrected model, by what the readings say.
    """
    staged = {} if diagnosis.staged is None else diagnosis.staged.sizes
    hypothesis, clock = diagnosis.answer.hypothesis, diagnosis.answer.search.clock
    if label in staged:
        return {name: size.plain() for name, size in staged[label].items()}
    if clock is not None and label == clock.label:
        known = zip(clock.free, clock.values, clock.sd, strict=True)
    elif label in hypothesis.labels:
        spread = np.sqrt(np.diag(np.linalg.inv(hypothesis.precision)))
        known = zip(hypothesis.free, hypothesis.values, spread, strict=True)
    elif label in diagnosis.answer.selected:
        return {name: size.plain() for name, size in by_readings.sizes(diagnosis.readings).get(label, {}).items()}
    else:
        return {}
    found = {}
    for free, value, sd in known:
        if free.label == label:
            low, high = max(value - NINETY * sd, free.low), min(value + NINETY * sd, free.high)
            estimate, *ci90 = (float(one * free.spread) for one in (value, low, high))
            found[free.name] = {"estimate": estimate, "ci90": ci90, "unit": free.unit}
    return found


def places(answer: Answer) -> list[dict[str, Any]]:
    """Where, most probable first: labels' probabilities by place; what is unknown lies where a probed link gains."""
    weight: dict[tuple[str, str], float] = {}
    effects = catalogue()

    def add(place: tuple[str, str], share: float) -> None:
        weight[place] = weight.get(place, 0.0) + share

    known = {label: p for label, p in answer.probabilities.items() if label in effects}
    total = sum(known.values())
    doubt = answer.probabilities[UNKNOWN]
    links = [f for f in answer.probed if f.probe.name not in UNPREDICTABLE and f.gain > 0.0]
    gained = sum(f.gain for f in links)
    for link in links:
        add((link.probe.subsystem, link.probe.element), doubt * link.gain / gained)
    for label, p in known.items():
        likeness = 0.0 if links or total <= 0.0 else doubt * p / total
        add((effects[label].subsystem, effects[label].element), p + likeness)
    for label in answer.selected:
        place = (effects[label].subsystem, effects[label].element)
        weight[place] = max(weight.get(place, 0.0), LEAST_PROBABILITY)
    ranked = sorted(weight.items(), key=lambda item: -item[1])
    return [{"subsystem": s, "element": e, "probability": p} for (s, e), p in ranked if p >= LEAST_PROBABILITY]


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
    return {
        "format": 1,
        "verdict": diagnosis.verdict,
        "where": places(answer),
        "causes": causes,
        "selected": list(answer.selected),
        "gap": gap_table(diagnosis.shrinkage, answer),
        "left": [{"channel": f.channel, "goes_with": f.test, "sigma": f.sigma} for f in answer.findings[:8]],
        "unknown": unexplained(diagnosis),
        "cautions": diagnosis.cautions,
        "not_asked": not_asked(diagnosis.answer.search.problem),
        "identify_first": diagnosis.identify_first,
        "next_run": diagnosis.next_run,
        "readings": [one.plain() for one in diagnosis.readings],
        "stages": [stage.plain() for stage in diagnosis.stages],
        "enter": to_enter(diagnosis),
        "identified": {} if diagnosis.staged is None else {
            name: size.plain() for name, size in diagnosis.staged.vehicle.items()
        },
    }  # fmt: skip


def to_enter(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """The numbers of the vehicle file that the selected effects change; the water is none of the vehicle's."""
    vehicle, found = diagnosis.case.roughie, []
    for label in (one for one in diagnosis.answer.selected if catalogue()[one].subsystem != "environment"):
        found += numbers_to_enter(vehicle.vector(), vehicle.effects, label, parameters(diagnosis, label))
    return found


def details(diagnosis: Diagnosis) -> Details:
    """report.json."""
    answer, case = diagnosis.answer, diagnosis.case
    runs = case.runs
    columns = sorted({name for run in runs for name, values in run.columns.items() if np.isfinite(values).any()})
    channels = {channel.name for run in runs for channel in diagnosis.search.problem.kind.measures.channels_of(run)}
    data = Data(
        case.folder.resolve().name, case.vehicle.name, case.site, len(runs),
        float(sum(run.t[-1] - run.t[0] for run in runs)), float(case.log_rate_hz), case.motion_capture, columns,
        sorted(channels), flights_of(runs),
    )  # fmt: skip
    return Details(
        shown=[one.title for one in pictures_of(diagnosis.readings, case.runs)],
        format=1, version=software().removeprefix("glider "), data=data,
        evidence={k: float(v) for k, v in answer.gained.items()},
        corrected=in_model(diagnosis), noise=diagnosis.noise, panels=diagnosis.panels,
        findings=answer.findings, pictures=[picture(diagnosis, n) for n in drawn_runs(diagnosis)],
        thresholds={
            "evidence": DIAGNOSIS.evidence_needed, "tie": DIAGNOSIS.confounded_evidence,
            "sigma": DIAGNOSIS.residual_sigma, "left": DIAGNOSIS.misfit_share, "matters": DIAGNOSIS.material,
        },
        regressors=[] if diagnosis.staged is not None else regressors(answer.search, answer.hypothesis),
    )  # fmt: skip


def in_model(diagnosis: Diagnosis) -> bool:
    """Whether the corrected model has more than a recalibration: effects, a vehicle identified, disorder."""
    answer = diagnosis.answer
    known = {*answer.search.entries(answer.hypothesis), *UNPREDICTABLE}
    return diagnosis.staged is not None or any(label in known for label in answer.selected)


def drawn_runs(diagnosis: Diagnosis) -> list[int]:
    """The runs with the largest gaps before, in their order."""
    totals = np.nan_to_num([gap.total for gap in diagnosis.shrinkage.runs[BEFORE]])
    return sorted(np.argsort(-totals, kind="stable")[:DRAWN_RUNS].tolist())


def picture(diagnosis: Diagnosis, n: int) -> Picture:
    """A run's gaps, for its pictures."""
    run = diagnosis.case.runs[n]

    def gaps(which: str) -> dict[str, float | None]:
        found = diagnosis.shrinkage.runs[which][n]
        return {**found.channels, "total": found.total}

    names = [channel.name for channel in diagnosis.search.problem.kind.measures.channels_of(run)]
    return Picture(run.name, names, gaps(BEFORE), gaps(AFTER), gaps(RECALIBRATED), gaps(FLOOR))


def curves(diagnosis: Diagnosis, n: int) -> Curves:
    """What was measured in a run and what two models say of it."""
    run, said = diagnosis.case.runs[n], diagnosis.shrinkage.predictions
    measured = diagnosis.search.problem.kind.measures.measured(run)
    commands = np.stack([run.columns[name] for name in COMMANDS], axis=1) if run.has_commands else None
    return Curves(run.t, measured, said[BEFORE][n], said[AFTER][n], commands)


def model_text(case: Case, P: np.ndarray, F: np.ndarray) -> str:
    """corrected.toml of a model: what differs from the case's vehicle."""
    nominal = nominal_model(case)
    own = F - effect_vector(nominal)
    return corrected_text(case.vehicle_name, nominal.P, P, own, effects_in(own))


def corrected(diagnosis: Diagnosis) -> str:
    """corrected.toml: the selected effects, and what was identified where the vehicle had to be."""
    staged, search = diagnosis.staged, diagnosis.answer.search
    return model_text(diagnosis.case, *(search.model(diagnosis.answer.hypothesis) if staged is None else staged.model))


def write(diagnosis: Diagnosis, out: Path) -> None:
    """Everything that a diagnosis leaves behind, but for the report, into a folder."""
    shown = pictures_of(diagnosis.readings, diagnosis.case.runs)
    drawn = [curves(diagnosis, n) for n in drawn_runs(diagnosis)]
    beside = {"next_run.toml": diagnosis.mission, "corrected.toml": corrected(diagnosis)}
    if diagnosis.correction is not None:
        learned = diagnosis.correction.search.model(diagnosis.correction.hypothesis)
        beside[CORRECTION_FILE] = model_text(diagnosis.case, *learned)
    write_record(out, plain(diagnosis), details(diagnosis), drawn, shown, beside)
