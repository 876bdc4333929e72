"""Hypotheses of more noise than healthy runs have beside those of an engine, and what is concluded from all."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from glider.tools.own.decision import SIZES, Hypothesis, Posterior, decide, log_prior, strangeness
from glider.tools.own.effects import NOISE, moved
from glider.tools.own.excess_noise import NoisyWindows, Responses, blocks_of, responses
from glider.tools.own.hierarchy import LEAST_REACH, Expansion
from glider.tools.own.posterior import Engine

NOISES_TRIED = 3  # labels of noises beside a hypothesis


def posterior_of(engine: Engine) -> Posterior:
    """What its runs have: hypotheses found by its search, and noises beside none and the most probable label."""
    every = engine.hypotheses()
    nothing, *others = every
    alone = sorted((one for one in others if len(one.labels) == 1), key=lambda one: -one.evidence)
    every += with_noise(engine, [nothing, *alone[:1]], nothing)
    return decide(every, engine.healthy, engine.reach, engine.count)


def with_noise(engine: Engine, beside: Sequence[Hypothesis], nothing: Hypothesis) -> list[Hypothesis]:
    """Hypotheses with excess noise or an oscillation at one of the model's noises beside them.

    What healthy runs gain by one is taken from it: noise is excess only beyond that.
    """
    usual, found = engine.healthy.noise_gain, list[Hypothesis]()
    noises = [one for one in engine.healthy.effects if one.family == NOISE] if usual else []
    for begin in beside if noises else ():
        columns = engine.columns(engine.healthy.at(begin.labels))

        def of_run(n: int, begin=begin, columns=columns) -> tuple[Expansion, Responses]:
            point = moved(engine.observer.declared, engine.observer.point, engine.healthy.effects, begin.own[n])
            return (engine.expansion_of(n, begin.own[n], columns, keep=True, leveled=False),
                    responses(engine.observer.about(point), n, engine.horizon, engine.healthy.errors))  # fmt: skip

        runs, flown = map(list, zip(*engine.observer.each_run(of_run), strict=True))
        tried: list[tuple[float, str, NoisyWindows]] = []
        for place, one in enumerate(noises):
            for block in blocks_of(place):
                windows = NoisyWindows(flown, block, engine.healthy.errors, engine.healthy.eta)
                if windows.reach > LEAST_REACH and one.odds > 0.0:
                    gain = max(windows.gain(size / windows.reach) for size in SIZES)
                    tried.append((gain - windows.windows * usual.get(one.label, 0.0), one.label, windows))
        tried.sort(key=lambda one: -one[0])
        best = dict((label, windows) for _, label, windows in reversed(tried))
        for label in list(dict.fromkeys(label for _, label, _ in tried))[:NOISES_TRIED]:
            found.append(_noisy(engine, begin, label, best[label], runs, nothing))
    return found


def _noisy(
    engine: Engine, begin: Hypothesis, label: str, windows: NoisyWindows, runs: list[Expansion], nothing: Hypothesis
) -> Hypothesis:
    """A label of a noise beside a hypothesis: evidence over all sizes, all that was fitted integrated out again."""
    labels, places = (*begin.labels, label), engine.healthy.at(begin.labels)
    table = []
    for size in SIZES:
        noisy = windows.marginalised(runs, size / windows.reach, engine.level.of)
        _, _, evidence, mean, sd, off = engine.best_sizes(noisy, places, begin.shared)
        table.append((evidence, mean, sd, off))
    evidence = float(logsumexp([row[0] for row in table]) - np.log(len(SIZES)))
    evidence -= windows.windows * engine.healthy.noise_gain.get(label, 0.0)
    _, mean, sd, off = max(table, key=lambda row: row[0])
    size, error = windows.size(SIZES[-1])
    engine.reach[engine.healthy.at([label])] = windows.reach
    evidence += log_prior(engine.healthy, labels)
    found = replace(begin, labels=labels, evidence=evidence, sizes=np.append(mean, size),
                    sd=np.append(sd, error), left=windows.left(size), off=np.append(off, 0.0))  # fmt: skip
    found.strange = strangeness(engine.healthy, found, nothing)
    gain, left = found.evidence - nothing.evidence, np.sqrt(found.left.mean())
    engine.say(f"{' + '.join(labels)}: {gain:.1f} nat, {left:.2f} left")
    return found
