"""pump_droop: the pump is slower the deeper it has to expel water."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="pump_droop",
    subsystem="actuation",
    element="ballast",
    summary="rate limit when expelling multiplied by e^(-droop Z)",
    parameters=(Parameter("droop", "1/m", 0.0, 0.6, spread=0.05, entry=ef.PUMP_DROOP),),
)
