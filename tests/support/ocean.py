"""Missions of the foreign ocean glider for tests: drawn once for a seed, with the truth that flew them."""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from tools.data.runs.case import Case, load_case
from tools.data.runs.run import Run
from tools.study.challenge.ocean_cases import draw_case, fly_mission, write_dives
from tools.study.challenge.ocean_design import Mission
from tools.study.challenge.ocean_plan import MissionPlan
from tools.study.challenge.watch_plan import UNCHANGED, WatchCounts

MOST = 12  # dives that a mission is drawn for: fewer of them are the first of these


@dataclass
class Dives:
    """A mission as it was flown and read."""

    mission: Mission
    runs: list[Run]
    truth: list[np.ndarray]  # horizontal speed through the water every 60 s, m/s, of each dive


@cache
def drawn(craft: str, seed: int) -> Mission:
    """The mission of a seed."""
    plan = MissionPlan(0, UNCHANGED, None, None, None, None, False, craft, True)
    return draw_case(seed, plan, WatchCounts(1, 1, MOST, 0)).mission


def fly_dives(
    count: int, change: tuple[str, float, int] | None = None, speed: bool = False, seed: int = 1, craft: str = "slocum"
) -> Dives:
    """So many dives; change: label, size, and the dive from which on it is there."""
    label, size, first = change or (None, 0.0, count)
    mission = drawn(craft, seed)
    return Dives(mission, *fly_mission(mission, [(label, size if n >= first else 0.0) for n in range(count)], speed))


def as_case(folder: Path, runs: list[Run], craft: str = "slocum") -> Case:
    """Runs written as a case of the shipped vehicle, and read back."""
    write_dives(folder, craft, runs)
    return load_case(folder)


def without(case: Case, column: str, runs: tuple[int, ...] | None = None) -> Case:
    """A case of which some runs (all, if none are named) lack a column."""
    chosen = range(len(case.runs)) if runs is None else runs
    return replace(case, runs=[
        replace(run, columns={name: values for name, values in run.columns.items() if name != column})
        if n in chosen else run for n, run in enumerate(case.runs)
    ])  # fmt: skip
