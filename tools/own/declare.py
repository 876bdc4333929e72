"""What a user's model declares: inputs, outputs, parameters, states and noises, by name and unit.

A model is any object (a class with static methods, an instance, a module) with these attributes and functions::

    inputs, outputs, parameters, states, noises
    step(x, u, w, theta, dt) -> x          or  derivative(x, u, w, theta) -> dx/dt
    measure(x, u, theta) -> y
    initial(y) -> x, (x, sd) or a list of these          optional

A declaration is a mapping name -> unit, or a list of (name, unit) or of the classes below. Vectors have the order of
the declaration: x (states,), u (inputs,), w (noises,), theta (parameters,), y (outputs,), all float64. A black box
declares the same without states and noises, and has `rollout(x0, t, u, theta) -> y` (rows, outputs) instead.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from math import inf
from typing import Any, TypeVar

VECTOR, ANGLE, QUATERNION = "vector", "angle", "quaternion"
VEHICLE, RUN = "vehicle", "run"
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*\Z")
NOT_SI = {
    "deg": "rad", "degree": "rad", "degrees": "rad", "deg/s": "rad/s", "rpm": "rad/s", "cm": "m", "mm": "m", "km": "m",
    "ft": "m", "cm/s": "m/s", "mm/s": "m/s", "kn": "m/s", "g": "kg", "ms": "s", "min": "s", "h": "s", "bar": "Pa",
    "dbar": "Pa", "mbar": "Pa", "hPa": "Pa", "kPa": "Pa", "gf": "N", "kgf": "N", "mV": "V", "mA": "A", "L": "m3",
    "l": "m3", "ml": "m3", "mL": "m3", "cm3": "m3", "cc": "m3",
}  # fmt: skip
# kinds of causes derived from inputs and outputs (effects.py), which no parameter may be named like
DERIVED = {
    "inputs": ("gain", "offset", "lag", "delay", "backlash", "limit", "rate_limit"),
    "outputs": ("bias", "gain", "drift", "lag", "delay"),
    "noises": ("noise", "oscillation"),
}
ALL_INPUTS, COMMON_KINDS = "inputs", ("lag", "delay")  # what a chain of commands, or a clock, does to all inputs
# what one cause does to all of a group alike: a device to what it reads, a supply to what it drives
GROUP_KINDS = "gain", "lag", "delay"
# unit: tolerance of an output, standard deviation of a state at the start
USUAL_TOLERANCE = {"m": 0.1, "rad": 0.0349, "rad/s": 0.0349, "m/s": 0.05, "m/s2": 0.1}
USUAL_START = {"m": 0.1, "rad": 0.1, "rad/s": 0.1, "m/s": 0.2}


class DeclarationError(ValueError):
    """A declaration that cannot be used: which list, which entry, what was expected."""


@dataclass(frozen=True)
class Input:
    """What drives the model: a recorded command or position, in force from its row on.

    delay_limit, lag_limit: longest delay and time constant that a cause may have, s.
    """

    name: str
    unit: str = ""
    column: str = ""  # of the run files; empty: name_unit
    interpolated: bool = False  # between rows, as a measured position; else held


@dataclass(frozen=True)
class Output:
    """What the model says a column reads."""

    name: str
    unit: str = ""
    column: str = ""
    noise: float | None = None  # 1 sigma of white noise, in its unit; None: estimated
    bias: float = 0.0  # 1 sigma of a constant that the vehicle file allows for
    offset: float = 0.0  # what it reads too much
    tolerance: float | None = None  # what the model may be off; None: usual of its unit
    angle: bool = False  # compared modulo 2 pi


@dataclass(frozen=True)
class Parameter:
    """A number of the model, with what is known of it."""

    name: str
    unit: str = ""
    value: float = 0.0
    uncertainty: float = 0.0  # 1 sigma; 0: known
    low: float = -inf
    high: float = inf
    scope: str = VEHICLE  # or RUN: a number of each run
    assumed: bool = False
    scatter: float = 0.0  # 1 sigma from run to run, learned by identification


@dataclass(frozen=True)
class State:
    """A component of x; four of kind `quaternion` in a row are an attitude (w, x, y, z)."""

    name: str
    unit: str = ""
    kind: str = VECTOR
    start: float = 0.0
    start_uncertainty: float | None = None  # 1 sigma; None: usual of its unit


@dataclass(frozen=True)
class Noise:
    """A component of w: white, `density` its standard deviation over one second; 0 is no noise."""

    name: str
    unit: str = ""
    density: float = 0.01


Entry = TypeVar("Entry", Input, Output, Parameter, State, Noise)


@dataclass(frozen=True)
class Declaration:
    """A model's lists, checked."""

    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    parameters: tuple[Parameter, ...]
    states: tuple[State, ...] = ()
    noises: tuple[Noise, ...] = ()
    horizon: float | None = None  # s: of the windows that gaps are measured on; None: by the model's time constants
    start: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # outputs known at the start: value, 1 sigma
    start_states: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # states likewise, whatever is read
    # forces at noises that go with inputs, identified: mean and standard deviation of inputs; unit of a noise a unit
    usual_inputs: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    form: Mapping[tuple[str, str], float] = field(default_factory=dict)
    input_shares: Mapping[str, float] = field(default_factory=dict)  # in such points, of inputs under one command
    effects: Mapping[str, float] = field(default_factory=dict)  # labels that the vehicle itself has, in their units
    operating_points: tuple[tuple[float, ...], ...] = ()  # mean inputs of runs, where forces are known of their own
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # names in one list that a cause has in common
    odds: Mapping[str, float] = field(default_factory=dict)  # prior odds of labels against what is usual

    def index(self, what: str, name: str) -> int:
        """Place of a name in a list, `inputs` to `noises`; KeyError where it is not there."""
        return self._places[what][name]

    def members(self, what: str, name: str) -> list[int]:
        """Places in a list of what a name means: one entry, a group's, or all inputs."""
        if name == ALL_INPUTS:
            return list(range(len(self.inputs)))
        return [self.index(what, one) for one in self.groups.get(name, (name,))]

    def groups_of(self, what: str) -> list[str]:
        """Names of the groups of a list's entries."""
        return [name for name, members in self.groups.items() if members[0] in self._places[what]]

    @cached_property
    def _places(self) -> dict[str, dict[str, int]]:
        lists = ("inputs", "outputs", "parameters", "states", "noises")
        return {what: {one.name: n for n, one in enumerate(getattr(self, what))} for what in lists}


