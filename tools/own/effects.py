"""What may be wrong with any declared vehicle: the standard effects of its inputs, outputs, parameters and noises.

Each is one number, 0 where nothing is wrong, counted in spreads: steps of differences, no prior (how much an effect
does to the recorded windows is what its prior is about, posterior.py).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from glider.tools.own.declare import ALL_INPUTS, COMMON_KINDS, DERIVED, GROUP_KINDS, RUN, Declaration, Input
from glider.tools.own.runs import OwnRun

INPUT, OUTPUT, PARAMETER = "input", "output", "parameter"
PUSH = "push"  # a constant beside a noise: what no label explains
GROWTH = "growth"  # beside a noise, too: what grows from a run's first row on (a leak, a battery)
UNEXPLAINED = frozenset({PUSH, GROWTH})
NOISE = "noise"  # more of a noise than healthy runs have, or an oscillation: excess_noise.py
# what the form of the model lacks, no label: a force at a noise that goes with an input, or with a run's mean inputs
# (operating_points.py)
FORM = "form"
GAIN_SPREAD, SECONDS_SPREAD, RANGE_SPREAD = 0.1, 0.2, 0.1
OWN_STEP = 1e-3  # of its sigma: difference step of a parameter of each run
SHARE = "share"  # kind of a group of parameters: all more by the same share of their values
LONGEST = 20.0  # spreads: of delays and time constants
UNKNOWN_SHARE = 0.1  # of a value: spread of a parameter whose uncertainty is smaller
READ_ROWS = ("gain", "bias", "drift", "lag", "delay")  # rows of `read`'s table


@dataclass(frozen=True)
class Effect:
    """One number that may be wrong: its label, what it is of, and how far it can go."""

    label: str
    family: str
    name: str  # of the input, output, parameter or noise
    kind: str  # gain, offset, lag ...; value for a parameter
    unit: str
    spread: float
    low: float = -np.inf  # spreads
    high: float = np.inf
    odds: float = 1.0  # prior odds by the vehicle file, against what is usual of its family; 0: it is no cause

    @property
    def one_sided(self) -> bool:
        return self.low == 0.0

    @property
    def at_point(self) -> int | None:
        """The operating point that a form error goes with; None for other effects."""
        return int(self.kind) if self.family == FORM and self.kind.isdigit() else None

    @property
    def form_kind(self) -> tuple[str, bool] | None:
        """What form errors of one size have in common: noise, and whether they go with inputs or operating points."""
        return (self.name, self.at_point is None) if self.family == FORM else None

    @property
    def where(self) -> tuple[str, str]:
        return self.family, self.name


@dataclass
class ModelPoint:
    """Numbers of the observer at one point: what a model is flown with."""

    theta: np.ndarray
    reading: np.ndarray  # (5, outputs): gain, bias, drift, lag, delay
    push: np.ndarray  # (noises,)
    growth: np.ndarray  # (noises,) a second, from the first row on
    form: np.ndarray  # (noises, inputs) a unit of the input, less its usual value
    operating: np.ndarray  # (noises, operating points) times `point_weights`
    density: np.ndarray  # (noises,)
    variance: np.ndarray  # (outputs,) of the sensors
    ports: np.ndarray  # (processes, 4)
    own: np.ndarray  # (3, parameters that the filter estimates along a run): place, 1 sigma, difference step
    driven: dict[int, dict[str, float]] = field(default_factory=dict)  # input: kind: value

    def copy(self) -> "ModelPoint":
        return ModelPoint(
            self.theta.copy(), self.reading.copy(), self.push.copy(), self.growth.copy(), self.form.copy(),
            self.operating.copy(), self.density.copy(), self.variance.copy(), self.ports.copy(), self.own.copy(),
            {key: dict(value) for key, value in self.driven.items()},
        )  # fmt: skip


def nominal_point(declared: Declaration) -> ModelPoint:
    """The vehicle file's numbers, and nothing wrong."""
    reading = np.zeros((5, len(declared.outputs)))
    reading[0], reading[1] = 1.0, [one.offset for one in declared.outputs]
    form = np.zeros((len(declared.noises), len(declared.inputs)))
    operating = np.zeros((len(declared.noises), len(declared.operating_points)))
    for (noise, name), value in declared.form.items():
        if name.isdigit():
            operating[declared.index("noises", noise), int(name)] = value
        else:
            form[declared.index("noises", noise), declared.index("inputs", name)] = value
    driven: dict[int, dict[str, float]] = {}
    for label, value in declared.effects.items():
        family, name, kind = labels_of(declared)[label]
        if family == OUTPUT:
            reading[READ_ROWS.index(kind), declared.members("outputs", name)] += value
        else:
            _drive(declared, driven, name, kind, value)
    return ModelPoint(
        np.array([one.value for one in declared.parameters]),
        reading,
        np.zeros(len(declared.noises)),
        np.zeros(len(declared.noises)),
        form,
        operating,
        np.array([one.density for one in declared.noises]),
        np.array([(one.noise or 0.0) ** 2 for one in declared.outputs]),
        np.zeros((0, 4)),
        np.zeros((3, 0)),
        driven,
    )


