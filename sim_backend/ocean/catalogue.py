"""The catalogue of an ocean glider's unmodelled effects: as sim_backend/core/effects/catalogue, of its own model.

Labels mean what they mean for any vehicle (docs/reference/gap.md, Words); a spread is how far cases that are worth a
diagnosis
are likely to go (docs/explanation/ocean.md, Labels).
"""

from dataclasses import replace
from functools import cache

from glider.sim_backend.core.effects.base import Effect, Parameter
from glider.sim_backend.ocean.core import layout


def _row(place: str, label: str, summary: str, *parameters: Parameter) -> Effect:
    subsystem, element = place.split()
    placed = tuple(replace(p, entry=getattr(layout, p.place)) if p.place else p for p in parameters)
    return Effect(label, subsystem, element, summary, placed)


# fmt: off
EFFECTS = (
    # the hull drags more or less than its coefficient says: fouling, a broken fairing
    _row("hydrodynamics surge", "drag", "parasitic drag times 1 + scale",
         Parameter("scale", "1", -0.6, 10.0, 0.3, "F_DRAG")),
    # climbing drags more, or less, than diving
    _row("hydrodynamics surge", "climb_dive_asymmetry", "drag times 1 + share nose up, times 1 - share nose down",
         Parameter("share", "1", -0.9, 0.9, 0.15, "F_CLIMB_DIVE")),
    # the wings lift more or less than their coefficient says: one lost, or fouled
    _row("hydrodynamics heave", "lift", "lift slope times 1 + scale",
         Parameter("scale", "1", -0.8, 4.0, 0.3, "F_LIFT")),
    # the vehicle hangs to one side: a wing lost, a mass moved, or the sensor
    _row("hydrodynamics roll", "roll_trim", "added to the mean roll",
         Parameter("angle", "rad", -0.7, 0.7, 0.05, "F_ROLL_TRIM")),
    # heavier or lighter than its volume says
    _row("mass net", "net_buoyancy", "a constant net mass, heavy positive",
         Parameter("mass", "kg", -2.0, 2.0, 0.05, "F_NET_MASS")),
    # water comes in
    _row("actuation ballast", "ballast_leak", "mass gained from the start of the run on",
         Parameter("rate", "kg/s", 0.0, 1e-3, 5e-6, "F_LEAK")),
    # the buoyancy engine moves more or less than it says
    _row("mass net", "ballast_scale", "volume of the engine times 1 + scale",
         Parameter("scale", "1", -0.9, 2.0, 0.1, "F_OIL_SCALE")),
    # the hull is squeezed more than its file says
    _row("mass net", "compressibility", "added to the hull's compressibility",
         Parameter("slope", "1/Pa", -5e-9, 5e-9, 1e-10, "F_COMPRESSIBILITY")),
    # the hull's volume goes with the temperature more than its file says
    _row("mass net", "thermal_expansion", "added to the hull's thermal expansion",
         Parameter("slope", "1/K", -5e-4, 5e-4, 3e-5, "F_EXPANSION")),
    # the conductivity cell is fouled or out of calibration
    _row("sensing density", "density_bias", "the density reads so much too high",
         Parameter("bias", "kg/m3", -5.0, 5.0, 0.3, "F_DENSITY")),
    # the attitude sensor sits askew
    _row("sensing attitude", "imu_pitch_bias", "pitch reads so much too high",
         Parameter("angle", "rad", -0.35, 0.35, 0.02, "F_PITCH_BIAS")),
    # pitch reads a multiple of the truth
    _row("sensing attitude", "attitude_scale", "pitch reads 1 + scale times the truth",
         Parameter("scale", "1", -0.6, 1.0, 0.1, "F_PITCH_SCALE")),
    # the water rises and falls more than it did: its time history is unpredictable
    _row("environment water", "vertical_water", "vertical velocity of the water times 1 + scale",
         Parameter("scale", "1", 0.0, 20.0, 1.0)),
    # the attitude comes late
    _row("sensing attitude", "attitude_lag", "pitch follows with a time constant",
         Parameter("time", "s", 0.0, 60.0, 4.0, "F_ATTITUDE_LAG")),
)
# fmt: on

# What hardly ever changes at sea, against what often does (growth, ballast, a fouled cell): log odds, nat. 8 are three
# thousand to one; where readings ask for them all the same, they win. Drag grows more often than a wing is lost or an
# attitude sensor's scale goes: 3 are twenty to one.
ODDS = {
    **dict.fromkeys(("ballast_scale", "ballast_leak", "compressibility", "thermal_expansion"), -8.0),
    "attitude_lag": -8.0, "climb_dive_asymmetry": -8.0, "lift": -3.0, "attitude_scale": -3.0,
}  # fmt: skip

# Of depth rate alone one is the other: each changes the speed at a pitch, by a law that is known to a tenth at best.
ONE_ON_DEPTH = ("drag", "lift", "attitude_scale")

NOT_ASKED = {
    "depth_scale": "on depth rate it is drag",
    "inertia": "attitude is measured, not predicted",
    "servo_slow": "no servo is logged",
    "slider_scale": "attitude is measured, not predicted",
    "pitch_trim": "attitude is measured, not predicted",
    "current": "not seen without positions",
}  # labels of other vehicles' catalogue that mean something here and cannot be asked, and why


@cache
def catalogue() -> dict[str, Effect]:
    """Every effect by label."""
    return {effect.label: effect for effect in EFFECTS}
