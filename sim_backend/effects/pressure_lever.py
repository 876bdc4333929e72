"""pressure_lever: the pressure port lies ahead of or behind the origin."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="pressure_lever",
    subsystem="sensing",
    element="depth",
    summary="distance along x, forward positive",
    parameters=(Parameter("ahead", "m", -0.8, 0.8, spread=0.15, entry=ef.DEPTH_LEVER),),
)