def with_run_numbers(declared: Declaration, point: ModelPoint) -> ModelPoint:
    """A point with whose numbers a single run is flown: those of each run are estimated along it, by the filter. Where
    several runs are fitted together they are values of the fit instead."""
    own = [(n, one.uncertainty, OWN_STEP * one.uncertainty) for n, one in enumerate(declared.parameters)
           if one.scope == RUN and one.uncertainty > 0.0]  # fmt: skip
    return replace(point, own=np.array(own).reshape(-1, 3).T.copy())


def labels_of(declared: Declaration) -> dict[str, tuple[str, str, str]]:
    """Family, name and kind of every label of inputs and outputs; of all inputs the name is ALL_INPUTS, of a group its
    own."""
    lists = (INPUT, declared.inputs, DERIVED["inputs"]), (OUTPUT, declared.outputs, DERIVED["outputs"])
    common = {f"{ALL_INPUTS}_{kind}": (INPUT, ALL_INPUTS, kind) for kind in COMMON_KINDS}
    common |= {f"{name}_{kind}": (family, name, kind) for family, what in ((INPUT, "inputs"), (OUTPUT, "outputs"))
               for name in declared.groups_of(what) for kind in GROUP_KINDS}  # fmt: skip
    return common | {f"{one.name}_{kind}": (family, one.name, kind)
                    for family, every, kinds in lists for one in every for kind in kinds}  # fmt: skip


def all_labels(declared: Declaration) -> set[str]:
    """Every label that a cause of the vehicle may have."""
    parameters = [one.name for one in declared.parameters] + declared.groups_of("parameters")
    return {*labels_of(declared), *parameters, *(one.label for one in noise_effects(declared))}


def _drive(declared: Declaration, driven: dict[int, dict[str, float]], name: str, kind: str, size: float) -> None:
    """More of what is wrong of an input, of a group or of all, in place."""
    for place in declared.members("inputs", name):
        own = driven.setdefault(place, {})
        own[kind] = own.get(kind, 0.0) + size


def effects_of(declared: Declaration, point: ModelPoint) -> dict[str, float]:
    """Labels of inputs and outputs that a model has, in their units: what `nominal_point` would make it of.

    What a group or all inputs have is each one's.
    """
    none = nominal_point(replace(declared, effects={}))
    read = {f"{one.name}_{kind}": point.reading[row, n] - none.reading[row, n]
            for n, one in enumerate(declared.outputs) for row, kind in enumerate(READ_ROWS)}  # fmt: skip
    driven = {f"{declared.inputs[n].name}_{kind}": value
              for n, wrong in point.driven.items() for kind, value in wrong.items()}  # fmt: skip
    return {label: float(size) for label, size in (read | driven).items() if size != 0.0}


