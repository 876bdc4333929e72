"""Channels of the gap: their tolerances, and which recorded columns they are measured in (docs/GAP.md, Measures)."""

from dataclasses import dataclass
from math import radians

import numpy as np

from tools.data.runs import columns as names
from tools.data.runs.run import Run


@dataclass(frozen=True)
class Channel:
    """One line of the gap: prediction columns (as `measured`), their tolerance in SI, and how it is shown."""

    name: str
    columns: tuple[int, ...]
    tolerance: float
    joint: bool = False  # the columns make one distance (xy); else each is a sample of its own (rates)
    wrapped: bool = False
    unit: str = ""
    scale: float = 1.0  # SI to `unit`
    commanded: bool = False  # only where the run has commands


CHANNELS = (
    Channel("depth", (6,), 0.05, unit="m"),
    Channel("pitch", (1,), radians(1.5), unit="deg", scale=180.0 / np.pi),
    Channel("roll", (0,), radians(1.5), wrapped=True, unit="deg", scale=180.0 / np.pi),
    Channel("yaw", (2,), radians(4.0), wrapped=True, unit="deg", scale=180.0 / np.pi),
    Channel("rates", (3, 4, 5), radians(2.0), unit="deg/s", scale=180.0 / np.pi),
    Channel("slider", (7,), 0.002, unit="mm", scale=1000.0, commanded=True),
    Channel("ballast", (8,), 0.005, unit="g", scale=1000.0, commanded=True),
    Channel("xy", (9, 10), 0.15, joint=True, unit="m"),
)

# prediction column -> the recorded column, and motion capture's in its place where that was not recorded
ONBOARD = (*names.ATTITUDE, *names.RATES, names.DEPTH, *names.DRAW_WIRES, *names.MOCAP_POSITION[:2])
INSTEAD = (*names.MOCAP_ATTITUDE, None, None, None, names.MOCAP_POSITION[2], None, None, None, None)


def recorded(run: Run, name: str | None) -> bool:
    """Whether the column is there and holds anything at all."""
    return name is not None and name in run.columns and bool(np.isfinite(run.columns[name]).any())


def measured_column(run: Run, index: int) -> str | None:
    """Name of the column that a prediction column is measured in; None where the run has none."""
    if recorded(run, ONBOARD[index]):
        return ONBOARD[index]
    return INSTEAD[index] if recorded(run, INSTEAD[index]) else None


def measured(run: Run) -> np.ndarray:
    """The run in prediction columns, shape (rows, 11), NaN where nothing was measured."""
    table = np.full((run.rows, len(ONBOARD)), np.nan)
    for index in range(len(ONBOARD)):
        name = measured_column(run, index)
        if name is not None:
            table[:, index] = run.columns[name]
    return table


def channels_of(run: Run) -> list[Channel]:
    """The channels that this run is scored in."""
    return [
        channel
        for channel in CHANNELS
        if all(measured_column(run, index) is not None for index in channel.columns)
        and (run.has_commands or not channel.commanded)
    ]
