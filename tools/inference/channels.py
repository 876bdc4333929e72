"""What a kind of vehicle is scored in: channels with tolerances, recorded columns, windows.

See docs/reference/gap.md, Measures.

Nothing here knows of a model.
"""

from dataclasses import dataclass
from math import radians

import numpy as np

from glider.firmware.core.maths.rotations import wrap
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run
from glider.tools.inference.windows import Window, cut_windows

DEGREES = 180.0 / np.pi


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


def errors(channel: Channel, table: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """(measured - predicted) / tolerance of a channel, shape (rows, columns); NaN where nothing was measured."""
    columns = list(channel.columns)
    return in_tolerances(channel, table[:, columns] - Y[:, columns])


def in_tolerances(channel: Channel, difference: np.ndarray) -> np.ndarray:
    """Differences in a channel's columns (any shape, SI) in its tolerances, angles within half a turn."""
    return (wrap(difference) if channel.wrapped else difference) / channel.tolerance


def recorded(run: Run, name: str | None) -> bool:
    """Whether the column is there and holds anything at all."""
    return name is not None and name in run.columns and bool(np.isfinite(run.columns[name]).any())


@dataclass(frozen=True)
class Measures:
    """How flights of a kind of vehicle are measured."""

    channels: tuple[Channel, ...]
    columns: tuple[str, ...]  # the recorded column of each prediction column
    instead: tuple[str | None, ...]  # what stands in its place where that was not recorded
    window: float  # s
    look_in: float  # s at the begin of a window, which find its start

    def measured_column(self, run: Run, index: int) -> str | None:
        """Name of the column that a prediction column is measured in; None where the run has none."""
        for name in (self.columns[index], self.instead[index]):
            if recorded(run, name):
                return name
        return None

    def measured(self, run: Run) -> np.ndarray:
        """The run in prediction columns, shape (rows, columns), NaN where nothing was measured."""
        table = np.full((run.rows, len(self.columns)), np.nan)
        for index in range(len(self.columns)):
            name = self.measured_column(run, index)
            if name is not None:
                table[:, index] = run.columns[name]
        return table

    def channels_of(self, run: Run) -> list[Channel]:
        """The channels that this run is scored in."""
        return [
            channel
            for channel in self.channels
            if all(self.measured_column(run, index) is not None for index in channel.columns)
            and (run.has_commands or not channel.commanded)
        ]

    def windows(self, t: np.ndarray) -> list[Window]:
        """Windows of a run with samples at t (s, increasing)."""
        return cut_windows(t, self.window, self.look_in)


_COLUMNS = (*names.ATTITUDE, *names.RATES, names.DEPTH, *names.DRAW_WIRES, *names.MOCAP_POSITION[:2])


def _at(*columns: str) -> tuple[int, ...]:
    return tuple(_COLUMNS.index(column) for column in columns)


ROUGHIE_MEASURES = Measures(
    channels=(
        Channel("depth", _at(names.DEPTH), 0.05, unit="m"),
        Channel("pitch", _at(names.ATTITUDE[1]), radians(1.5), unit="deg", scale=DEGREES),
        Channel("roll", _at(names.ATTITUDE[0]), radians(1.5), wrapped=True, unit="deg", scale=DEGREES),
        Channel("yaw", _at(names.ATTITUDE[2]), radians(4.0), wrapped=True, unit="deg", scale=DEGREES),
        Channel("rates", _at(*names.RATES), radians(2.0), unit="deg/s", scale=DEGREES),
        Channel("slider", _at(names.DRAW_WIRES[0]), 0.002, unit="mm", scale=1000.0, commanded=True),
        Channel("ballast", _at(names.DRAW_WIRES[1]), 0.005, unit="g", scale=1000.0, commanded=True),
        Channel("xy", _at(*names.MOCAP_POSITION[:2]), 0.15, joint=True, unit="m"),
    ),
    columns=_COLUMNS,
    instead=(*names.MOCAP_ATTITUDE, None, None, None, names.MOCAP_POSITION[2], None, None, None, None),
    window=20.0,
    look_in=2.0,
)
