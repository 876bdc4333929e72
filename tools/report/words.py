"""A diagnosis in plain words: the verdict as one sentence, what is left, and numbers with units that a person reads."""

import math
from typing import Any

from sim_backend.effects.catalogue import catalogue
from tools.diagnose.diagnosis import Diagnosis, places
from tools.diagnose.doubt import UNCLEAN
from tools.diagnose.probes import TURBULENCE, UNPREDICTABLE
from tools.diagnose.residuals import Finding
from tools.diagnose.shrink import Shrinkage
from tools.diagnose.verdict import SHAPES, strongest_left

MINUS, DASH = "\N{MINUS SIGN}", "\N{EN DASH}"
PLAIN = {
    "added_mass": "the water carried along across the hull is more or less than modelled",
    "attitude_lag": "measured attitude lags behind the motion",
    "ballast_leak": "the vehicle takes on water, unseen by the tank's draw-wire",
    "ballast_scale": "the tank holds more or less than its draw-wire says",
    "cg_lateral": "the centre of gravity lies off to one side",
    "cg_longitudinal": "the centre of gravity lies further forward or aft than modelled",
    "cg_vertical": "the centre of gravity lies higher or lower than modelled",
    "climb_dive_asymmetry": "drag differs between climbing and diving",
    "clock_skew": "motion capture's clock runs fast or slow",
    "command_delay": "commands take effect late",
    "compass": "the compass errs with heading",
    "compressibility": "the vehicle grows heavier with depth",
    "current": "the water moves and carries the vehicle along",
    "current_shear": "the water's motion changes with depth",
    "depth_lag": "measured depth lags behind the motion",
    "depth_offset": "measured depth is off by a constant",
    "depth_scale": "measured depth is off by a factor",
    "drag": "the hull drags more or less than its coefficients say",
    "gyro_bias": "measured rates are off by a constant",
    "gyro_scale": "measured rates are off by a factor",
    "imu_pitch_bias": "measured pitch is off by a constant",
    "imu_roll_bias": "measured roll is off by a constant",
    "inertia": "the hull resists turning more or less than modelled",
    "lift": "the wings lift more or less than their coefficient says",
    "linear_drag": "a drag in proportion to speed is missing",
    "mocap_delay": "motion capture reports late",
    "net_buoyancy": "the vehicle is ballasted heavy or light",
    "pitch_damping": "pitching is damped more or less than modelled",
    "pitch_trim": "the water turns the nose up or down, more with speed",
    "pressure_lever": "the pressure port lies ahead of or behind the origin",
    "pump_droop": "the pump slows down with depth when expelling",
    "pump_slow": "the ballast pump is slower than modelled",
    "roll_trim": "the water rolls the hull to one side, more with speed",
    "servo_backlash": "the servo has play",
    "servo_limit": "the servo stops short of its range",
    "servo_offset": "the servo stands off its command by a constant angle",
    "servo_slow": "the servo is slower than modelled",
    "side_force": "the hull resists sideslip more or less than modelled",
    "slider_backlash": "the slider has play",
    "slider_scale": "the sliding mass moves more or less than its draw-wire says",
    "slider_slow": "the slider is slower than modelled",
    "stall": "lift stops growing past an angle of attack",
    "stratification": "the vehicle grows lighter with depth",
    "tether": "a line drags at the tail",
    "turbulence": "the water is rougher than the vehicle file says",
    "waves": "surface waves move the vehicle",
    "weathercock": "the hull turns into or out of sideslip more or less than modelled",
    "yaw_damping": "yawing is damped more or less than modelled",
    "yaw_trim": "the water turns the nose to one side, more with speed",
}
CHANNEL_WORDS = {
    "p": "roll rate", "q": "pitch rate", "r": "yaw rate", "slider": "slider position", "ballast": "ballast mass",
    "mocap x": "position north by motion capture", "mocap y": "position east by motion capture",
    "mocap z": "depth by motion capture", "mocap roll": "roll by motion capture",
    "mocap pitch": "pitch by motion capture", "mocap yaw": "yaw by motion capture",
}  # fmt: skip
AXES = {
    "roll": "roll axis", "p": "roll axis", "pitch": "pitch axis", "q": "pitch axis", "yaw": "yaw axis", "r": "yaw axis",
    "depth": "vertical", "slider": "slider", "ballast": "ballast tank", "mocap x": "horizontal",
    "mocap y": "horizontal", "mocap z": "vertical", "mocap roll": "roll axis",
    "mocap pitch": "pitch axis", "mocap yaw": "yaw axis",
}  # fmt: skip
SURE, LITTLE = 0.8, 0.02  # below the first the next answer is named, unless it is below the second
MEANS = {"none": "no gap", "unknown": "a gap of another kind"}
READABLE = {"rad": ("deg", 180.0 / math.pi), "rad/s": ("deg/s", 180.0 / math.pi), "1/rad": ("1/deg", math.pi / 180.0)}


