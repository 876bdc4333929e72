"""cg_longitudinal: the centre of gravity lies ahead of or behind where trim should have put it."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="cg_longitudinal",
    subsystem="mass",
    element="longitudinal",
    summary="offset along x, forward positive",
    parameters=(Parameter("offset", "m", -0.02, 0.02, spread=0.0007, entry=ef.CG_OFFSET_X),),
)
