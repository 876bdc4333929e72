"""depth_scale: the pressure is turned into depth by a wrong factor."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="depth_scale",
    subsystem="sensing",
    element="depth",
    summary="measured depth times 1 + scale",
    parameters=(Parameter("scale", "1", -0.6, 1.0, spread=0.06, entry=ef.DEPTH_SCALE),),
)
