"""waves: a swell runs over the vehicle, dying out with depth."""

import math
from typing import Any

import numpy as np

from sim_backend.core.layout import STREAM_WAVES
from sim_backend.core.noise import uniform
from sim_backend.effects.base import Effect, Parameter
from sim_backend.waves import wave_row

COMPONENTS = 5  # of a narrow spectrum
SPACING = 0.05  # between their frequencies, of the middle one
WIDTH = 1.2  # 1 sigma of their energies, in spacings


def apply(world: Any, amplitude: float, period: float, direction: float) -> None:
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


EFFECT = Effect(
    label="waves",
    subsystem="environment",
    element="water",
    summary="surface waves of a narrow spectrum in deep water: orbits of the amplitude, shrinking by e^(-k Z)",
    parameters=(
        Parameter("amplitude", "m", 0.0, 2.0, spread=0.1),
        Parameter("period", "s", 2.0, 10.0, spread=1.5, default=5.0),
        Parameter("direction", "rad", -math.pi, math.pi, spread=1.8),
    ),
    apply=apply,
)