def column_of(name: str, unit: str) -> str:
    """`depth`, `m` -> depth_m; rad/s -> rad_s, m/s2 -> m_s2; a name that ends in its unit stays."""
    suffix = re.sub(r"[^a-z0-9]+", "_", unit.lower()).strip("_")
    return name if not suffix or name.endswith(f"_{suffix}") or unit in ("1", "-") else f"{name}_{suffix}"


def _named(name: str, row: Any) -> Any:
    """An entry of a mapping, name -> unit, (unit, ...) or {key: value}, as one of a list."""
    if isinstance(row, Mapping):
        return {"name": name, **row}
    return (name, *row) if isinstance(row, (tuple, list)) else (name, row)


def _entries(given: Any, kind: type[Entry], what: str) -> tuple[Entry, ...]:
    """A list as a user writes it, as entries of one class; DeclarationError where one cannot be read."""
    if isinstance(given, Mapping):
        given = [_named(name, one) for name, one in given.items()]
    if isinstance(given, str) or not isinstance(given, Sequence):
        raise DeclarationError(f"{what}: expected a list or a mapping name -> unit, got {type(given).__name__}")
    found: list[Entry] = []
    known = {column.name for column in fields(kind)}
    for n, one in enumerate(given):
        where = f"{what}[{n}]"
        if isinstance(one, kind):
            made = one
        elif isinstance(one, str):
            made = kind(one)
        elif isinstance(one, Mapping):
            unknown = sorted(set(one) - known)
            if unknown or "name" not in one:
                raise DeclarationError(f"{where}: {'no name' if 'name' not in one else 'unknown key ' + unknown[0]}")
            made = kind(**one)
        elif isinstance(one, (tuple, list)) and 1 <= len(one) <= 4:
            made = kind(*one)
        elif all(hasattr(one, name) for name in ("name", "unit")):
            made = kind(**{name: getattr(one, name) for name in known if hasattr(one, name)})
        else:
            raise DeclarationError(f"{where}: expected (name, unit) or {kind.__name__}, got {one!r}")
        if not isinstance(made.name, str) or not NAME.match(made.name):
            raise DeclarationError(f"{where}: a name is letters, digits and _, got {made.name!r}")
        if not isinstance(made.unit, str):
            raise DeclarationError(f"{where} ({made.name}): the unit is a text, got {made.unit!r}")
        if made.unit in NOT_SI:
            raise DeclarationError(f"{where} ({made.name}): units are SI: {NOT_SI[made.unit]}, not {made.unit}")
        if made.name in (other.name for other in found):
            raise DeclarationError(f"{where}: {made.name} stands twice")
        found.append(made)
    return tuple(found)


def is_black_box(model: Any) -> bool:
    """Whether a model flies whole windows alone: a step or a derivative without measure is a helper of its own."""
    steps = hasattr(model, "step") or hasattr(model, "derivative")
    return hasattr(model, "rollout") and not (steps and hasattr(model, "measure"))


