"""tether: a line drags at the tail."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="tether",
    subsystem="hydrodynamics",
    element="surge",
    summary="force -k |u| u along the hull, 6 cm above its axis",
    parameters=(Parameter("k", "kg/m", 0.0, 20.0, spread=1.0, entry=ef.TETHER),),
)
