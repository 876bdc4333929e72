"""side_force: sideslip pushes more or less than its coefficient says."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="side_force",
    subsystem="hydrodynamics",
    element="sway",
    summary="K_beta times 1 + scale",
    parameters=(Parameter("scale", "1", -0.95, 5.0, spread=0.4, entry=ef.SIDE),),
)