def moved(declared: Declaration, point: ModelPoint, effects: Sequence[Effect], values: np.ndarray) -> ModelPoint:
    """A point with effects of sizes `values` (effects,) in spreads."""
    found = point.copy()
    for effect, value in zip(effects, values, strict=True):
        if value == 0.0:
            continue
        size = float(value) * effect.spread
        if effect.family == PARAMETER:
            for k in declared.members("parameters", effect.name):
                one = declared.parameters[k]
                more = size * one.value if effect.kind == SHARE else size
                found.theta[k] = min(max(found.theta[k] + more, one.low), one.high)
        elif effect.family == OUTPUT:
            found.reading[READ_ROWS.index(effect.kind), declared.members("outputs", effect.name)] += size
        elif effect.family == INPUT:
            _drive(declared, found.driven, effect.name, effect.kind, size)
        elif effect.family == PUSH:
            found.push[declared.index("noises", effect.name)] += size
        elif effect.family == GROWTH:
            found.growth[declared.index("noises", effect.name)] += size
        elif effect.at_point is not None:
            found.operating[declared.index("noises", effect.name), effect.at_point] += size
        elif effect.family == FORM:
            found.form[declared.index("noises", effect.name), declared.index("inputs", effect.kind)] += size
    return found


def standard_effects(declared: Declaration, runs: Sequence[OwnRun], tolerances: np.ndarray) -> list[Effect]:
    """Every label of a declared vehicle, its spreads by how the runs move (an input that never moves has no lag).

    What the vehicle itself has of one is where it begins.
    """
    found: list[Effect] = []
    every = np.concatenate([run.inputs for run in runs]) if declared.inputs else np.zeros((1, 0))
    moving = [any(np.ptp(run.inputs[:, n]) > 0.0 for run in runs) for n in range(len(declared.inputs))]
    for n, one in enumerate(declared.inputs):
        found += _of_input(one, every[:, n], moving[n])
    duration = max(float(run.t[-1] - run.t[0]) for run in runs)
    for output, tolerance in zip(declared.outputs, tolerances, strict=True):

        def row(kind: str, unit: str, spread: float, low: float = -np.inf, output=output) -> Effect:
            return Effect(f"{output.name}_{kind}", OUTPUT, output.name, kind, unit, spread, low,
                          LONGEST if low == 0.0 else np.inf)  # fmt: skip

        found += [
            row("bias", output.unit, float(tolerance)), row("gain", "1", GAIN_SPREAD),
            row("drift", f"{output.unit}/s", float(tolerance) / duration), row("lag", "s", SECONDS_SPREAD, 0.0),
            row("delay", "s", SECONDS_SPREAD, 0.0),
        ]  # fmt: skip
    if sum(moving) > 1:  # outputs that all are late look as inputs do; a clock may be early, too
        found += [Effect(f"{ALL_INPUTS}_{kind}", INPUT, ALL_INPUTS, kind, "s", SECONDS_SPREAD,
                         -LONGEST if kind == "delay" else 0.0, LONGEST) for kind in COMMON_KINDS]  # fmt: skip
    found += _of_groups(declared, moving)
    has = effects_of(declared, nominal_point(declared))
    for n, effect in enumerate(found):
        what = "inputs" if effect.family == INPUT else "outputs"
        of = [getattr(declared, what)[place].name for place in declared.members(what, effect.name)]
        begins = min(has.get(f"{name}_{effect.kind}", 0.0) for name in of) / effect.spread
        found[n] = replace(effect, low=effect.low - begins, high=effect.high - begins)
    for parameter in declared.parameters:
        spread = parameter.uncertainty or UNKNOWN_SHARE * abs(parameter.value) or 1.0
        low, high = ((limit - parameter.value) / spread for limit in (parameter.low, parameter.high))
        found.append(
            Effect(parameter.name, PARAMETER, parameter.name, "value", parameter.unit, spread, min(low, 0.0), high)
        )
    found += [Effect(name, PARAMETER, name, SHARE, "1", GAIN_SPREAD) for name in declared.groups_of("parameters")]
    return [replace(one, odds=declared.odds.get(one.label, 1.0)) for one in found]


def _of_groups(declared: Declaration, moving: Sequence[bool]) -> list[Effect]:
    """Labels of groups of outputs and inputs; moving (inputs,): inputs that never move have no lag."""
    found = []
    for family, what in ((INPUT, "inputs"), (OUTPUT, "outputs")):
        for name in declared.groups_of(what):
            found.append(Effect(f"{name}_gain", family, name, "gain", "1", GAIN_SPREAD))
            if family == OUTPUT or any(moving[place] for place in declared.members(what, name)):
                found += [Effect(f"{name}_{kind}", family, name, kind, "s", SECONDS_SPREAD, 0.0, LONGEST)
                          for kind in ("lag", "delay")]  # fmt: skip
    return found


