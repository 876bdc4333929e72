"""pump_slow: the buoyancy pump is slower and follows later than its file says."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="pump_slow",
    subsystem="actuation",
    element="ballast",
    summary="rate limit divided by e^rate, time constant multiplied by e^lag",
    parameters=(
        Parameter("rate", "1", 0.0, 4.0, spread=0.8, entry=ef.PUMP_RATE_LOG),
        Parameter("lag", "1", 0.0, 4.0, spread=0.8, entry=ef.PUMP_LAG_LOG),
    ),
)
