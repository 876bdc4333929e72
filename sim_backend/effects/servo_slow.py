"""servo_slow: the servo turns slower and follows later than its file says."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="servo_slow",
    subsystem="actuation",
    element="servo",
    summary="rate limit divided by e^rate, time constant multiplied by e^lag",
    parameters=(
        Parameter("rate", "1", 0.0, 4.0, spread=1.0, entry=ef.SERVO_RATE_LOG),
        Parameter("lag", "1", 0.0, 4.0, spread=1.0, entry=ef.SERVO_LAG_LOG),
    ),
)
