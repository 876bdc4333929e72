"""Flights left out of the fit, predicted by the nominal and by the identified model (docs/GAP.md, Measures)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tools.data.runs.case import Case
from tools.data.runs.run import Run
from tools.gap.measure import RunGap, case_channels, root_mean_square
from tools.identify.fit import Fit, fit
from tools.identify.predict import model_of, predicted
from tools.inference.model import Model, effect_vector, nominal_model

MOST = 12  # runs that are predicted; of a longer case evenly chosen ones
FEW = 3  # runs, up to which each is left out of a fit of its own
EARLY = "the fit without the run, by one step from the fit with all"
ALONE = "a fit of the other runs alone"


@dataclass
class Held:
    """Gaps of runs that the predicting model has not seen, in tolerances, and the predictions."""

    runs: list[Run]
    before: list[RunGap]
    after: list[RunGap]
    nominal: list[np.ndarray]  # (rows, N_Y)
    identified: list[np.ndarray]
    how: str

    def total(self, gaps: list[RunGap]) -> float:
        return root_mean_square([gap.total for gap in gaps])

    def plain(self) -> dict[str, Any]:
        return {
            "before": {"total": self.total(self.before), **case_channels(self.before)},
            "after": {"total": self.total(self.after), **case_channels(self.after)},
            "runs": [
                {"run": run.name, "before": a.total, "after": b.total}
                for run, a, b in zip(self.runs, self.before, self.after, strict=True)
            ],
            "how": self.how,
        }


def without(found: Fit, run: int) -> np.ndarray:
    """The most probable values without one of the runs, by one step from the fit with all."""
    assert found.at is not None
    of = np.broadcast_to(found.problem.run_of[:, None], found.problem.z.shape)[found.problem.valid]
    kept = np.flatnonzero(of == run)
    J, e = found.at.J[:, kept], found.at.e[kept]
    q, scale = found.quadratic, 1.0 / found.quadratic.heat
    normal = q.normal - scale * (J @ J.T)
    low = np.array([f.low for f in found.free.free])
    return np.maximum(q.at - np.linalg.solve(normal, q.slope - scale * (J @ e)), low)


def hold_out(case: Case, model: Model, found: Fit, say: Callable[[str], None] = lambda text: None) -> Held | None:
    """Predict runs left out, before and after; None where there is one run alone."""
    runs = found.problem.runs
    if len(runs) < 2:
        return None
    recorded = {run.name: run for run in case.runs}  # with their spikes, as everybody measures them
    picked = np.unique(np.linspace(0, len(runs) - 1, min(MOST, len(runs))).astype(int)).tolist()
    alone = len(runs) <= FEW or found.at is None
    made = Held([recorded[runs[n].name] for n in picked], [], [], [], [], ALONE if alone else EARLY)
    nominal = nominal_model(case)
    for n in picked:
        free = found.free
        if alone:
            say(f"without {runs[n].name}")
            other = fit(case, model, [run for m, run in enumerate(runs) if m != n])
            free, values = other.free, np.maximum(other.quadratic.mode, other.quadratic.low)
        else:
            values = without(found, n)
        for (P, F), gaps, flown in (
            ((nominal.P, effect_vector(nominal)), made.before, made.nominal),
            (model_of(model, free, values), made.after, made.identified),
        ):
            gap, Y = predicted(case, model, recorded[runs[n].name], P, F)
            gaps.append(gap)
            flown.append(Y)
    return made
