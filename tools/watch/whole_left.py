"""What the effects of a whole case leave: disorder of the water, an effect that no label names, or nothing.

As in a diagnosis of ROUGHIE (tools/diagnose/unknown.py): the gap of runs left out against the floor, channel by
channel, and noise probes that say where.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from glider.sim_backend.ocean.core import layout as at
from glider.tools.diagnose.noise_probes import VERTICAL_WATER, ProbeResult, inflated, probes, run_probes
from glider.tools.diagnose.unknown import probability
from glider.tools.gap.measure import RunGap, mean_square, scored_rows
from glider.tools.identify.ocean.levels import BOUNDS
from glider.tools.inference.channels import errors
from glider.tools.inference.hyperparameters import DIAGNOSIS
from glider.tools.inference.predict import fly_windows_from
from glider.tools.inference.problem import Problem, cut
from glider.tools.watch.whole_search import Model, Whole

THIRDS = ("shallow", "middle", "deep")  # of the runs' depth
STEERED = {"roll"}  # channels in which a vehicle is steered: what moves them is a helm, and no gap
STANDS_OUT = 1.5  # times the mean square of all rows, that a regime has


@dataclass
class UnexplainedResidual:
    """What is left, in tolerances of one channel."""

    channel: str = ""
    excess: float = 0.0  # root of the difference of squares of gap and floor
    share: float = 1.0  # of the squared gap that there would be without the effects
    probability: float = DIAGNOSIS.least_unknown  # that it is an effect that no label names
    regime: str = ""  # where most of it is
    runs: list[str] = field(default_factory=list)  # those that have most of it, where it is not in all alike
    probed: list[ProbeResult] = field(default_factory=list)

    def plain(self) -> dict[str, Any]:
        """As it is written."""
        return {"channel": self.channel, "excess": self.excess, "share": self.share, "regime": self.regime,
                "runs": self.runs}  # fmt: skip

    @property
    def sentence(self) -> str:
        """For a person."""
        regime = f", most of it {self.regime}" if self.regime else ""
        runs = f", most in {', '.join(self.runs)}" if self.runs else ""
        return f"{self.channel} is off by {self.excess:.1f} tolerances that no label explains{regime}{runs}"


def excess_water_noise_of(problem: Problem, probed: Sequence[ProbeResult]) -> ProbeResult | None:
    """The probe of the vertical water, where it gains more than any other, and what an effect needs; None where water
    would have to move more than any that is identified.
    """
    found = probed[0] if probed else None
    if found is None or found.probe.name != VERTICAL_WATER or found.gain < DIAGNOSIS.evidence_needed:
        return None
    largest_excess = BOUNDS["water"][1] / problem.case.disturbance.water
    return found if np.hypot(1.0, found.scale) <= largest_excess else None


def disturbed(part: Problem, disorder: ProbeResult) -> Problem:
    """A run that knows of the water's disorder."""
    return part.with_extra_noise(inflated(part, disorder.probe, disorder.scale)[0])


def beyond_floor(after: list[RunGap], floor: list[RunGap], channel: str) -> tuple[float, float]:
    """Mean over runs of a channel's squared gap beyond the floor, and its standard error; of a single run 0."""
    pairs = [(a.channels[channel], f.channels[channel]) for a, f in zip(after, floor, strict=True)
             if channel in a.channels and channel in f.channels]  # fmt: skip
    squares = np.array([a**2 - f**2 for a, f in pairs])
    error = squares.std(ddof=1) / np.sqrt(len(squares)) if len(squares) > 1 else 0.0
    return float(squares.mean()), float(error)


