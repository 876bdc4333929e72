"""slider_backlash: play between the screw and the mass; the draw-wire hangs on the mass."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="slider_backlash",
    subsystem="actuation",
    element="slider",
    summary="whole width of the play",
    parameters=(Parameter("width", "m", 0.0, 0.04, spread=0.005, entry=ef.SLIDER_PLAY),),
)
