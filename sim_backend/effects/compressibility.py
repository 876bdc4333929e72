"""compressibility: the hull is squeezed and the vehicle becomes heavier with depth."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="compressibility",
    subsystem="mass",
    element="net",
    summary="net mass at the origin a metre of depth",
    parameters=(Parameter("slope", "kg/m", 0.0, 0.05, spread=0.002, entry=ef.MASS_PER_DEPTH),),
)
