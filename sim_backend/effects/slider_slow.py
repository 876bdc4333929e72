"""slider_slow: the linear-mass actuator moves slower and follows later than its file says."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="slider_slow",
    subsystem="actuation",
    element="slider",
    summary="rate limit divided by e^rate, time constant multiplied by e^lag",
    parameters=(
        Parameter("rate", "1", 0.0, 4.0, spread=1.0, entry=ef.SLIDER_RATE_LOG),
        Parameter("lag", "1", 0.0, 4.0, spread=1.0, entry=ef.SLIDER_LAG_LOG),
    ),
)
