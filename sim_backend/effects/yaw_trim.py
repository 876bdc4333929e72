"""yaw_trim: a yaw moment that grows with the square of the speed."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="yaw_trim",
    subsystem="hydrodynamics",
    element="yaw",
    summary="yaw moment over V^2",
    parameters=(Parameter("k", "kg", -3.0, 3.0, spread=0.2, entry=ef.YAW_TRIM),),
)
