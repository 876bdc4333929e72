"""Waves distinguished from a force that nobody knows: they move the vehicle by one line of the spectrum, in all runs
the same.

Both make the probe of moving water gain. What a force leaves goes with the legs flown, at periods of ten seconds and
more; a sea goes with its own period.
"""

import itertools

import numpy as np

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.inference.hyperparameters import DIAGNOSIS
from glider.tools.inference.problem import Gains, Problem

PLACES = (ef.Y_DEPTH, ef.Y_MOCAP_X, ef.Y_MOCAP_Y, ef.Y_MOCAP_Z)  # readings that see where the vehicle is
PERIODS = (2.0, 10.0)  # s, of surface waves (docs/reference/gap.md, Words)
FREQUENCIES = np.linspace(0.02, 1.0, 197)  # Hz, closer than the lines of a run of 150 s
LINES = np.linspace(1.0 / PERIODS[1], 1.0 / PERIODS[0], 81)[:, None]  # Hz, tried


def line_share(problem: Problem, gains: Gains) -> float:
    """Of the innovations' power below 1 Hz in a reading of place, the most that lies about one line of PERIODS.

    Of the reading with the largest share, over all runs: a sea has a direction. `gains` are those of a filter that
    knows of moving water: its innovations there are the water's speed. White ones have up to 0.3.
    """
    power, t, bounds = np.zeros((len(FREQUENCIES), len(PLACES))), problem.recording.t, problem.recording.bounds
    for a, b in itertools.pairwise(bounds):
        waves = np.exp(-2j * np.pi * FREQUENCIES[:, None] * (t[a:b] - t[a]))
        e = np.nan_to_num(gains.E[a:b, PLACES])
        power += np.abs(waves @ (e - e.mean(axis=0))) ** 2
    near = np.abs(FREQUENCIES - LINES) <= DIAGNOSIS.wave_band * LINES
    return float((near @ power / np.maximum(power.sum(axis=0), 1e-9)).max())
