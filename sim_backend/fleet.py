"""Many closed-loop flights from one compiled call: worlds and autopilots stacked, flown, and their outcomes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glider.firmware.autopilot import Autopilot
from glider.firmware.core.layouts.control_layout import COMPLETED, ESTIMATOR, N_LEG
from glider.firmware.core.maths.wide import LANES
from glider.sim_backend.core.closed_loop import END_LEG, END_MODE, END_REASON, END_TIME, N_END, N_TRACE, TRACE
from glider.sim_backend.core.closed_loop_lanes import fly_batch, fly_lanes
from glider.sim_backend.core.layout import N_WAVE
from glider.sim_backend.world import World


@dataclass
class FleetResult:
    """Outcomes of n flights: how each ended, its last state, and its trace."""

    modes: np.ndarray  # (n,) control_layout WAITING .. ABORTED
    reasons: np.ndarray  # (n,)
    seconds: np.ndarray  # (n,)
    legs: np.ndarray  # (n,) the last leg flown, from 0
    ticks: np.ndarray  # (n,)
    ends: np.ndarray  # (n, N_END) all that closed_loop keeps of a flight
    states: np.ndarray  # (n, N_XF) of the plant at the end, what effects remember behind it
    traces: np.ndarray  # (n, lines, N_TRACE), NaN behind a flight's end

    @property
    def completed(self) -> np.ndarray:
        """True for each flight that completed its mission, shape (n,)."""
        return self.modes == COMPLETED

    def column(self, name: str) -> np.ndarray:
        """One column of the traces by its name in TRACE, shape (n, lines)."""
        return self.traces[:, :, TRACE.index(name)]


def groups_of(worlds: Sequence[World], pilots: Sequence[Autopilot]) -> tuple[np.ndarray, np.ndarray]:
    """Flights that go side by side: their numbers (groups, LANES), and how many of a row count (groups,).

    Those of a group all have effects, or none has, and their autopilots have the same kind of estimate. A row that is
    not full is filled with its last flight.
    """
    kinds: dict[tuple[bool, float], list[int]] = {}
    for number, (world, pilot) in enumerate(zip(worlds, pilots, strict=True)):
        kinds.setdefault((bool(world.F.any()), float(pilot.C[ESTIMATOR])), []).append(number)
    rows = [identical[i : i + LANES] for identical in kinds.values() for i in range(0, len(identical), LANES)]
    filled = [row + row[-1:] * (LANES - len(row)) for row in rows]
    return np.array(filled, dtype=np.int64), np.array([len(row) for row in rows], dtype=np.int64)


def stacked(worlds: Sequence[World], pilots: Sequence[Autopilot]) -> tuple:
    """What fly_lanes and fly_batch take of flights, from P_plants to xs; the states are copies."""
    n, first = len(worlds), pilots[0]
    rows = np.array([len(pilot.legs) for pilot in pilots])
    legs = np.full((n, rows.max(), N_LEG), np.nan)
    waves = np.zeros((n, max(len(world.waves) for world in worlds), N_WAVE))
    waves[:, :, 1] = waves[:, :, 2] = 1.0  # a wave of no height still needs a length
    for i, (world, pilot) in enumerate(zip(worlds, pilots, strict=True)):
        legs[i, : rows[i]] = pilot.legs
        waves[i, : len(world.waves)] = world.waves
    return (
        np.array([world.P for world in worlds]), first.P, np.array([pilot.C for pilot in pilots]), legs, rows,
        first.nav, np.array([world.E for world in worlds]), np.array([world.F for world in worlds]), waves,
        np.array([world.sensors for world in worlds]), np.array([world.errors for world in worlds]),
        np.array([world.seed for world in worlds]), np.array([world.x for world in worlds]),
    )  # fmt: skip


def fly_group(
    worlds: Sequence[World], pilots: Sequence[Autopilot], max_ticks: int, every: int, traces: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Fly up to LANES flights of one group on this thread: ends (n, N_END), ticks (n,), and every `every`-th tick into
    traces (n or more, lines, N_TRACE)."""
    ends, ticks = np.zeros((len(worlds), N_END)), np.zeros(len(worlds), dtype=np.int64)
    (members,), (count,) = groups_of(worlds, pilots)
    fly_lanes(
        members, int(count), *stacked(worlds, pilots), worlds[0].dt, max_ticks, every, traces, ends, ticks
    )  # fmt: skip
    return ends, ticks


def fly_fleet(
    worlds: Sequence[World], pilots: Sequence[Autopilot], *, max_seconds: float, trace_every: float = 0.0
) -> FleetResult:
    """Fly pilot i in world i, for all i at once over all cores. The worlds do not move; their states are copied.

    All pilots have the same model and run at the same step. trace_every in s; 0 keeps no trace. What comes of a flight
    does not depend on those beside it.
    """
    n, step = len(worlds), float(pilots[0].C[0])
    every = max(1, round(trace_every / step)) if trace_every else 1
    lines = int(max_seconds / step) // every + 1 if trace_every else 0
    traces, ends = np.full((n, lines, N_TRACE), np.nan), np.zeros((n, N_END))
    ticks, tables = np.zeros(n, dtype=np.int64), stacked(worlds, pilots)
    fly_batch(
        *groups_of(worlds, pilots), *tables, worlds[0].dt, int(max_seconds / step), every, traces, ends, ticks
    )  # fmt: skip
    return FleetResult(
        modes=ends[:, END_MODE], reasons=ends[:, END_REASON], seconds=ends[:, END_TIME],
        legs=ends[:, END_LEG].astype(int), ticks=ticks, ends=ends, states=tables[-1], traces=traces,
    )  # fmt: skip
