"""clock_skew: the clock of motion capture runs away from the onboard one."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="clock_skew",
    subsystem="timing",
    element="mocap",
    summary="pose of t times skew ago",
    parameters=(Parameter("skew", "1", -0.2, 0.2, spread=0.005, entry=ef.CLOCK_SKEW),),
)
