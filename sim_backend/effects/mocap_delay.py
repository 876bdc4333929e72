"""mocap_delay: motion capture is stamped late."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="mocap_delay",
    subsystem="timing",
    element="mocap",
    summary="pose of this long ago",
    parameters=(Parameter("delay", "s", -2.0, 6.0, spread=0.4, entry=ef.MOCAP_DELAY),),
)
