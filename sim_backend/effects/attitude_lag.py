"""attitude_lag: the attitude filter of the IMU reads late."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="attitude_lag",
    subsystem="sensing",
    element="attitude",
    summary="first-order lag of measured roll, pitch and yaw",
    parameters=(Parameter("time", "s", 0.0, 5.0, spread=0.3, entry=ef.ATTITUDE_LAG),),
)
