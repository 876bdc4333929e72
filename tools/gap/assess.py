"""A whole case measured: gaps of its runs, their total, and where they sit."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from glider.tools.data.errors import InputError
from glider.tools.data.runs.case import Case
from glider.tools.gap.corrected import submerged
from glider.tools.gap.measure import RunGap, case_channels, root_mean_square, run_gap
from glider.tools.gap.where import Share, where
from glider.tools.inference.channels import Measures
from glider.tools.inference.model import Model, effect_vector, nominal_model
from glider.tools.inference.predict import fly
from glider.tools.inference.problem import cut, problem_of
from glider.tools.inference.windows import Window


@dataclass
class CaseGap:
    """What `glider gap measure` found, and what its pictures are drawn from."""

    case: Case
    model: Model
    measures: Measures
    windows: list[list[Window]]  # by run
    predictions: list[np.ndarray]  # by run, (rows, N_Y)
    runs: list[RunGap]
    channels: dict[str, float]  # rms over the runs
    total: float
    where: list[Share]

    def plain(self) -> dict[str, Any]:
        """The result as `--json` prints it."""
        return {
            "runs": [
                {"name": run.name, "channels": run.channels, "total": run.total, "windows": run.windows}
                for run in self.runs
            ],
            "channels": self.channels,
            "total": self.total,
            "where": [{"subsystem": s.subsystem, "element": s.element, "share": s.share} for s in self.where],
        }


def assess(case: Case, model: Model | None = None) -> CaseGap:
    """Measure a case against a model (nominal, if none is given); InputError where no sample can be scored."""
    case = submerged(case)
    model = nominal_model(case) if model is None else model
    problem = problem_of(case, model)
    Y = fly(problem, model.P, effect_vector(model))
    predictions, listed = np.split(Y, problem.recording.bounds[1:-1]), cut(problem).listed
    gaps = [run_gap(problem.kind.measures, run, predictions[n], listed[n]) for n, run in enumerate(case.runs)]
    total = root_mean_square([gap.total for gap in gaps])
    if not np.isfinite(total):
        raise InputError("nothing to score: no run has a measured channel beyond the first 2 s", source=case.folder)
    shares = where(problem, Y)
    return CaseGap(case, model, problem.kind.measures, listed, predictions, gaps, case_channels(gaps), total, shares)
