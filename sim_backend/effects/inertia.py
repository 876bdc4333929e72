"""inertia: the hull is harder or easier to turn than its file says."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="inertia",
    subsystem="mass",
    element="inertia",
    summary="hull inertia times 1 + pitch and 1 + yaw",
    parameters=(
        Parameter("pitch", "1", -0.9, 10.0, spread=0.7, entry=ef.INERTIA_Y),
        Parameter("yaw", "1", -0.9, 10.0, spread=0.7, entry=ef.INERTIA_Z),
    ),
)
