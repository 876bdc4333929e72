"""The measures of `glider benchmark` by name. Each is a function in a module of its own, imported when it is run.

A measure takes Settings and returns what it found under its own JSON names, units in the names; speeds stand beside
what they are compared with, taken in turns in the same run.
"""

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from glider.tools.data.errors import InputError


@dataclass(frozen=True)
class Settings:
    """What the command line sets for all measures."""

    repeats: int = 5  # runs of each thing compared; medians are reported
    plant_c: Path | None = None  # another C program to time the plant against
    ocean_cases: Path | None = None  # folder of cases of ocean gliders, beside the missions of our own making


class Measure(NamedTuple):
    """Where a measure is and what it says."""

    module: str  # beside this one
    line: str

    def load(self) -> Callable[[Settings], dict[str, Any]]:
        """The function itself; its module is imported now."""
        return importlib.import_module(f"glider.tools.verify.benchmark.{self.module}").measure


MEASURES = {
    "plant": Measure("plant_speed", "steps of the nominal plant, beside plain C"),
    "closed_loop": Measure("closed_loop", "compiled loop of plant, sensors and autopilot"),
    "tick": Measure("tick", "the real runtime's tick: time, and that it allocates nothing"),
    "campaign": Measure("campaign", "many flights at once, all cores against one"),
    "identify": Measure("identify", "effective samples a second, beside emcee"),
    "ocean": Measure("ocean", "ocean gliders watched, beside a fit of drag with a threshold"),
    "memory": Measure("memory", "memory of the flying process"),
    "startup": Measure("startup", "from the shell to the first word"),
}


def run(names: list[str], settings: Settings, started: Callable[[str], None] | None = None) -> dict[str, Any]:
    """Results by name of measure, in the order of `names`; `started` is called before each."""
    unknown = [name for name in names if name not in MEASURES]
    if unknown:
        raise InputError(f"no measure '{unknown[0]}': expected one of {', '.join(MEASURES)}")
    results = {}
    for name in names:
        if started is not None:
            started(name)
        results[name] = MEASURES[name].load()(settings)
    return results