def number(value: float) -> str:
    """Three digits that count, with a true minus."""
    if not math.isfinite(value):
        return DASH
    if abs(value) < 1e-8:
        return "0"
    digits = min(max(0, 2 - math.floor(math.log10(abs(value)))), 9)
    return f"{value:.{digits}f}".replace("-", MINUS)


def percent(share: float) -> str:
    """A share as whole percent, with a true minus."""
    return f"{100.0 * share:.0f}".replace("-0", "0").replace("-", MINUS) + " %" if math.isfinite(share) else "unknown"


def sure(p: float) -> str:
    """A probability in words; never certain."""
    if p >= 0.995:
        return "more than 99 %"
    return "less than 1 %" if p < 0.005 else f"{100.0 * p:.0f} %"


def small_percent(p: float) -> str:
    """A probability with one decimal; neither 0 nor 1."""
    return "< 0.1 %" if p < 0.0005 else "> 99.9 %" if p > 0.9995 else f"{100.0 * p:.1f} %"


def nats(value: float) -> str:
    return "more than 1000 nat" if value > 1000.0 else f"{value:.0f} nat"


def scaled(values: list[float], unit: str, mass: bool = True) -> tuple[list[float], str]:
    """SI values in the unit that is easiest to read; a trim's kg is no mass (N m over m2/s2) and stays."""
    if unit in READABLE:
        shown, factor = READABLE[unit]
        return [factor * value for value in values], shown
    largest = max(abs(value) for value in values)
    if mass and unit.startswith("kg") and largest < 1.0:
        return [1000.0 * value for value in values], unit[1:]
    if unit == "m" and largest < 0.1:
        return [1000.0 * value for value in values], "mm"
    return values, "" if unit == "1" else unit


def quantity(value: float, unit: str) -> str:
    """A number with its unit, the one that is easiest to read."""
    values, shown = scaled([value], unit)
    return f"{number(values[0])} {shown}".strip()


def place(label: str) -> str:
    """`subsystem: element` of a label."""
    effect = catalogue()[label]
    return f"{effect.subsystem}: {effect.element}"


def joined(parts: list[str]) -> str:
    """a, b and c."""
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)


def upper(text: str) -> str:
    return text[:1].upper() + text[1:]


def channel(name: str) -> str:
    return CHANNEL_WORDS.get(name, name)


def left_of(before: float, after: float) -> float:
    """Shrinkage, NaN where there was no gap."""
    return 1.0 - after / before if before > 0.0 else math.nan


def change(share: float) -> str:
    """`shrinks by 12 %` or, where it does not, `grows by 3 %`."""
    return f"grows by {percent(-share)}" if share < -0.005 else f"shrinks by {percent(max(share, 0.0))}"


def interval(low: float, high: float) -> str:
    """A 90 % interval of a share."""
    return f"90 % interval {percent(low).removesuffix(' %')} to {percent(high)}"


def how_far(diagnosis: Diagnosis, with_what: str) -> str:
    """The shrinkage on runs left out, and what recalibration alone does."""
    s = diagnosis.shrinkage
    return (
        f"{with_what} the gap on runs left out of the fit {change(s.shrinkage)} ({interval(*s.ci90)}), "
        f"while refitting the nominal parameters alone {alone(s)}"
    )


def alone(s: Shrinkage) -> str:
    """What recalibration does to the gap, as the end of a sentence."""
    share = left_of(s.before, s.recalibrated)
    return f"makes it {percent(-share)} larger" if share < -0.005 else f"shrinks it by {percent(max(share, 0.0))}"


def how_sure(diagnosis: Diagnosis) -> str:
    """`97 % sure`; where that is little, what else it may be."""
    answer = diagnosis.answer
    p = answer.probabilities[answer.main]
    others = {label: chance for label, chance in answer.probabilities.items() if label != answer.main}
    second = max(others, key=lambda label: others[label])
    if p >= SURE or others[second] < LITTLE:
        return f"{sure(p)} sure"
    return f"only {sure(p)} sure, else {MEANS.get(second, second)} at {sure(others[second])}"


def sentence(diagnosis: Diagnosis) -> str:
    """The verdict in one plain sentence: what, where, how sure, how far."""
    if diagnosis.verdict == "none":
        return _none(diagnosis)
    if diagnosis.verdict == "unknown":
        return _unknown(diagnosis)
    if diagnosis.answer.main in UNPREDICTABLE:
        return _scatter(diagnosis)
    return _causes(diagnosis)


