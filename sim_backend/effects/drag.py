"""drag: the hull drags more or less than its coefficients say."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="drag",
    subsystem="hydrodynamics",
    element="surge",
    summary="K_D0 times 1 + scale, K_D times 1 + induced",
    parameters=(
        Parameter("scale", "1", -0.8, 5.0, spread=0.4, entry=ef.DRAG_0),
        Parameter("induced", "1", -0.8, 5.0, spread=0.4, entry=ef.DRAG_ALPHA),
    ),
)
