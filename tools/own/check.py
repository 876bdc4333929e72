"""A user's model tried before it is used: shapes, numbers, purity, smoothness; errors name the user's file and line."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.data.errors import InputError
from glider.tools.own.declare import USUAL_START
from glider.tools.own.load import LoadedVehicle, called, read_own

TRIED, SEED, STEP_SECONDS = 4, 20260, 0.05  # states about rest; of their draws; s
ENERGY_SECONDS, GROWS = 1e-4, 1e-3  # along the motion; of the powers that flow between states
ENERGY_SCALES, ENERGY_STATES = (0.1, 1.0, 10.0), 40  # times the usual states about rest; states of each
DEAD_SCALES, DEAD_STATES = (0.1, 1.0, 10.0, 100.0, 1000.0), 20  # of inputs, and to 10 of states about rest; of each
SMOOTH_STEPS, SMOOTH = (1e-3, 1e-5), 0.3  # of a parameter's uncertainty; by which its two derivatives may differ


@dataclass(frozen=True)
class Trial:
    """A point at which functions are called."""

    x: np.ndarray
    u: np.ndarray
    w: np.ndarray
    theta: np.ndarray


def trials(vehicle: LoadedVehicle, count: int = TRIED, times: float = 1.0) -> list[Trial]:
    """States about rest, `times` as far as is usual, small inputs, the file's parameters."""
    x, u, w, theta = vehicle.zeros()
    random = np.random.default_rng(SEED)
    scale = np.array([one.start_uncertainty or USUAL_START.get(one.unit, 0.1) for one in vehicle.declared.states])
    found = [Trial(x, u, w, theta)]
    for _ in range(count - 1):
        moved = x + times * scale * random.standard_normal(len(x)) if len(x) else x
        found.append(Trial(moved, 0.1 * random.standard_normal(len(u)), w, theta))
    return found


def load_own(path: Path) -> LoadedVehicle:
    """A vehicle file with `model`, tried; ConfigError or InputError, one line, where file or model cannot be used."""
    found = read_own(path)
    found.notes += check_model(found)
    return found


def check_model(vehicle: LoadedVehicle) -> list[str]:
    """What a model is short of, a line each; InputError where it cannot be used at all."""
    if vehicle.level == 0:
        return []
    motion = "step" if hasattr(vehicle.model, "step") else "derivative"
    points, lost = trials(vehicle), dict.fromkeys((motion, "measure"), 0)
    for point in points:
        for name in (motion, "measure"):
            wanted = len(vehicle.declared.states if name == motion else vehicle.declared.outputs)
            found = _twice(vehicle, name, arguments(name, point), wanted)
            lost[name] += not np.isfinite(found).all()
    notes = []
    for name, count in lost.items():
        if count == len(points):
            at = _first_bad(vehicle, name, points[0])
            raise InputError(f"{name}: not a finite number for {at}, at rest and about it", source=vehicle.source)
        if count:
            notes.append(f"{name} has no finite answer at {count} of {len(points)} states tried about rest")
    _pure(vehicle, motion, points)
    return notes + _dead(vehicle, motion) + _not_smooth(vehicle, motion, points[-1]) + _energy_grows(vehicle, motion)


def arguments(name: str, point: Trial) -> tuple[Any, ...]:
    """What a function of the model is called with."""
    if name == "step":
        return point.x, point.u, point.w, point.theta, STEP_SECONDS
    return (point.x, point.u, point.w, point.theta) if name == "derivative" else (point.x, point.u, point.theta)


