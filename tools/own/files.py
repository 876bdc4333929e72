"""The vehicle file of a user's model: what is known of its numbers, read strictly (docs: a vehicle of one's own)."""

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_type_hints

import msgspec
import numpy as np

from glider.hal.strict import ConfigError, Table, decode, locate
from glider.tools.own.declare import QUATERNION, Declaration, DeclarationError, Parameter, with_groups
from glider.tools.own.effects import all_labels, form_errors, labels_of

NonNegative = Annotated[float, msgspec.Meta(ge=0.0)]
Positive = Annotated[float, msgspec.Meta(gt=0.0)]


class ParameterTable(Table):
    """[parameters.NAME]"""

    value: float | None = None
    uncertainty: NonNegative | None = None
    low: float | None = None
    high: float | None = None
    scope: Literal["vehicle", "run"] | None = None
    assumed: bool | None = None
    scatter: NonNegative | None = None
    source: str = ""


class SensorTable(Table):
    """[sensors.OUTPUT]"""

    noise: Positive | None = None
    bias: NonNegative | None = None
    offset: float | None = None  # what it reads too much, identified
    tolerance: Positive | None = None
    column: str | None = None


class InputTable(Table):
    """[inputs.NAME]"""

    column: str | None = None
    interpolated: bool | None = None


class NoiseTable(Table):
    """[noise.NAME]"""

    density: NonNegative


class StartTable(Table):
    """[start] NAME"""

    uncertainty: Positive
    value: float = 0.0


class WindowsTable(Table):
    """[windows]"""

    seconds: Positive


class IdentifiedTable(Table):
    """[identified], written by `glider identify`."""

    runs: Annotated[int, msgspec.Meta(ge=1)]
    parameters: list[str]
    covariance: list[list[float]]  # of `parameters`, in their units
    sessions: Annotated[int, msgspec.Meta(ge=1)] = 1
    inflation: Annotated[float, msgspec.Meta(ge=1.0)] = 1.0  # of all channels together
    run_inflation: Annotated[float, msgspec.Meta(ge=1.0)] = 1.0  # of what runs say of the values they share
    channel_inflation: dict[str, Annotated[float, msgspec.Meta(ge=1.0)]] = msgspec.field(default_factory=dict)
    scatter: dict[str, NonNegative] = msgspec.field(default_factory=dict)  # what runs differ by, 1 sigma in its unit
    scatter_correlation: list[list[float]] = msgspec.field(default_factory=list)  # of the numbers of `scatter`
    session_correlation: list[list[float]] = msgspec.field(default_factory=list)
    label_mean: dict[str, float] = msgspec.field(default_factory=dict)  # what all runs show of each label alone
    label_mean_error: dict[str, NonNegative] = msgspec.field(default_factory=dict)  # 1 sigma of that
    label_scatter: dict[str, NonNegative] = msgspec.field(default_factory=dict)  # of each label alone, beside that
    label_session_scatter: dict[str, NonNegative] = msgspec.field(default_factory=dict)  # between sessions, beside that
    # NOISE_by_INPUT: force a unit of the input; NOISE_at_POINT: force (operating_points.py)
    form: dict[str, float] = msgspec.field(default_factory=dict)
    input_shares: dict[str, NonNegative] = msgspec.field(default_factory=dict)  # of the distance between points
    operating_points: list[list[float]] = msgspec.field(default_factory=list)  # usual deviations from the usual inputs
    operating_scatter: dict[str, NonNegative] = msgspec.field(default_factory=dict)  # 1 sigma of that force, by noise
    usual_inputs: dict[str, tuple[float, NonNegative]] = msgspec.field(default_factory=dict)  # mean, 1 sigma
    noise_gain: dict[str, NonNegative] = msgspec.field(default_factory=dict)  # nat a window, of healthy runs, by label
    session_scatter: dict[str, NonNegative] = msgspec.field(default_factory=dict)  # what sessions differ by beside it
    session_share: NonNegative = 0.25  # of files without that: variance between sessions over that from run to run
    level_scatter: NonNegative = 0.5  # 1 sigma from run to run of the logarithm of the mean square left
    gap: dict[str, float] = msgspec.field(default_factory=dict)  # of healthy runs left out, by channel, tolerances
    row_noise: dict[str, Positive] = msgspec.field(default_factory=dict)  # 1 sigma of a row's own errors, tolerances
    force_variance: dict[str, NonNegative] = msgspec.field(default_factory=dict)  # in windows, over [noise]'s
    held_force_variance: dict[str, NonNegative] = msgspec.field(default_factory=dict)  # over a window's mean of these
    start_variance: NonNegative = 1.0  # of windows' starts, over the filter's
    data: str = ""
    software: str = ""


