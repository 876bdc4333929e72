"""The waterfall: how far the gap of runs left out is, after what (docs/explanation/diagnosis.md, Stages)."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from glider.tools.data.runs.case import Case
from glider.tools.data.runs.run import Run
from glider.tools.diagnose.shrink import (
    AFTER,
    BEFORE,
    RECALIBRATED,
    SEED,
    by_channel,
    gaps,
    left_out,
    over_runs,
    rms,
    squares,
)
from glider.tools.diagnose.verdict import Answer, drop
from glider.tools.gap.measure import RunGap, root_mean_square, run_gap
from glider.tools.inference.model import nominal_model
from glider.tools.inference.predict import predict
from glider.tools.inference.problem import cut, problem_of

NOMINAL, READINGS, RECALIBRATED_STAGE = "nominal", "readings", "recalibrated"  # names of stages


@dataclass
class Stage:
    """Gaps of runs left out after a stage, and what it added."""

    name: str
    added: list[str]
    gaps: list[RunGap]

    @property
    def total(self) -> float:
        return root_mean_square([gap.total for gap in self.gaps])

    def plain(self) -> dict[str, Any]:
        """The entry in diagnosis.json: channels and total, and the total's 90 % interval over runs."""
        whole = squares(self.gaps)
        _, ci90 = over_runs(lambda picks: rms(whole, picks), np.random.default_rng(SEED), len(whole))
        return {"stage": self.name, "added": self.added, "gap": by_channel(self.gaps), "ci90": list(ci90)}


def stages_of(answer: Answer, case: Case, runs: list[Run]) -> list[Stage]:
    """The stages of a vehicle whose file fits: nominal, readings put right, recalibrated, each selected effect.

    runs: the case's, as the search has seen them.
    """
    shrinkage = answer.shrinkage
    stages = [Stage(NOMINAL, [], shrinkage.runs[BEFORE])]
    if any(a is not b for a, b in zip(runs, case.runs, strict=True)):
        model = nominal_model(case)
        problem = problem_of(case, model)
        listed = cut(problem).listed
        measured = [
            run_gap(problem.kind.measures, run, Y, listed[n])
            for n, (run, Y) in enumerate(zip(case.runs, predict(case, model, case.runs), strict=True))
        ]
        stages = [Stage(NOMINAL, [], measured), Stage(READINGS, ["put right"], shrinkage.runs[BEFORE])]
    stages.append(Stage(RECALIBRATED_STAGE, [], shrinkage.runs[RECALIBRATED]))
    kept = [label for label in answer.selected if label in answer.hypothesis.labels]
    steps = []
    hypothesis = answer.hypothesis
    for label in reversed(kept):
        found = shrinkage.runs[AFTER] if hypothesis is answer.hypothesis else gaps(
            answer.search.problem, left_out(answer.search, hypothesis)
        )[0]  # fmt: skip
        steps.append(Stage(f"+ {label}", [label], found))
        hypothesis = drop(answer.search, hypothesis, label)
    search, clock = answer.search, answer.search.clock
    if clock is not None and clock.label in answer.selected:
        found = gaps(search.problem, left_out(search, hypothesis))[0] if kept else shrinkage.runs[AFTER]
        steps.append(Stage(f"+ {clock.label}", [clock.label], found))
    return stages + steps[::-1]
