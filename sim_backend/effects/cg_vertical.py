"""cg_vertical: the centre of gravity lies lower or higher than its file says."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="cg_vertical",
    subsystem="mass",
    element="vertical",
    summary="offset along z, down positive",
    parameters=(Parameter("offset", "m", -0.01, 0.03, spread=0.001, entry=ef.CG_OFFSET_Z),),
)
