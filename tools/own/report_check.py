"""`glider vehicle check`: what a model of one's own declares, and what can be asked of it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.data.errors import InputError
from glider.tools.data.sources import read_text
from glider.tools.own.check import load_own
from glider.tools.own.declare import USUAL_TOLERANCE, Declaration
from glider.tools.own.effects import noise_effects, standard_effects
from glider.tools.own.files import is_own
from glider.tools.own.observers import observer_of
from glider.tools.own.runs import OwnRun, load_own_runs

ASKED = {
    0: "gap measure and predict, identify, diagnose and watch by windows that begin at readings; no filter",
    1: "gap measure and predict, identify, diagnose, watch",
}


def describe(file: Path, case: Path | None, compile_observer: Callable[[], None]) -> dict[str, Any]:
    """What a vehicle file and its model are good for; InputError or ConfigError where they cannot be used.

    compile_observer: called before a model is observed.
    """
    if not file.is_file():
        raise InputError("no such file", source=file)
    if not is_own(read_text(file)):
        raise InputError("the file names no model: `glider check --vehicle` checks a ROUGHIE-like one", source=file)
    vehicle = load_own(file)
    declared = vehicle.declared
    lines = [f"{vehicle.name}: level {vehicle.level}, {ASKED[vehicle.level]}"]
    if vehicle.level:
        compile_observer()
        kernels = vehicle.kernels
        lines.append(kernels.said)
    for what in ("inputs", "outputs", "parameters", "states", "noises"):
        entries = getattr(declared, what)
        if entries:
            lines.append(
                f"{what}: {', '.join(f'{one.name} ({one.unit})' if one.unit else one.name for one in entries)}"
            )
    assumed = [one.name for one in declared.parameters if one.assumed]
    if assumed:
        lines.append(f"assumed, not measured: {', '.join(assumed)}")
    runs = [_imagined(declared)] if case is None else load_own_runs(case, declared)
    tolerances = np.array([one.tolerance or USUAL_TOLERANCE.get(one.unit, 1.0) for one in declared.outputs])
    every = [*standard_effects(declared, runs, tolerances), *noise_effects(declared)]
    labels = [one.label for one in every if one.odds > 0.0]
    lines.append(f"{len(labels)} causes it can have: {', '.join(labels)}")
    if case is not None:
        observer = observer_of(vehicle, runs[:1])
        gaps = observer.gaps(0, observer.point, observer.horizon)
        by = ", ".join(
            f"{one.name} {gap:.2f}" for one, gap in zip(declared.outputs, gaps, strict=True) if np.isfinite(gap)
        )
        lines.append(
            f"{runs[0].name}: gap in tolerances {by}; windows of {observer.horizon:.1f} s, "
            f"{observer.parts} parts a step"
        )
        lines += observer.notes
    if vehicle.level and not declared.noises:
        lines.append("no noises are declared: the filter trusts the model, and what that lacks is seen by no force")
    lines += vehicle.notes + _ungrouped(declared)
    return {
        "name": vehicle.name, "level": vehicle.level, "compiled": bool(vehicle.level and vehicle.kernels.compiled),
        "causes": labels, "notes": vehicle.notes, "lines": lines,
        "declared": {what: [one.name for one in getattr(declared, what)]
                     for what in ("inputs", "outputs", "parameters", "states", "noises")},
    }  # fmt: skip


def _ungrouped(declared: Declaration) -> list[str]:
    """A line, where outputs of one unit stand in no group: one device may read them."""
    grouped = {one for members in declared.groups.values() for one in members}
    by_unit = dict[str, list[str]]()
    for one in declared.outputs:
        if one.name not in grouped:
            by_unit.setdefault(one.unit, []).append(one.name)
    return [f"if one device reads {', '.join(names)}: with [groups] its delay, lag and gain are causes"
            for names in by_unit.values() if len(names) > 1]  # fmt: skip


def _imagined(declared: Declaration) -> OwnRun:
    """A run in which every input moves: so that every label has its place in the list."""
    t = np.linspace(0.0, 60.0, 61)
    inputs = np.tile(np.linspace(0.0, 1.0, 61)[:, None], (1, len(declared.inputs)))
    return OwnRun("imagined", t, inputs, np.zeros((61, len(declared.outputs))))
