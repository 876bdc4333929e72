"""cg_lateral: the centre of gravity lies to one side."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="cg_lateral",
    subsystem="mass",
    element="lateral",
    summary="offset along y, starboard positive",
    parameters=(Parameter("offset", "m", -0.02, 0.02, spread=0.0007, entry=ef.CG_OFFSET_Y),),
)