def what_is_left(
    parts: Sequence[Problem], problem: Problem, model: Whole, after: list[RunGap], floor: list[RunGap]
) -> UnexplainedResidual:
    """Of the model's gaps `after` run by run beyond the floor's.

    What has to matter is the least that is likely: the mean over runs less its standard error.
    """
    names = {name for gap in after for name in gap.channels} & {name for gap in floor for name in gap.channels}
    names -= STEERED
    beyond = {name: beyond_floor(after, floor, name) for name in names}
    least = {name: mean - error for name, (mean, error) in beyond.items()}
    channel = max(least, key=lambda name: least[name], default="")
    if not channel or least[channel] <= 0.0:
        return UnexplainedResidual(channel)
    square = beyond[channel][0]
    chance = probability(float(np.sqrt(least[channel])), problem.kind.material, DIAGNOSIS.unknown_width)
    share = 1.0
    if model.labels:
        share = square / (square + taken(parts, model, channel))
        chance *= probability(share, DIAGNOSIS.misfit_share, DIAGNOSIS.unknown_width)
    lowest = float(np.mean([gap.channels[channel] ** 2 for gap in floor if channel in gap.channels]))
    regime, runs = most_of_it(parts, model, channel, lowest)
    P, F = model.shared.model(problem, model.x)
    probed = run_probes(problem, P, F, probes(problem))
    return UnexplainedResidual(channel, float(np.sqrt(square)), share, chance, regime, runs, probed)


def missed(part: Problem, model: Model, channel: str) -> tuple[np.ndarray, np.ndarray]:
    """Rows that are scored, and their errors in tolerances of a channel, (rows, columns), by a model's windows."""
    own = next(one for one in part.kind.measures.channels if one.name == channel)
    rows = scored_rows(cut(part).listed[0], part.runs[0].rows)
    Y = fly_windows_from(part, *model, part.filter(*model))
    return rows, errors(own, part.kind.measures.measured(part.runs[0]), Y)


def taken(parts: Sequence[Problem], model: Whole, channel: str) -> float:
    """Mean square by which a channel's windows move with the model's effects, all else as fitted."""
    bare = model.x.copy()
    for label in model.labels:
        bare[model.shared.labels[label]] = 0.0
    own = next(one for one in parts[0].kind.measures.channels if one.name == channel)
    squares = []
    for part in parts:
        whole = model.shared.model(part, model.x)
        gains = part.filter(*whole)
        rows = scored_rows(cut(part).listed[0], part.runs[0].rows)
        with_it, without = (fly_windows_from(part, *one, gains) for one in (whole, model.shared.model(part, bare)))
        squares.append(mean_square(own, errors(own, with_it[rows], without[rows])))
    return float(np.nanmean(squares))


def most_of_it(parts: Sequence[Problem], model: Whole, channel: str, lowest: float) -> tuple[str, list[str]]:
    """The way and the depth in which most of a channel's squared error beyond the floor's, `lowest`, is, and the runs;
    nothing of what is in all alike.
    """
    deepest = max(float(np.nanmax(part.z[:, at.Y_DEPTH])) for part in parts)
    squares, ways, thirds, numbers = [], [], [], []
    for n, part in enumerate(parts):
        rows, error = missed(part, model.shared.model(part, model.x), channel)
        square = np.where(rows, (error**2).sum(axis=1), np.nan)
        rows = np.flatnonzero(np.isfinite(square))
        depth = np.interp(part.recording.t, *_given(part.recording.t, part.z[:, at.Y_DEPTH]))
        squares.append(square[rows] - lowest)
        ways.append(part.recording.inputs[rows, at.U_PITCH] > 0.0)
        thirds.append(np.minimum(3.0 * depth[rows] / max(deepest, 1.0), 2.0).astype(int))
        numbers.append(np.full(len(rows), n))
    square, up, third, number = (np.concatenate(one) for one in (squares, ways, thirds, numbers))
    whole = max(float(square.mean()), 1e-12)
    words = [
        word for word, mask in (
            ("on the way down", ~up), ("on the way up", up), *((f"in {name} water", third == k)
                                                               for k, name in enumerate(THIRDS)),
        )
        if mask.any() and square[mask].mean() > STANDS_OUT * whole
    ]  # fmt: skip
    by_run = {n: float(square[number == n].mean()) for n in np.unique(number)}
    runs = [parts[n].runs[0].name for n, value in by_run.items() if value > STANDS_OUT * whole]
    return ", ".join(words), runs


def _given(t: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    known = np.isfinite(values)
    return t[known], values[known]
