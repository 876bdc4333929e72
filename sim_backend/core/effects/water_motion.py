"""Water that moves by a course of its own: effects that change the world and not the effect vector."""

import math
from typing import Any

import numpy as np

from glider.sim_backend.core.environment import wave_row
from glider.sim_backend.core.layout import ENV_ACC_ANGULAR, ENV_ACC_LINEAR, STREAM_WAVES
from glider.sim_backend.core.noise import uniform

COMPONENTS = 5  # of a narrow spectrum
SPACING = 0.05  # between their frequencies, of the middle one
WIDTH = 1.2  # 1 sigma of their energies, in spacings


def scale_disturbance(world: Any, scale: float) -> None:
    """Scale the strength of the world's disturbance; its numbers stay those of the seed."""
    world.E[ENV_ACC_LINEAR] *= 1.0 + scale
    world.E[ENV_ACC_ANGULAR] *= 1.0 + scale


def add_waves(world: Any, amplitude: float, period: float, direction: float) -> None:
    """Add a narrow group of components to the world's waves; phases and frequencies come from its seed.

    Their squares add up to the amplitude's: the sea has the energy of one wave of this amplitude (m) at the surface.
    """
    if amplitude == 0.0:
        return
    numbers = np.arange(COMPONENTS) - COMPONENTS // 2
    shares = np.exp(-0.5 * (numbers / WIDTH) ** 2)
    sizes = amplitude * np.sqrt(shares / shares.sum())
    rows = []
    for i, (number, size) in enumerate(zip(numbers, sizes, strict=True)):
        phase = 2.0 * math.pi * uniform(world.seed, STREAM_WAVES, i)
        off = SPACING * (number + uniform(world.seed, STREAM_WAVES + 1, i) - 0.5)
        rows.append(wave_row(size, 2.0 * math.pi / period * (1.0 + off), direction, phase))
    world.waves = np.vstack([world.waves, rows])
