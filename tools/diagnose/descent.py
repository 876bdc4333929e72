"""Hypotheses led to their least misfit: steps, further starts, and which of them fall behind."""

import numpy as np

from glider.tools.diagnose.sensor_consistency import DISTANT, NEARBY
from glider.tools.inference.fit import POOR, Fitter, Hypothesis

PRUNE_BEHIND = 60.0  # nat behind the best: no longer worth a flight, where also behind by
PRUNE_GAIN_SHARE = 0.5  # of all that was gained
STARTED = 4  # hypotheses at most that are given other starts at a time
HOPEFUL = 10.0  # nat that a step of what may begin only beyond some size should bring, for other starts to be tried
# Spreads, tried as starts of what begins only beyond some size: a limit that is a little too tight is far from none
# at all, and no slope leads from none to it.
BEYOND = tuple(float(size) for size in np.geomspace(0.2, 3.0, 15))
CONVERGED = 0.05  # nat; a hypothesis that gains less in a step has converged


def converge(fitter: Fitter, hypothesis: Hypothesis, steps: int = 6) -> None:
    """A hypothesis to its least misfit."""
    for _ in range(steps):
        fitter.advance([hypothesis])
        if hypothesis.gained < 2.0 * CONVERGED:
            break


def prune(hypotheses: list[Hypothesis], worst: float, most: int, least_kept: int = 4) -> list[Hypothesis]:
    """The hypotheses that may still win: `worst` is the misfit of no effect.

    Each is taken to gain once more what its last step brought: many steps need not mean a poor end.
    """
    hoped = {id(c): c.misfit - (c.gained if np.isfinite(c.gained) else 0.0) for c in hypotheses}
    hypotheses = sorted(hypotheses, key=lambda c: hoped[id(c)])
    least = min(c.misfit for c in hypotheses)
    margin = max(2.0 * PRUNE_BEHIND, PRUNE_GAIN_SHARE * (worst - least))
    return [c for n, c in enumerate(hypotheses) if n < least_kept or hoped[id(c)] - least <= margin][:most]


def advance_and_prune(
    fitter: Fitter, hypotheses: list[Hypothesis], worst: float, most: int, steps: int
) -> list[Hypothesis]:
    """Hypotheses led on, and those far behind dropped."""
    for _ in range(steps):
        moving = [c for c in hypotheses if c.gained >= 2.0 * CONVERGED]
        if not moving:
            break
        fitter.advance(moving)
        hypotheses = prune(hypotheses, worst, most)
    return hypotheses


def transfer(fitter: Fitter, hypotheses: list[Hypothesis]) -> list[Hypothesis]:
    """Hypotheses taken over to another fitter, with where they stand."""
    return [fitter.hypothesis(c.labels, c.free, c.values, c.nuisance) for c in hypotheses]


def try_distant_starts(fitter: Fitter, hypotheses: list[Hypothesis], leaps=DISTANT, afresh=False) -> None:
    """Further starts: each parameter of a hypothesis's last effect alone far out, where that does better.

    A delay is not linear. afresh: also with the nuisance parameters back at the vehicle file's: they may have been led
    to make up for the effect.
    """
    points = []
    for hypothesis in hypotheses:
        bases = [hypothesis.nuisance] + ([np.zeros(len(hypothesis.nuisance))] if afresh else [])
        for k in (k for k, free in enumerate(hypothesis.free) if free.label == hypothesis.labels[-1]):
            for far in leaps:
                values = hypothesis.values.copy()
                values[k] = far
                if hypothesis.low[k] <= far <= hypothesis.high[k]:
                    points += [(hypothesis, values, base) for base in bases]
    flown = fitter.flown([(hypothesis.free, values, base) for hypothesis, values, base in points])
    for (hypothesis, values, base), e in zip(points, flown, strict=True):
        hypothesis.offer(e, values, base, fitter.prior_weight)
    for hypothesis in hypotheses:
        hypothesis.accept()
        hypothesis.gained = np.inf  # no step was taken from there yet


def first_step(fitter: Fitter, hypotheses: list[Hypothesis]) -> None:
    """The first step of hypotheses; other starts for those to which it should bring much, and brings much less."""
    fitter.move(hypotheses)
    poor = [c for c in hypotheses if c.gained < POOR * c.expected_fall()]
    poor.sort(key=lambda c: -c.expected_gain())
    late = [c for c in poor if c.late and c.expected_gain() > 2.0 * HOPEFUL][:STARTED]
    much = [c for c in poor if c.expected_gain() > 2.0 * PRUNE_BEHIND][:STARTED]
    try_distant_starts(fitter, much, (*NEARBY, *DISTANT), afresh=True)
    try_distant_starts(fitter, late, BEYOND)
