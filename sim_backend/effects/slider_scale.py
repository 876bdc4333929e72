"""slider_scale: the sliding mass moves more or less than its draw-wire says."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="slider_scale",
    subsystem="mass",
    element="longitudinal",
    summary="slider position times 1 + scale",
    parameters=(Parameter("scale", "1", -0.95, 3.0, spread=0.15, entry=ef.SLIDER_SCALE),),
)
