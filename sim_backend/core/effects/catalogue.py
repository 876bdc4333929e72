"""The catalogue of effects: one table, a row for each label, and how effects are checked and added to a world.

A row says where the effect sits (subsystem and element), what it is called, what it changes, and its parameters: name,
unit, range, the prior's 1 sigma and the entry of the effect vector F that it sets. The entries' numbers follow from the
order here (sim_backend/core/effects/effect_layout). docs/how-to/adding.md says how to add one.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

from glider.hal.strict import ConfigError
from glider.sim_backend.core.effects import water_motion
from glider.sim_backend.core.effects.base import Effect, EffectError, Parameter
from glider.sim_backend.core.layout import LONGEST_DELAY


def _row(place: str, label: str, summary: str, *parameters: Parameter, apply: Callable[..., None] | None = None):
    subsystem, element = place.split()
    return Effect(label, subsystem, element, summary, parameters, apply)


# fmt: off
EFFECTS = (
    # --- actuation -----------------------------------------------------------------------------------------------
    # the servo turns slower and follows later than its file says
    _row("actuation servo", "servo_slow", "rate limit divided by e^rate, time constant multiplied by e^lag",
         Parameter("rate", "1", 0.0, 4.0, 1.0, "SERVO_RATE_LOG"),
         Parameter("lag", "1", 0.0, 4.0, 1.0, "SERVO_LAG_LOG")),
    # play between the servo and the rail: the rail stays where it is until the play is taken up
    _row("actuation servo", "servo_backlash", "whole width of the play",
         Parameter("width", "rad", 0.0, 1.0, 0.2, "SERVO_PLAY")),
    # the rail does not hang straight where the servo says 0
    _row("actuation servo", "servo_offset", "constant angle added to the servo",
         Parameter("angle", "rad", -0.8, 0.8, 0.15, "SERVO_OFFSET")),
    # the servo stops short of the range that its file gives, at something that may give way
    _row("actuation servo", "servo_limit",
         "`loss` taken off the range at both ends; `give` of what is commanded beyond is reached",
         Parameter("loss", "rad", 0.0, 1.0, 0.4, "SERVO_LIMIT"), Parameter("give", "1", 0.0, 0.9, 0.3, "SERVO_GIVE")),
    # the linear-mass actuator moves slower and follows later than its file says
    _row("actuation slider", "slider_slow", "rate limit divided by e^rate, time constant multiplied by e^lag",
         Parameter("rate", "1", 0.0, 4.0, 1.0, "SLIDER_RATE_LOG"),
         Parameter("lag", "1", 0.0, 4.0, 1.0, "SLIDER_LAG_LOG")),
    # play between the screw and the mass; the draw-wire hangs on the mass
    _row("actuation slider", "slider_backlash", "whole width of the play",
         Parameter("width", "m", 0.0, 0.04, 0.005, "SLIDER_PLAY")),
    # the buoyancy pump is slower and follows later than its file says
    _row("actuation ballast", "pump_slow", "rate limit divided by e^rate, time constant multiplied by e^lag",
         Parameter("rate", "1", 0.0, 4.0, 0.8, "PUMP_RATE_LOG"), Parameter("lag", "1", 0.0, 4.0, 0.8, "PUMP_LAG_LOG")),
    # the pump is slower the deeper it has to expel water
    _row("actuation ballast", "pump_droop", "rate limit when expelling multiplied by e^(-droop Z)",
         Parameter("droop", "1/m", 0.0, 0.6, 0.05, "PUMP_DROOP")),
    # water comes into the tank unseen by the draw-wire
    _row("actuation ballast", "ballast_leak", "mass gained from the start of the run on, at the tank",
         Parameter("rate", "kg/s", 0.0, 0.01, 0.0005, "BALLAST_LEAK")),
    # --- hydrodynamics -------------------------------------------------------------------------------------------
    # the hull drags more or less than its coefficients say
    _row("hydrodynamics surge", "drag", "K_D0 times 1 + scale, K_D times 1 + induced",
         Parameter("scale", "1", -0.8, 5.0, 0.4, "DRAG_0"), Parameter("induced", "1", -0.8, 5.0, 0.4, "DRAG_ALPHA")),
    # drag that grows with the speed and not with its square
    _row("hydrodynamics surge", "linear_drag", "force -k V against the motion through the water",
         Parameter("k", "N s/m", 0.0, 20.0, 0.5, "LINEAR_DRAG")),
    # climbing drags more, or less, than diving
    _row("hydrodynamics surge", "climb_dive_asymmetry", "drag times 1 + share nose up, times 1 - share nose down",
         Parameter("share", "1", -0.9, 0.9, 0.3, "CLIMB_DIVE")),
    # a line drags at the tail
    _row("hydrodynamics surge", "tether",
         "force -(k + growth z) V u at the tail, 6 cm above the axis; `across` of it against v, w",
         Parameter("k", "kg/m", 0.0, 20.0, 1.0, "TETHER"),
         Parameter("growth", "kg/m2", 0.0, 10.0, 0.3, "TETHER_GROWTH"),
         Parameter("across", "1", 0.0, 2.0, 0.5, "TETHER_ACROSS")),
    # the hull lifts more or less than its coefficient says
    _row("hydrodynamics heave", "lift", "K_L0 and K_L times 1 + scale",
         Parameter("scale", "1", -0.95, 4.0, 0.3, "LIFT")),
    # lift stops growing past an angle of attack
    _row("hydrodynamics heave", "stall", "lift of an angle of attack held within +-1/inverse",
         Parameter("inverse", "1/rad", 0.0, 100.0, 15.0, "STALL")),
    # the hull carries more or less water along than its file says
    _row("hydrodynamics heave", "added_mass", "added mass across, times 1 + heave and 1 + sway",
         Parameter("heave", "1", -0.95, 6.0, 0.5, "ADDED_Z"), Parameter("sway", "1", -0.95, 6.0, 0.5, "ADDED_Y")),
    # sideslip pushes more or less than its coefficient says
    _row("hydrodynamics sway", "side_force", "K_beta times 1 + scale",
         Parameter("scale", "1", -0.95, 5.0, 0.4, "SIDE")),
    # a bent fin: a roll moment that grows with the square of the speed
    _row("hydrodynamics roll", "roll_trim", "roll moment over V^2",
         Parameter("k", "kg", -2.0, 2.0, 0.1, "ROLL_TRIM")),
    # a pitch moment that grows with the square of the speed
    _row("hydrodynamics pitch", "pitch_trim", "added to K_M0",
         Parameter("k", "kg", -5.0, 5.0, 0.3, "PITCH_TRIM")),
    # pitching is damped more or less than its coefficient says, with the speed or, across the flow, with the rate
    _row("hydrodynamics pitch", "pitch_damping", "pitch moment K_q ((1 + scale) V^2 + across abs(q)) q",
         Parameter("scale", "1", -0.98, 8.0, 0.6, "PITCH_DAMPING"),
         Parameter("across", "m2/s", -1.0, 8.0, 0.5, "PITCH_DAMPING_ACROSS")),
    # a yaw moment that grows with the square of the speed
    _row("hydrodynamics yaw", "yaw_trim", "yaw moment over V^2",
         Parameter("k", "kg", -3.0, 3.0, 0.2, "YAW_TRIM")),
    # sideslip turns the bow more or less than its coefficient says
    _row("hydrodynamics yaw", "weathercock", "K_MY times 1 + scale",
         Parameter("scale", "1", -0.95, 5.0, 0.3, "WEATHERCOCK")),
    # yawing is damped more or less than its coefficient says, with the speed or, across the flow, with the rate
    _row("hydrodynamics yaw", "yaw_damping", "yaw moment K_r ((1 + scale) V^2 + across abs(r)) r",
         Parameter("scale", "1", -0.98, 8.0, 0.6, "YAW_DAMPING"),
         Parameter("across", "m2/s", -1.0, 8.0, 0.5, "YAW_DAMPING_ACROSS")),
    # --- mass ----------------------------------------------------------------------------------------------------
    # the vehicle was ballasted heavy or light; the missing mass acts at the origin
    _row("mass net", "net_buoyancy", "a constant net mass at the origin, heavy positive",
         Parameter("mass", "kg", -0.3, 0.3, 0.02, "NET_MASS_OFFSET")),
    # the tank holds more or less than its draw-wire says
    _row("mass net", "ballast_scale", "ballast mass times 1 + scale, at the tank",
         Parameter("scale", "1", -0.9, 3.0, 0.15, "BALLAST_SCALE")),
    # the hull is squeezed and the vehicle becomes heavier with depth
    _row("mass net", "compressibility", "net mass at the origin a metre of depth",
         Parameter("slope", "kg/m", 0.0, 0.05, 0.002, "MASS_PER_DEPTH")),
    # denser water below makes the vehicle lighter with depth
    _row("mass net", "stratification", "net mass at the origin a metre of depth below a mixed layer, negative",
         Parameter("slope", "kg/m", -0.05, 0.0, 0.002, "MASS_PER_DEPTH"),
         Parameter("mixed", "m", 0.0, 30.0, 1.0, "MIXED_LAYER")),
    # the centre of gravity lies ahead of or behind where trim should have put it
    _row("mass longitudinal", "cg_longitudinal", "offset along x, forward positive",
         Parameter("offset", "m", -0.02, 0.02, 0.0007, "CG_OFFSET_X")),
    # the centre of gravity lies to one side
    _row("mass lateral", "cg_lateral", "offset along y, starboard positive",
         Parameter("offset", "m", -0.02, 0.02, 0.0007, "CG_OFFSET_Y")),
    # the centre of gravity lies lower or higher than its file says
    _row("mass vertical", "cg_vertical", "offset along z, down positive",
         Parameter("offset", "m", -0.01, 0.03, 0.001, "CG_OFFSET_Z")),
    # the sliding mass moves more or less than its draw-wire says
    _row("mass longitudinal", "slider_scale", "slider position times 1 + scale",
         Parameter("scale", "1", -0.95, 3.0, 0.15, "SLIDER_SCALE")),
    # the hull is harder or easier to turn than its file says
    _row("mass inertia", "inertia", "hull inertia times 1 + pitch and 1 + yaw",
         Parameter("pitch", "1", -0.9, 10.0, 0.7, "INERTIA_Y"), Parameter("yaw", "1", -0.9, 10.0, 0.7, "INERTIA_Z")),
    # --- environment ---------------------------------------------------------------------------------------------
    # the water moves evenly and carries the vehicle along
    _row("environment water", "current", "velocity of the water",
         Parameter("north", "m/s", -1.0, 1.0, 0.1, "CURRENT_N"),
         Parameter("east", "m/s", -1.0, 1.0, 0.1, "CURRENT_E")),
    # the water moves faster the deeper
    _row("environment water", "current_shear", "velocity of the water a metre of depth",
         Parameter("north", "1/s", -0.3, 0.3, 0.02, "SHEAR_N"), Parameter("east", "1/s", -0.3, 0.3, 0.02, "SHEAR_E")),
    # the water is more or less turbulent than its file says
    _row("environment water", "turbulence", "strength of the disturbance times 1 + scale",
         Parameter("scale", "1", -1.0, 50.0, 2.0), apply=water_motion.scale_disturbance),
    # a swell runs over the vehicle, dying out with depth
    _row("environment water", "waves",
         "surface waves of a narrow spectrum in deep water: orbits of the amplitude, shrinking by e^(-k Z)",
         Parameter("amplitude", "m", 0.0, 2.0, 0.1), Parameter("period", "s", 2.0, 10.0, 1.5, default=5.0),
         Parameter("direction", "rad", -math.pi, math.pi, 1.8), apply=water_motion.add_waves),
    # --- sensing -------------------------------------------------------------------------------------------------
    # the IMU is mounted tilted to one side; its roll reads a constant too much
    _row("sensing attitude", "imu_roll_bias", "constant error of the measured roll, starboard down positive",
         Parameter("angle", "rad", -0.4, 0.4, 0.05, "ROLL_BIAS")),
    # the IMU is mounted nose up or down; its pitch reads a constant too much
    _row("sensing attitude", "imu_pitch_bias", "constant error of the measured pitch, nose up positive",
         Parameter("angle", "rad", -0.4, 0.4, 0.05, "PITCH_BIAS")),
    # the pitch is turned into radians by a wrong factor, or its filter falls short
    _row("sensing attitude", "attitude_scale", "measured pitch times 1 + scale",
         Parameter("scale", "1", -0.9, 4.0, 0.15, "PITCH_SCALE")),
    # iron near the compass: its heading errs with the heading
    _row("sensing attitude", "compass", "error s1 sin(yaw) + c1 cos(yaw) + s2 sin(2 yaw) + c2 cos(2 yaw)",
         Parameter("s1", "rad", -0.8, 0.8, 0.1, "COMPASS_S1"), Parameter("c1", "rad", -0.8, 0.8, 0.1, "COMPASS_C1"),
         Parameter("s2", "rad", -0.8, 0.8, 0.1, "COMPASS_S2"), Parameter("c2", "rad", -0.8, 0.8, 0.1, "COMPASS_C2")),
    # the attitude filter of the IMU reads late
    _row("sensing attitude", "attitude_lag", "first-order lag of measured roll, pitch and yaw",
         Parameter("time", "s", 0.0, 5.0, 0.3, "ATTITUDE_LAG")),
    # the gyro reads more or less than the rate
    _row("sensing gyro", "gyro_scale", "measured rates times 1 + scale",
         Parameter("scale", "1", -0.95, 5.0, 0.4, "GYRO_SCALE")),
    # the gyro reads a constant too much
    _row("sensing gyro", "gyro_bias", "constant error of each measured rate",
         Parameter("p", "rad/s", -0.2, 0.2, 0.01, "GYRO_P"), Parameter("q", "rad/s", -0.2, 0.2, 0.01, "GYRO_Q"),
         Parameter("r", "rad/s", -0.2, 0.2, 0.01, "GYRO_R")),
    # the pressure reads a constant too deep
    _row("sensing depth", "depth_offset", "constant error of the measured depth",
         Parameter("offset", "m", -3.0, 3.0, 0.15, "DEPTH_OFFSET")),
    # the pressure is turned into depth by a wrong factor
    _row("sensing depth", "depth_scale", "measured depth times 1 + scale",
         Parameter("scale", "1", -0.6, 1.0, 0.06, "DEPTH_SCALE")),
    # the pressure port answers late
    _row("sensing depth", "depth_lag", "first-order lag of the measured depth",
         Parameter("time", "s", 0.0, 8.0, 0.7, "DEPTH_LAG")),
    # the pressure port lies ahead of or behind the origin
    _row("sensing depth", "pressure_lever", "distance along x, forward positive",
         Parameter("ahead", "m", -0.8, 0.8, 0.15, "DEPTH_LEVER")),
    # --- timing --------------------------------------------------------------------------------------------------
    # commands take effect late
    _row("timing command", "command_delay", "pure delay of all commands",
         Parameter("delay", "s", 0.0, LONGEST_DELAY, 0.7, "COMMAND_DELAY")),
    # motion capture is stamped late
    _row("timing mocap", "mocap_delay", "pose of this long ago",
         Parameter("delay", "s", -2.0, 6.0, 0.4, "MOCAP_DELAY")),
    # the clock of motion capture runs away from the onboard one
    _row("timing mocap", "clock_skew", "pose of t times skew ago",
         Parameter("skew", "1", -0.2, 0.2, 0.005, "CLOCK_SKEW")),
)
# fmt: on

ENTRIES = tuple(dict.fromkeys(p.place for effect in EFFECTS for p in effect.parameters if p.place))  # of F, in order


@cache
def catalogue() -> dict[str, Effect]:
    """All effects by label, their parameters with the numbers of their entries."""
    numbers = {place: number for number, place in enumerate(ENTRIES)}
    found = {}
    for effect in sorted(EFFECTS, key=lambda effect: effect.label):
        parameters = tuple(replace(p, entry=numbers.get(p.place, -1)) for p in effect.parameters)
        found[effect.label] = replace(effect, parameters=parameters)
    return found


def check_values(label: str, values: dict[str, float], effects: Mapping[str, Effect] | None = None) -> dict[str, float]:
    """The effect's parameters with defaults filled in; EffectError names what is wrong. effects: another catalogue."""
    effects = catalogue() if effects is None else effects
    if label not in effects:
        raise EffectError(f"no effect '{label}'; known: {', '.join(effects)}")
    known = {parameter.name: parameter for parameter in effects[label].parameters}
    for name, value in values.items():
        if name not in known:
            raise EffectError(f"effect {label} has no parameter '{name}'; it has {', '.join(known)}")
        parameter = known[name]
        if not parameter.low <= value <= parameter.high:
            unit = "" if parameter.unit == "1" else f" {parameter.unit}"
            raise EffectError(
                f"effect {label}: {name} = {value:g} is outside {parameter.low:g} to {parameter.high:g}{unit}"
            )
    return {name: values.get(name, parameter.default) for name, parameter in known.items()}


def check_flown(label: str, values: dict[str, float]) -> dict[str, float]:
    """The same for an effect that is to be flown: EffectError also for one of motion capture, which no flight has."""
    checked = check_values(label, values)
    effect = catalogue()[label]
    if (effect.subsystem, effect.element) == ("timing", "mocap"):
        raise EffectError(f"effect {label} is one of motion capture's clock: no flight has motion capture")
    return checked


def check_board(effects: dict[str, dict[str, float]], source: str) -> None:
    """The [effects] of a board file; ConfigError says which is wrong."""
    for label, values in effects.items():
        try:
            check_flown(label, values)
        except EffectError as error:
            raise ConfigError(source, str(error), key=f"effects.{label}") from None


def apply_effects(world: Any, effects: dict[str, dict[str, float]]) -> None:
    """Add the effects to a world that has not begun to move."""
    for label, values in effects.items():
        catalogue()[label].add(world, check_flown(label, values))