def _none(diagnosis: Diagnosis) -> str:
    s = diagnosis.shrinkage
    return (
        "No gap: noise, disturbance and parameters within their uncertainty explain these runs "
        f"({how_sure(diagnosis)}); on runs left out of the fit the total stands at {number(s.before)} tolerances with "
        f"the nominal model and at {number(s.recalibrated)} with its parameters refitted, where noise and disturbance "
        f"alone leave {number(s.floor)}."
    )


def _causes(diagnosis: Diagnosis) -> str:
    answer = diagnosis.answer
    others = [label for label in answer.selected if label != answer.main]
    alike = [label for label in answer.groups.get(answer.main, []) if label != answer.main]
    said = f"{PLAIN[answer.main]} ({answer.main}, {place(answer.main)}; {how_sure(diagnosis)})"
    if alike:
        said += f", which these data cannot tell from {joined(alike)}"
    if others:
        beside = joined([f"{PLAIN[label]} ({label}, {place(label)})" for label in others])
        said += f", and beside it {beside}"
    if answer.noise is not None:  # told of the clock: of water in disorder _scatter speaks
        said += "; that clock wanders"
    head = {0: "", 1: "Two effects at once: "}.get(len(others), f"{len(others) + 1} effects at once: ")
    far = how_far(diagnosis, "with that in the model" if not others else "with these in the model")
    return f"{upper(head + said)}; {far}."


def _scatter(diagnosis: Diagnosis) -> str:
    answer, s = diagnosis.answer, diagnosis.shrinkage
    main, noise = answer.main, answer.noise
    size = ""
    if main == TURBULENCE and noise is not None:
        size = f", about {noise.scale:.2g} times as rough"
    others = [label for label in answer.selected if label != main]
    beside = f", and beside it {joined([f'{PLAIN[o]} ({o}, {place(o)})' for o in others])}" if others else ""
    return (
        f"{upper(PLAIN[main])}{size} ({main}, {place(main)}; {how_sure(diagnosis)}){beside}; its "
        f"course cannot be predicted, so that knowing it shrinks no gap, and on runs left out of the fit refitting the "
        f"nominal parameters {alone(s)}, to {number(s.recalibrated)} tolerances."
    )


def _unknown(diagnosis: Diagnosis) -> str:
    answer = diagnosis.answer
    said = f"A gap that no effect of the catalogue explains ({how_sure(diagnosis)})"
    strongest, goes = strongest_left(answer.findings)
    if strongest is not None:
        said += f", strongest in measured {channel(strongest.channel)}"
    if strongest is not None and goes is not None:
        elsewhere = f", in measured {channel(goes.channel)}," if goes.channel != strongest.channel else ""
        said += f" and{elsewhere} going with {goes.test}"
    likely = places(answer)[:1]
    if likely:
        said += f", likeliest in {likely[0]['subsystem']}: {likely[0]['element']} ({sure(likely[0]['probability'])})"
    known = "with nothing added to the model"
    if answer.selected:
        known = f"with the nearest known effects in the model ({joined(answer.selected)})"
    said += f"; {how_far(diagnosis, known)}"
    if diagnosis.correction is not None and diagnosis.further is not None:
        said += (
            (
                f"; a data-driven correction of the {diagnosis.correction.link}, going with "
                f"{joined(list(diagnosis.correction.carried))}, {change(diagnosis.further.shrinkage)}"
            )
            .replace("shrinks by", "would shrink it by")
            .replace("grows by", "would make it larger by")
        )
    return f"{said}."


def finding(found: Finding, rate_hz: float) -> str:
    """What a test says, after the channel's name."""
    if found.test == "variance":
        return "scatters more than noise and disturbance allow" if found.sigma > 0 else "scatters less than expected"
    if found.test == "mean":
        return "off by a constant in some runs"
    if found.test == "spectrum":
        return "one period stands out"
    if found.test.startswith("lag"):
        low, high = (f"{int(part) / rate_hz:.2g}" for part in found.test.split()[1].split("-"))
        return f"hangs together over {low} to {high} s"
    return f"goes with {found.test}"


def described(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """What is left by channel, strongest first: channel, axis, its shape, what it goes with, sigma."""
    rows: dict[str, dict[str, Any]] = {}
    for found in diagnosis.answer.findings:
        if abs(found.sigma) < UNCLEAN:
            continue
        empty = {"channel": channel(found.channel), "axis": AXES[found.channel], "sigma": 0.0, "shape": [], "goes": []}
        row = rows.setdefault(found.channel, empty)
        row["sigma"] = max(row["sigma"], float(abs(found.sigma)))
        text = f"{finding(found, diagnosis.case.log_rate_hz)} ({abs(found.sigma):.0f})"
        kind, most = ("shape", 1) if found.test.startswith(SHAPES) else ("goes", 3)
        if len(row[kind]) < most:
            row[kind].append(text)
    return list(rows.values())
