"""depth_offset: the pressure reads a constant too deep."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="depth_offset",
    subsystem="sensing",
    element="depth",
    summary="constant error of the measured depth",
    parameters=(Parameter("offset", "m", -3.0, 3.0, spread=0.15, entry=ef.DEPTH_OFFSET),),
)