def _call(vehicle: LoadedVehicle, name: str, given: tuple[Any, ...], wanted: int) -> np.ndarray:
    found = called(vehicle, name, *given)
    try:
        array = np.asarray(found, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(
            f"{name}: expected {wanted} numbers, got {type(found).__name__}", source=vehicle.source
        ) from None
    if array.shape != (wanted,):
        what = "outputs" if name == "measure" else "states"
        raise InputError(
            f"{name}: expected shape ({wanted},), one number for each of the {what}; got {array.shape}",
            source=vehicle.source, line=_line(vehicle, name),
        )  # fmt: skip
    return array


def _line(vehicle: LoadedVehicle, name: str) -> int | None:
    """Where a function of the model begins in its file."""
    code = getattr(getattr(vehicle.model, name), "__code__", None)
    return None if code is None else int(code.co_firstlineno)


def _twice(vehicle: LoadedVehicle, name: str, given: tuple[Any, ...], wanted: int) -> np.ndarray:
    """A function's answer, the same twice, with its arguments left alone."""
    copies = tuple(np.array(one) if isinstance(one, np.ndarray) else one for one in given)
    first = _call(vehicle, name, copies, wanted).copy()
    for label, before, after in zip("xuwt" if name != "measure" else "xut", given, copies, strict=False):
        if isinstance(before, np.ndarray) and not np.array_equal(before, after):
            which = {"x": "x", "u": "u", "w": "w", "t": "theta"}[label]
            raise InputError(f"{name}: changes its argument {which}", source=vehicle.source, line=_line(vehicle, name))
    again = _call(vehicle, name, given, wanted)
    if not np.array_equal(first, again, equal_nan=True):
        raise InputError(
            f"{name}: not the same twice for the same arguments (randomness, time or memory in it)",
            source=vehicle.source, line=_line(vehicle, name),
        )  # fmt: skip
    return first


def _pure(vehicle: LoadedVehicle, motion: str, points: list[Trial]) -> None:
    """InputError where an answer depends on what was asked before: a hidden state."""
    for name in (motion, "measure"):
        wanted = len(vehicle.declared.states if name == motion else vehicle.declared.outputs)
        first = _call(vehicle, name, arguments(name, points[0]), wanted).copy()
        for point in points[1:]:
            _call(vehicle, name, arguments(name, point), wanted)
        if not np.array_equal(first, _call(vehicle, name, arguments(name, points[0]), wanted), equal_nan=True):
            raise InputError(
                f"{name}: its answer depends on earlier calls: a hidden state; declare it under states",
                source=vehicle.source, line=_line(vehicle, name),
            )  # fmt: skip


def _first_bad(vehicle: LoadedVehicle, name: str, point: Trial) -> str:
    found = np.asarray(called(vehicle, name, *arguments(name, point)), dtype=np.float64)
    names = [one.name for one in (vehicle.declared.outputs if name == "measure" else vehicle.declared.states)]
    return names[int(np.flatnonzero(~np.isfinite(found))[0])]


def _dead(vehicle: LoadedVehicle, motion: str) -> list[str]:
    """Parameters, inputs and noises that change neither motion nor outputs at any of many states and inputs."""
    declared, alive = vehicle.declared, set[tuple[str, str]]()
    every = [(where, k, one.name) for where, what in (("theta", "parameters"), ("u", "inputs"), ("w", "noises"))
             for k, one in enumerate(getattr(declared, what))]  # fmt: skip

    def said(point: Trial) -> list[np.ndarray]:
        try:
            with np.errstate(all="ignore"):
                return [np.asarray(called(vehicle, name, *arguments(name, point))) for name in (motion, "measure")]
        except InputError:  # beyond what the model is for
            return []

    points = [replace(one, u=10.0 * times * one.u) for times in DEAD_SCALES
              for one in trials(vehicle, DEAD_STATES, min(times, 10.0))]  # fmt: skip
    for point in points:
        left = [one for one in every if (one[0], one[-1]) not in alive]
        before = said(point) if left else []
        for where, k, name in left if before else ():
            numbers = getattr(point, where).copy()
            usual = declared.parameters[k].uncertainty if where == "theta" else 0.0
            numbers[k] += usual or 0.1 * abs(numbers[k]) or 0.1
            moved = said(replace(point, **{where: numbers}))
            if not moved or any(not np.array_equal(a, b, equal_nan=True) for a, b in zip(moved, before, strict=True)):
                alive.add((where, name))
    return [f"{name} changes nothing at {len(points)} states and inputs tried: is it used?"
            for where, _, name in every if (where, name) not in alive]  # fmt: skip


def _not_smooth(vehicle: LoadedVehicle, motion: str, point: Trial) -> list[str]:
    """Parameters in which the motion is not smooth: two difference steps disagree."""
    notes = []
    wanted = len(vehicle.declared.states)
    base = _call(vehicle, motion, arguments(motion, point), wanted).copy()
    for k, one in enumerate(vehicle.declared.parameters):
        if one.uncertainty <= 0.0:
            continue
        slopes = []
        for share in SMOOTH_STEPS:
            theta = point.theta.copy()
            theta[k] += share * one.uncertainty
            moved = _call(vehicle, motion, arguments(motion, Trial(point.x, point.u, point.w, theta)), wanted)
            slopes.append((moved - base) / share)
        size = max(float(np.abs(slopes[0]).max()), float(np.abs(slopes[1]).max()))
        if np.isfinite(size) and size > 1e-6 and np.abs(slopes[0] - slopes[1]).max() > SMOOTH * size:
            notes.append(f"{motion} is not smooth in {one.name}: its derivative depends on the step")
    return notes


def _energy_grows(vehicle: LoadedVehicle, motion: str) -> list[str]:
    """Whether the energy that a model declares, energy(x, theta), grows though nothing drives it and no noise acts: a
    note with the state in which it grows most, by what flows through each state."""
    if not hasattr(vehicle.model, "energy"):
        return []
    names, worst = [one.name for one in vehicle.declared.states], (0.0, "", 0.0)
    for point in (one for times in ENERGY_SCALES for one in trials(vehicle, ENERGY_STATES, times)):
        u, dt = np.zeros_like(point.u), ENERGY_SECONDS
        given = (point.x, u, point.w, point.theta, dt) if motion == "step" else (point.x, u, point.w, point.theta)
        moved = _call(vehicle, motion, given, len(names))
        change = moved - point.x if motion == "step" else dt * moved
        powers = np.zeros(len(names))
        for k in range(len(names)):
            ends = [point.x + side * np.where(np.arange(len(names)) == k, change, 0.0) for side in (1.0, -1.0)]
            high, low = (float(called(vehicle, "energy", x, point.theta)) for x in ends)
            powers[k] = (high - low) / (2.0 * dt)
        total, flowing = float(powers.sum()), float(np.abs(powers).sum())
        if np.isfinite(total) and total > GROWS * flowing and total > worst[0]:
            worst = total, names[int(np.argmax(powers))], flowing
    if not worst[1]:
        return []
    power, name, flowing = worst
    return [f"energy grows by {power:.2g} W (of {flowing:.2g} W that flow) with all inputs at 0, most by {name}: "
            "a sign in a coupling or a damping term?"]  # fmt: skip
