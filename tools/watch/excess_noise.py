"""Runs that are noisier than the reference: which link of the chain shakes, and whether it is the water.

The time history of turbulence or waves is unpredictable, and an effect that nobody knows has no course either that a
fit could find; but the likelihood that a noise probe gains in a run, beyond what it gains in the reference, says where.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glider.tools.diagnose.noise_probes import UNPREDICTABLE, NoiseProbe, inflated, probes
from glider.tools.inference.problem import Problem
from glider.tools.watch.flights import RunEnsemble, numbers

SCALES = (1.6, 2.5, 4.0, 7.0, 12.0, 20.0, 35.0, 60.0)
WATER = UNPREDICTABLE
COARSE = 2  # of the scales, one in so many is tried of single links
FAR_BEHIND = 50.0  # nat behind its best: a probe is not tried at larger scales


def probe_gains(flights: RunEnsemble, wanted: Sequence[NoiseProbe], runs: Sequence[int]) -> np.ndarray:
    """Nat over the variance inflation that probes gain in runs at the models that they fly by, (probes, runs,
    scales).
    """
    gains = np.zeros((len(wanted), len(runs), len(SCALES)))
    for j, n in enumerate(runs):
        part = flights.parts[n]
        model = flights.shared.model(part, flights.own_values(n))
        own = part.filter(*model, begin=True)
        bare = float(own.misfit[0])
        for i, probe in enumerate(wanted):
            best = 0.0
            for k, scale in enumerate(SCALES):
                if probe.name not in WATER and k % COARSE:
                    gains[i, j, k] = gains[i, j, k - 1]
                    continue
                more, doubt = inflated(part, probe, scale)
                tried = part.filter(*model, more=more, doubt=doubt, starts=own.starts)
                value = 0.5 * (bare - float(tried.misfit[0])) / flights.inflation
                gains[i, j, k] = value = value if np.isfinite(value) else -1e9
                best = max(best, value)
                if value < best - FAR_BEHIND:
                    gains[i, j, k:] = value
                    break
    return gains


def beyond_reference(flights: RunEnsemble, wanted: Sequence[NoiseProbe], runs: Sequence[int], most: int) -> np.ndarray:
    """The same less what the probes gain, if anything, in as many samples of (`most` runs at most of) the reference."""
    own = numbers(flights.reference)[:most]
    samples = np.array([run.samples for run in flights.runs], dtype=float)
    usual = probe_gains(flights, wanted, own).sum(axis=1) / samples[own].sum()
    usual = np.maximum(usual, 0.0)
    return probe_gains(flights, wanted, runs) - usual[:, None, :] * samples[list(runs)][None, :, None]


def water_labels(flights: RunEnsemble) -> list[str]:
    """The labels of the water's disorder that these runs can have."""
    there = {probe.name for probe in probes(flights.parts[0])}
    return [name for name in WATER if name in there]


def water_gains(flights: RunEnsemble, runs: Sequence[int]) -> np.ndarray:
    """Nat that the water's disorder gains in runs beyond the reference, (labels, runs, scales)."""
    listed = {probe.name: probe for probe in probes(flights.parts[0])}
    wanted = [listed[name] for name in water_labels(flights)]
    return beyond_reference(flights, wanted, runs, flights.count)


def with_inflated_noise(part: Problem, name: str, scale: float) -> Problem:
    """A run that knows of a probe's noise at a scale."""
    probe = next(one for one in probes(part) if one.name == name)
    more, doubt = inflated(part, probe, scale)
    before = np.zeros(part.kind.n_spectral) if part.extra_noise is None else part.extra_noise
    return replace(part.with_extra_noise(before + more), R=part.R + doubt)
