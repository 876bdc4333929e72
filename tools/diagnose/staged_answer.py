"""What readings and the stages of a vehicle far from its file come to: its answer, evidence, findings and words."""

from dataclasses import replace

import numpy as np
from scipy.special import expit

from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.data.runs import columns as names
from glider.tools.diagnose import by_readings
from glider.tools.diagnose.gates import mixed
from glider.tools.diagnose.probabilities import answer_first
from glider.tools.diagnose.record import NONE, UNKNOWN
from glider.tools.diagnose.shrink import Shrinkage
from glider.tools.diagnose.staged import IDENTIFIED, Staged
from glider.tools.diagnose.verdict import Answer
from glider.tools.inference.hyperparameters import DIAGNOSIS
from glider.tools.inference.vehicle_parameters import GAUGE
from glider.tools.readings.findings import Finding, spoken


def conclusion(answer: Answer, found: Staged, shrinkage: Shrinkage) -> Answer:
    """The answer of the search with what the stages came to in its place."""
    readings = {label: found.stages[0].total ** 2 - found.stages[1].total ** 2 for label in found.read.labels}
    weight = {label: max(readings.get(label, 0.0), found.taken.get(label, 0.0), 1e-3) for label in found.selected}
    total = sum(weight.values())
    chances = dict.fromkeys(catalogue(), 0.0) | {
        label: (1.0 - DIAGNOSIS.identified_unknown) * w / total for label, w in weight.items()
    }
    chances |= {NONE: 0.0, UNKNOWN: DIAGNOSIS.identified_unknown if weight else 1.0}
    gained = {label: by_readings.nats(found.read.findings, label) for label in found.selected} | {
        label: nat for label, nat in found.evidence.items() if label in found.selected
    }
    return replace(
        answer, selected=found.selected, main=UNKNOWN, probabilities=chances, gained=gained, negligible={},
        groups={label: [label] for label in found.selected}, shrinkage=shrinkage,
    )  # fmt: skip


def by_gap_left(off: float, found: Staged, known: float, far: float) -> float:
    """Probability that a vehicle is far from its file, by the gap that either answer leaves of runs left out.

    off: by the first alone. Each window and channel counts as one residual.
    """
    if off in (0.0, 1.0):
        return off
    return float(expit(np.log(off / (1.0 - off)) + residuals(found) * np.log(known / far)))


def residuals(found: Staged) -> int:
    """How many residuals of the gap count as independent: windows and channels."""
    return sum(gap.windows * len(gap.channels) for gap in found.stages[0].gaps)


def weighed(known: Answer, far: Answer, off: float) -> Answer:
    """Two answers in one: by the vehicle's file, and, with the probability `off`, by the stages of one far from it.

    Selected is the main cause, and what is by `selected_probability` in the answer, whichever is right.
    """
    every = [*known.selected, *(label for label in far.selected if label not in known.selected)]
    there = {label: (1.0 - off) * (label in known.selected) + off * (label in far.selected) for label in every}
    main, chances = answer_first(mixed(known.probabilities, far.probabilities, off), every)
    selected = [label for label in every if label == main or there[label] >= DIAGNOSIS.selected_probability]
    gained = {label: max(one.gained.get(label, 0.0) for one in (known, far)) for label in selected}
    return replace(
        known, selected=selected, main=main, probabilities=chances, gained=gained, groups=far.groups | known.groups,
        shrinkage=far.shrinkage if far.shrinkage.after < known.shrinkage.after else known.shrinkage,
        negligible={label: nat for label, nat in known.negligible.items() if label not in selected},
    )  # fmt: skip


def certain_by_readings(answer: Answer, findings: list[Finding]) -> Answer:
    """The answer with every label that readings are certain of by themselves selected, after those of the search."""
    said = [label for label in by_readings.sizes(findings) if label not in answer.selected]
    gained = answer.gained | {label: by_readings.nats(findings, label) for label in said}
    groups = {label: [label] for label in said} | answer.groups
    negligible = {label: nat for label, nat in answer.negligible.items() if label not in said}
    return replace(answer, selected=[*answer.selected, *said], gained=gained, groups=groups, negligible=negligible)


def identified_text(found: Staged) -> str:
    """What was identified and what it left, in a sentence."""
    first, last = found.stages[0].total, found.stages[-1].total
    left = next(stage.total for stage in found.stages if stage.name == IDENTIFIED)
    wires = [
        f"the {name}'s draw-wire means {1.0 + size.estimate:.2f} of what it says"
        for name, size in ((name, found.vehicle.get(f"{name}_scale")) for name in ("slider", "ballast"))
        if size is not None and not size.ci90[0] <= 0.0 <= size.ci90[1]
    ]
    of = "of runs left out" if len(found.stages[0].gaps) > 1 else "of the same run"
    return (
        f"the vehicle file misses these runs by {first:.1f} tolerances, so the vehicle was identified from them: that "
        f"leaves {left:.1f} {of}, with all that was found {last:.1f}" + "".join(f"; {one}" for one in wires)
    )


def findings_in(found: Staged) -> list[Finding]:
    """All that is wrong with the readings: what they say of each other, and what only the identified vehicle shows."""
    more = []
    if GAUGE in found.sizes:
        size = found.sizes[GAUGE]["size"]
        text = (
            f"In flight the depth goes with the water in the tank, {spoken(size.estimate, size.ci90, size.unit)}: the "
            "gauge feels the hull's pressure. Found beside the identified vehicle."
        )
        more.append(
            Finding(names.DEPTH, "ballast_kg", "goes_with", size.estimate, size.ci90, size.unit, None, True, text)
        )
    if "pressure_lever" in found.taken:
        size = found.sizes["pressure_lever"]["ahead"]
        text = (
            f"In flight the depth goes with sin(pitch): the port is {spoken(size.estimate, size.ci90, size.unit)} "
            "ahead of the origin. Found beside the identified vehicle."
        )
        more.append(
            Finding(names.DEPTH, "pitch_rad", "goes_with", size.estimate, size.ci90, size.unit, "pressure_lever", True,
                    text)
        )  # fmt: skip
    return [*found.read.findings, *more]
