"""depth_lag: the pressure port answers late."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="depth_lag",
    subsystem="sensing",
    element="depth",
    summary="first-order lag of the measured depth",
    parameters=(Parameter("time", "s", 0.0, 8.0, spread=0.7, entry=ef.DEPTH_LAG),),
)