class OwnVehicle(Table):
    """A vehicle file with `model`."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    model: Annotated[str, msgspec.Meta(min_length=1, max_length=1000)]
    model_folder: str = ""  # where that is looked for, from this file's folder
    name: str = ""
    parameters: dict[str, ParameterTable] = msgspec.field(default_factory=dict)
    sensors: dict[str, SensorTable] = msgspec.field(default_factory=dict)
    inputs: dict[str, InputTable] = msgspec.field(default_factory=dict)
    noise: dict[str, NoiseTable] = msgspec.field(default_factory=dict)
    start: dict[str, StartTable] = msgspec.field(default_factory=dict)
    effects: dict[str, float] = msgspec.field(default_factory=dict)  # labels of inputs and outputs, SI
    # outputs of one device, inputs of one supply, parameters that change by the same share
    groups: dict[str, Annotated[list[str], msgspec.Meta(min_length=2)]] = msgspec.field(default_factory=dict)
    odds: dict[str, NonNegative] = msgspec.field(default_factory=dict)  # of labels as causes; 1: usual, 0: never
    windows: WindowsTable | None = None
    identified: IdentifiedTable | None = None


def is_own(text: str) -> bool:
    """Whether a vehicle file names a model of the user's."""
    try:
        return "model" in tomllib.loads(text)
    except (ValueError, RecursionError):
        return False


def decode_own(text: str, source: str) -> OwnVehicle:
    """A vehicle file; ConfigError with line and key."""
    try:
        return decode(text, OwnVehicle, source)
    except ConfigError:
        _check_rows(text, source)
        raise


def _check_rows(text: str, source: str) -> None:
    """ConfigError of the row of a table of names that is wrong, with its name."""
    rows = {
        "parameters": ParameterTable,
        "sensors": SensorTable,
        "inputs": InputTable,
        "noise": NoiseTable,
        "start": StartTable,
    }
    given = tomllib.loads(text)
    for table, kind in rows.items():
        for name, row in given.get(table, {}).items() if isinstance(given.get(table), dict) else ():
            try:
                msgspec.convert(row, kind)
            except msgspec.ValidationError as error:
                said, _, place = str(error).partition(" - at `$")
                key = f"{table}.{name}{place.rstrip('`')}"
                choices = _choices(kind, key.rpartition(".")[2])
                said += f" (it is {' or '.join(choices)})" if choices else ""
                line = locate(text, [*key.split(".")])
                raise ConfigError(source, said[:1].lower() + said[1:], key=key, line=line) from None


def _choices(kind: Any, name: str) -> list[str]:
    """Texts that a key of a table may have; none: any."""
    of = get_args(get_type_hints(kind).get(name))
    return [word for part in of for word in get_args(part) if isinstance(word, str)]


