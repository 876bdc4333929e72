"""tether: a line drags at the tail."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="tether",
    subsystem="hydrodynamics",
    element="surge",
    summary="force -(k + growth z) V u at the tail, 6 cm above the axis; `across` of it against v, w",
    parameters=(
        Parameter("k", "kg/m", 0.0, 20.0, spread=1.0, entry=ef.TETHER),
        Parameter("growth", "kg/m2", 0.0, 10.0, spread=0.3, entry=ef.TETHER_GROWTH),
        Parameter("across", "1", 0.0, 2.0, spread=0.5, entry=ef.TETHER_ACROSS),
    ),
)
