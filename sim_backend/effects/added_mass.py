"""added_mass: the hull carries more or less water along than its file says."""

from sim_backend.core import effect_layout as ef
from sim_backend.effects.base import Effect, Parameter

EFFECT = Effect(
    label="added_mass",
    subsystem="hydrodynamics",
    element="heave",
    summary="added mass across, times 1 + heave and 1 + sway",
    parameters=(
        Parameter("heave", "1", -0.95, 6.0, spread=0.5, entry=ef.ADDED_Z),
        Parameter("sway", "1", -0.95, 6.0, spread=0.5, entry=ef.ADDED_Y),
    ),
)
