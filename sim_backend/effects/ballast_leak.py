"""ballast_leak: water comes into the tank unseen by the draw-wire."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="ballast_leak",
    subsystem="actuation",
    element="ballast",
    summary="mass gained from the start of the run on, at the tank",
    parameters=(Parameter("rate", "kg/s", 0.0, 0.01, spread=0.0005, entry=ef.BALLAST_LEAK),),
)