def declared_with(declared: Declaration, given: OwnVehicle, text: str, source: Path) -> Declaration:
    """A model's declaration with the file's numbers in place of its own; ConfigError for a name it does not have."""
    lists: dict[str, Any] = {}
    for table, what in (
        ("parameters", "parameters"),
        ("sensors", "outputs"),
        ("inputs", "inputs"),
        ("noise", "noises"),
    ):
        entries = {one.name: one for one in getattr(declared, what)}
        for name, row in getattr(given, table).items():
            if name not in entries:
                known = ", ".join(entries) or "none"
                line = locate(text, [table, name])
                message = f"the model declares no such name (it has {known})"
                raise ConfigError(str(source), message, key=f"{table}.{name}", line=line)
            values = {
                key: value
                for key, value in msgspec.structs.asdict(row).items()
                if value is not None and key != "source"
            }
            entries[name] = replace(entries[name], **values)
        lists[what] = tuple(entries.values())
    for one in lists["parameters"]:
        _check(one, text, source)
    states = {one.name: one for one in declared.states}
    outputs = {one.name for one in lists["outputs"]}
    start: dict[str, tuple[float, float]] = {}
    of_states: dict[str, tuple[float, float]] = {}
    for name, row in given.start.items():
        if name in outputs:
            start[name] = (row.value, row.uncertainty)
        elif name in states:
            states[name] = replace(states[name], start=row.value, start_uncertainty=row.uncertainty)
            if states[name].kind != QUATERNION:
                of_states[name] = (row.value, row.uncertainty)
        else:
            raise ConfigError(str(source), "no output or state of the model", key=f"start.{name}",
                              line=locate(text, ["start", name]))  # fmt: skip
    horizon = declared.horizon if given.windows is None else given.windows.seconds
    found = replace(
        declared, **lists, states=tuple(states.values()), horizon=horizon, start=start, start_states=of_states,
        effects=given.effects,
    )  # fmt: skip
    try:
        found = with_groups(found, given.groups)
    except DeclarationError as error:
        key, _, said = str(error).partition(": ")
        raise ConfigError(str(source), said, key=key, line=locate(text, [*key.split(".")])) from None
    found = replace(found, odds=given.odds)
    for table, names, labels, of in (("effects", given.effects, set(labels_of(found)), " of inputs and outputs"),
                                     ("odds", given.odds, all_labels(found), "")):  # fmt: skip
        for name in names:
            if name not in labels:
                raise ConfigError(str(source), f"the model has no such label{of}", key=f"{table}.{name}",
                                  line=locate(text, [table, name]))  # fmt: skip
    if given.identified is not None:
        found = _with_form(given.identified, found, str(source))
        _check_identified(given.identified, found, str(source))
    return found


def _with_form(table: IdentifiedTable, declared: Declaration, source: str) -> Declaration:
    """The declaration with identified forces that go with inputs; ConfigError for a name that it does not have."""
    inputs = {one.name for one in declared.inputs}
    for name in table.usual_inputs:
        if name not in inputs:
            raise ConfigError(source, f"the model declares no input {name}", key="identified.usual_inputs")
    count = sum(sd > 0.0 for _, sd in table.usual_inputs.values())
    if any(len(point) != count for point in table.operating_points):
        raise ConfigError(source, f"expected points of {count} numbers", key="identified.operating_points")
    points = tuple(tuple(point) for point in table.operating_points)
    found = replace(declared, usual_inputs=table.usual_inputs, input_shares=table.input_shares, operating_points=points)
    pairs = {one.label: (one.name, one.kind) for one in form_errors(found)}
    for name in table.form:
        if name not in pairs:
            raise ConfigError(source, f"no noise and input of the model: {name}", key="identified.form")
    return replace(found, form={pairs[name]: value for name, value in table.form.items()})


def _check(one: Parameter, text: str, source: Path) -> None:
    if not one.low <= one.value <= one.high:
        raise ConfigError(
            str(source), f"{one.value:g} is outside {one.low:g} to {one.high:g}", key=f"parameters.{one.name}.value",
            line=locate(text, ["parameters", one.name, "value"]),
        )  # fmt: skip


def _check_identified(table: IdentifiedTable, declared: Declaration, source: str) -> None:
    names = {one.name for one in declared.parameters} | {one.label for one in form_errors(declared)}
    names |= set(declared.effects)
    for name in table.parameters:
        if name not in names:
            raise ConfigError(source, f"the model declares no parameter {name}", key="identified.parameters")
    matrix = np.array(table.covariance) if table.covariance else np.zeros((0, 0))
    count = len(table.parameters)
    if matrix.shape != (count, count) and count:
        raise ConfigError(source, f"expected {count} rows of {count}", key="identified.covariance")
    count = len(table.scatter)
    for key, rows in (("scatter", table.scatter_correlation), ("session", table.session_correlation)):
        if rows and (len(rows) != count or any(len(row) != count for row in rows)):
            raise ConfigError(source, f"expected {count} rows of {count}", key=f"identified.{key}_correlation")
