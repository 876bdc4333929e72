"""compass: iron near the compass: its heading errs with the heading."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="compass",
    subsystem="sensing",
    element="attitude",
    summary="error s1 sin(yaw) + c1 cos(yaw) + s2 sin(2 yaw) + c2 cos(2 yaw)",
    parameters=(
        Parameter("s1", "rad", -0.8, 0.8, spread=0.1, entry=ef.COMPASS_S1),
        Parameter("c1", "rad", -0.8, 0.8, spread=0.1, entry=ef.COMPASS_C1),
        Parameter("s2", "rad", -0.8, 0.8, spread=0.1, entry=ef.COMPASS_S2),
        Parameter("c2", "rad", -0.8, 0.8, spread=0.1, entry=ef.COMPASS_C2),
    ),
)