def pushes(declared: Declaration) -> list[Effect]:
    """A constant beside every noise: an effect that no label has."""
    return [
        Effect(f"{one.name}_push", PUSH, one.name, "push", one.unit, max(one.density, 1e-6)) for one in declared.noises
    ]


def unexplained(declared: Declaration, runs: Sequence[OwnRun]) -> list[Effect]:
    """Forces beside every noise that no label has: a constant one, and one that grows in a run."""
    duration = max(float(run.t[-1] - run.t[0]) for run in runs)
    return pushes(declared) + [
        Effect(f"{one.name}_growth", GROWTH, one.name, "growth", f"{one.unit}/s", max(one.density, 1e-6) / duration)
        for one in declared.noises
    ]


def noise_effects(declared: Declaration) -> list[Effect]:
    """Excess noise and an oscillation at every noise: its density, and its amplitude; two of each noise, in order."""
    return [
        Effect(label, NOISE, one.name, kind, one.unit, max(one.density, 1e-6), 0.0, odds=declared.odds.get(label, 1.0))
        for one in declared.noises
        for kind in DERIVED["noises"]
        for label in [f"{one.name}_{kind}"]
    ]


def form_errors(declared: Declaration) -> list[Effect]:
    """A force at every noise that goes with an input, of inputs whose usual values are known, and one that goes with
    each operating point; spread: a density."""
    linear = [
        Effect(f"{one.name}_by_{name}", FORM, one.name, name, f"{one.unit}/{declared.inputs[k].unit}",
               max(one.density, 1e-6) / sd)
        for one in declared.noises
        for k, name in enumerate(each.name for each in declared.inputs)
        for _, sd in [declared.usual_inputs.get(name, (0.0, 0.0))] if sd > 0.0
    ]  # fmt: skip
    return linear + [
        Effect(f"{one.name}_at_{m}", FORM, one.name, str(m), one.unit, max(one.density, 1e-6))
        for one in declared.noises for m in range(len(declared.operating_points))
    ]  # fmt: skip


def usual_inputs(declared: Declaration, runs: Sequence[OwnRun]) -> dict[str, tuple[float, float]]:
    """Mean and standard deviation of every input that is not the same all along, runs counted alike."""
    means = np.array([run.inputs.mean(axis=0) for run in runs])
    squares = np.array([(run.inputs**2).mean(axis=0) for run in runs]).mean(axis=0)
    sd = np.sqrt(np.maximum(squares - means.mean(axis=0) ** 2, 0.0))
    return {
        one.name: (float(mean), float(size))
        for one, mean, size in zip(declared.inputs, means.mean(axis=0), sd, strict=True)
        if size > 1e-6 * max(abs(mean), 1e-9)
    }


def _of_input(one: Input, values: np.ndarray, moves: bool) -> list[Effect]:
    reach = float(np.abs(values).max()) or 1.0
    travel = float(np.ptp(values)) or reach
    rows = [Effect(f"{one.name}_gain", INPUT, one.name, "gain", "1", GAIN_SPREAD),
            Effect(f"{one.name}_offset", INPUT, one.name, "offset", one.unit, RANGE_SPREAD * travel)]  # fmt: skip
    if moves:
        seconds = [("lag", "s", SECONDS_SPREAD), ("delay", "s", SECONDS_SPREAD)]
        ranges = [("backlash", one.unit, RANGE_SPREAD * travel), ("limit", one.unit, RANGE_SPREAD * travel)]
        rows += [
            Effect(f"{one.name}_{kind}", INPUT, one.name, kind, unit, spread, 0.0, LONGEST)
            for kind, unit, spread in (*seconds, *ranges)
        ]
        # of how long a full stroke takes: 0 is at once
        rows.append(Effect(f"{one.name}_rate_limit", INPUT, one.name, "rate_limit", "s", 1.0, 0.0, LONGEST))
    return rows
