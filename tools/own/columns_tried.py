"""Columns in another unit, with a turned sign, or exchanged: which reading of a log the model follows far better.

A run is flown window by window (`Observer.gaps`) with one column read otherwise. Every channel's error counts in units
of the spread of its readings, so that a unit by itself gains nothing.
"""

import copy
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from glider.tools.own.declare import Declaration
from glider.tools.own.load import LoadedVehicle
from glider.tools.own.observer import Observer
from glider.tools.own.observers import thinned
from glider.tools.own.runs import OwnRun
from glider.tools.own.steps import MOST_PARTS

DEGREE = np.pi / 180.0
TIMES: dict[str, tuple[float, ...]] = dict.fromkeys(("rad", "rad/s"), (DEGREE, 1.0 / DEGREE))
OTHER_TIMES = 0.001, 0.01, 100.0, 1000.0  # of all other units
SAID = {DEGREE: "degrees?", 1.0 / DEGREE: "turned into rad twice?", 0.01: "centimetres, or per cent?",
        0.001: "thousandths (mm, g)?", -1.0: "sign?"}  # fmt: skip
TRIED_RUNS = 3
BETTER = 2.0  # nat, product of channels' errors, that every run gains
MOST_ERROR = 1.0  # logarithm, in spreads of what is read: a flight that is farther off is lost
NO_LIMIT = 1e9  # times a tolerance


@dataclass(frozen=True)
class Otherwise:
    """A log read otherwise: columns times a factor, or two columns exchanged."""

    inputs: bool
    columns: tuple[int, ...]
    times: float = 1.0

    @property
    def exchanged(self) -> bool:
        """Whether columns are exchanged."""
        return self.times == 1.0

    def of(self, run: OwnRun) -> OwnRun:
        """The run, read so."""
        table, columns = (run.inputs if self.inputs else run.outputs).copy(), list(self.columns)
        table[:, columns] = table[:, columns[::-1]] if self.exchanged else self.times * table[:, columns]
        return replace(run, inputs=table) if self.inputs else replace(run, outputs=table)

    def named(self, declared: Declaration) -> list[str]:
        """Its columns, as they stand in the log."""
        entries = declared.inputs if self.inputs else declared.outputs
        return [entries[k].column for k in self.columns]

    def said(self, declared: Declaration) -> str:
        """In words."""
        names = self.named(declared)
        if self.exchanged:
            return f"{names[0]} and {names[1]} exchanged?"
        return f"{', '.join(names)} times {self.times:.4g}: {SAID.get(self.times, 'unit?')}"


AS_IT_IS = Otherwise(True, ())


class TriedObserver(Observer):
    """An observer whose steps are as fine as the model needs at rest: readings may be wrong."""

    def _choose_parts(self) -> None:
        x, u, w, theta = self.vehicle.zeros()
        dt = float(np.median(np.diff(self.runs[0].t)))
        advance = self.vehicle.kernels.advance
        while self.parts < MOST_PARTS:
            ends = [np.array(advance(x, u, w, theta, dt, parts)) for parts in (self.parts, 2 * self.parts)]
            if np.isfinite(ends).all() and np.abs(ends[0] - ends[1]).max() < 1e-2 * self.scales.min():
                return
            self.parts *= 2


def otherwise(declared: Declaration) -> Iterator[Otherwise]:
    """Every reading that is tried."""
    units = [one.unit for one in declared.outputs], [one.unit for one in declared.inputs]
    for inputs, of_columns in enumerate(units):
        by_unit = dict[str, list[int]]()
        for k, unit in enumerate(of_columns):
            by_unit.setdefault(unit, []).append(k)
            for times in (-1.0, *TIMES.get(unit, OTHER_TIMES)):
                yield Otherwise(bool(inputs), (k,), times)
        for unit, columns in by_unit.items():
            for pair in itertools.combinations(columns, 2):
                yield Otherwise(bool(inputs), pair)
            for times in TIMES.get(unit, OTHER_TIMES) if len(columns) > 1 else ():
                yield Otherwise(bool(inputs), tuple(columns), times)


def tried(vehicle: LoadedVehicle, runs: Sequence[OwnRun]) -> list[dict[str, Any]]:
    """Readings with which every run's errors are far smaller, the best first, none where the model has no filter.

    Of each: what in words, the columns, the factor, and nat that the run gains that gains least.
    """
    declared, found = vehicle.declared, list[tuple[float, Otherwise]]()
    places = sorted({*np.linspace(0, len(runs) - 1, TRIED_RUNS).round().astype(int).tolist()})
    chosen = [thinned(runs[n], [one.interpolated for one in declared.inputs]) for n in places]
    if not vehicle.level:
        return []
    observer = TriedObserver(vehicle, chosen)
    usual = [_errors(observer, run, AS_IT_IS) for run in chosen]
    for one in otherwise(declared):
        least = np.inf
        for run, before in zip(chosen, usual, strict=True):
            least = min(least, float(np.nansum(before - _errors(observer, run, one))))
            if least < BETTER:
                break
        else:
            found.append((least, one))
    best = max((nat for nat, _ in found), default=0.0)
    return [{"what": one.said(declared), "columns": one.named(declared), "times": one.times, "nat": nat}
            for nat, one in sorted(found, key=lambda each: -each[0]) if nat > best - BETTER]  # fmt: skip


def _errors(observer: Observer, run: OwnRun, read: Otherwise) -> np.ndarray:
    """Logarithms (outputs,) of the errors of a run flown open loop, over the spread of its readings."""
    one, run = copy.copy(observer), read.of(run)
    one.runs, one.starts, one._begun, one._windows, one._first = [run], [0], {}, {}, {}
    one.tolerances = NO_LIMIT * observer.tolerances  # errors are counted whole
    gaps = one.gaps(0, one.point, one.horizon) * one.tolerances
    found = np.log(np.maximum(gaps, 1e-12) / np.maximum(_spreads(run, observer.angles), 1e-12))
    return np.minimum(found, MOST_ERROR)


def _spreads(run: OwnRun, angles: np.ndarray) -> np.ndarray:
    """Standard deviations (outputs,) of readings; of angles about their mean direction."""
    found = np.full(len(angles), np.nan)
    for k, values in enumerate(run.outputs.T):
        seen = values[np.isfinite(values)]
        if len(seen):
            away = (
                np.angle(np.exp(1j * (seen - np.angle(np.exp(1j * seen).mean())))) if angles[k] else seen - seen.mean()
            )
            found[k] = np.sqrt(np.mean(away**2))
    return found
