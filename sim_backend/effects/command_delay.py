"""command_delay: commands take effect late."""

from sim_backend.core import effect_layout as ef
from sim_backend.core.layout import LONGEST_DELAY
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="command_delay",
    subsystem="timing",
    element="command",
    summary="pure delay of all commands",
    parameters=(Parameter("delay", "s", 0.0, LONGEST_DELAY, spread=0.7, entry=ef.COMMAND_DELAY),),
)