def declaration(model: Any) -> Declaration:
    """The lists of a model object; DeclarationError where one is missing or cannot be read."""
    lists: dict[str, Any] = {}
    black_box = is_black_box(model)
    for what, kind in (("inputs", Input), ("outputs", Output), ("parameters", Parameter), ("states", State),
                       ("noises", Noise)):  # fmt: skip
        given = getattr(model, what, None)
        if callable(given):
            given = given()
        if given is None:
            if what in ("outputs", "parameters") or (what == "states" and not black_box):
                raise DeclarationError(f"{what}: not declared")
            given = ()
        lists[what] = _entries(given, kind, what)
    if not lists["outputs"]:
        raise DeclarationError("outputs: none declared; nothing could be compared")
    lists["inputs"] = tuple(replace(one, column=one.column or column_of(one.name, one.unit)) for one in lists["inputs"])
    lists["outputs"] = tuple(
        replace(one, column=one.column or column_of(one.name, one.unit)) for one in lists["outputs"]
    )
    _check_states(lists["states"])
    for one in lists["parameters"]:
        _check_parameter(one)
    taken: dict[str, str] = {}
    for what in ("inputs", "outputs", "parameters", "noises"):
        for one in lists[what]:
            if one.name in taken:
                raise DeclarationError(f"{what}: {one.name} is declared under {taken[one.name]} too")
            if one.name == ALL_INPUTS:
                raise DeclarationError(f"{what}: {one.name} means all inputs; another name keeps them apart")
            taken[one.name] = what
    derived = _derived(lists)
    for one in lists["parameters"]:
        if one.name in derived:
            what = f"{one.name} is what a cause of {derived[one.name]} is called; another name keeps them apart"
            raise DeclarationError(f"parameters: {what}")
    return Declaration(**lists, horizon=getattr(model, "horizon", None))


def _derived(lists: Mapping[str, Sequence[Any]]) -> dict[str, str]:
    """Label of every cause that is derived from entries of lists, and what it is of."""
    of = {f"{one.name}_{kind}": one.name for what, kinds in DERIVED.items() for one in lists[what] for kind in kinds}
    return of | {f"{ALL_INPUTS}_{kind}": "all inputs" for kind in COMMON_KINDS}


def with_groups(declared: Declaration, groups: Mapping[str, Sequence[str]]) -> Declaration:
    """A declaration with groups of its inputs, outputs or parameters; DeclarationError where one cannot be."""
    lists = {one.name: what for what in ("inputs", "outputs", "parameters") for one in getattr(declared, what)}
    taken = {*lists, *(one.name for one in declared.noises), ALL_INPUTS, *_derived(vars(declared))}
    for name, members in groups.items():
        for one in members:
            if one not in lists:
                raise DeclarationError(f"groups.{name}: no input, output or parameter of the model: {one}")
            if lists[one] != lists[members[0]]:
                raise DeclarationError(f"groups.{name}: {members[0]} is of the {lists[members[0]]}, {one} is not")
            if lists[one] == "parameters" and declared.parameters[declared.index("parameters", one)].value == 0.0:
                raise DeclarationError(f"groups.{name}: {one} is 0: it has no share")
        if len(set(members)) < len(members):
            raise DeclarationError(f"groups.{name}: a name stands twice")
        labels = {name, *(f"{name}_{kind}" for kind in GROUP_KINDS if lists[members[0]] != "parameters")}
        if not NAME.match(name) or labels & taken:
            raise DeclarationError(f"groups.{name}: expected a name of letters, digits and _ that nothing else has")
        taken |= labels
    return replace(declared, groups={name: tuple(members) for name, members in groups.items()})


def _check_parameter(one: Parameter) -> None:
    if one.scope not in (VEHICLE, RUN):
        raise DeclarationError(f'parameters: {one.name}: scope is "vehicle" or "run", got {one.scope!r}')
    if not one.low <= one.value <= one.high:
        raise DeclarationError(f"parameters: {one.name}: {one.value:g} is outside {one.low:g} to {one.high:g}")
    if one.uncertainty < 0.0:
        raise DeclarationError(f"parameters: {one.name}: an uncertainty is not negative, got {one.uncertainty:g}")


def _check_states(states: Sequence[State]) -> None:
    n = 0
    while n < len(states):
        if states[n].kind not in (VECTOR, ANGLE, QUATERNION):
            raise DeclarationError(f"states: {states[n].name}: kind is vector, angle or quaternion")
        if states[n].kind == QUATERNION:
            if [one.kind for one in states[n : n + 4]] != 4 * [QUATERNION]:
                raise DeclarationError(f"states: {states[n].name}: a quaternion is four states in a row (w, x, y, z)")
            n += 3
        n += 1
