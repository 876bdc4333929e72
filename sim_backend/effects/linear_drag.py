"""linear_drag: drag that grows with the speed and not with its square."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="linear_drag",
    subsystem="hydrodynamics",
    element="surge",
    summary="force -k V against the motion through the water",
    parameters=(Parameter("k", "N s/m", 0.0, 20.0, spread=0.5, entry=ef.LINEAR_DRAG),),
)
