"""Missions of the foreign ocean glider for tests: drawn once for a seed, with the truth that flew them."""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from glider.tools.data.runs.case import Case, load_case
from glider.tools.data.runs.run import Run
from glider.tools.verify.challenge.ocean_cases import draw_case, fly_mission, write_dives
from glider.tools.verify.challenge.ocean_design import MissionDesign
from glider.tools.verify.challenge.ocean_plan import MissionPlan
from glider.tools.verify.challenge.watch_plan import UNCHANGED, WatchCounts

MOST = 12  # dives that a mission is drawn for: fewer of them are the first of these


@dataclass
class Dives:
    """A mission as it was flown and read."""

    mission: MissionDesign
    runs: list[Run]
    truth: list[np.ndarray]  # horizontal speed through the water every 60 s, m/s, of each dive


@cache
def drawn(vehicle_class: str, seed: int) -> MissionDesign:
    """The mission of a seed."""
    plan = MissionPlan(0, UNCHANGED, None, None, None, None, False, vehicle_class, True)
    return draw_case(seed, plan, WatchCounts(1, 1, MOST, 0)).mission


def fly_dives(
    count: int,
    change: tuple[str, float, int] | None = None,
    speed: bool = False,
    seed: int = 1,
    vehicle_class: str = "slocum",
) -> Dives:
    """So many dives; change: label, size, and the dive from which on it is there."""
    label, size, first = change or (None, 0.0, count)
    mission = drawn(vehicle_class, seed)
    return Dives(mission, *fly_mission(mission, [(label, size if n >= first else 0.0) for n in range(count)], speed))


def as_case(folder: Path, runs: list[Run], vehicle_class: str = "slocum") -> Case:
    """Runs written as a case of the shipped vehicle, and read back."""
    write_dives(folder, vehicle_class, runs)
    return load_case(folder)


def without(case: Case, column: str, runs: tuple[int, ...] | None = None) -> Case:
    """A case of which some runs (all, if none are named) lack a column."""
    chosen = range(len(case.runs)) if runs is None else runs
    return replace(case, runs=[
        replace(run, columns={name: values for name, values in run.columns.items() if name != column})
        if n in chosen else run for n, run in enumerate(case.runs)
    ])  # fmt: skip
