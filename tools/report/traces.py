"""The drawn runs of a diagnosis as data of the page's script: measured, nominal, corrected, commands, on one clock.

Values are 16-bit numbers in base64, each column between its least and its largest value: six runs of three minutes
take some 1.5 MB. A claim of the text is a run, a second and a chart; `Traces` finds them.
"""

import base64
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from glider.firmware.core.maths.rotations import wrap
from glider.tools.data.runs.origin import with_flight
from glider.tools.diagnose.record import Curves, DiagnosisRecord, Picture, number
from glider.tools.diagnose.residuals import smoothed
from glider.tools.gap.measure import scored_rows
from glider.tools.inference.channels import DEGREES, ROUGHIE_MEASURES, Channel
from glider.tools.inference.windows import Window
from glider.tools.report import words

MOST_ROWS = 2400  # of a run, in the page
LONGEST_HELD = 0.3  # s; a reading that comes more rarely than the log is drawn without gaps up to here
MISSING, HIGHEST = 65535, 65534  # codes
AXES = {"rates": ("roll rate", "pitch rate", "yaw rate"), "xy": ("north", "east")}  # of channels of several columns
COMMANDS = (("servo command", "deg", DEGREES), ("slider command", "mm", 1000.0), ("ballast command", "g", 1000.0))
CHART_OF_READING = {
    "p": "roll rate", "q": "pitch rate", "r": "yaw rate", "mocap x": "north", "mocap y": "east", "mocap z": "depth",
    "mocap roll": "roll", "mocap pitch": "pitch", "mocap yaw": "yaw", "rates": "pitch rate", "xy": "north",
    "gyro": "pitch rate", "attitude": "pitch", "water": "north",
    **dict(zip(ROUGHIE_MEASURES.columns, ("roll", "pitch", "yaw", *AXES["rates"], "depth", "slider", "ballast",
                                          *AXES["xy"]), strict=True)),
}  # fmt: skip


@dataclass(frozen=True)
class Claim:
    """Where a sentence of the report can be seen."""

    run: int
    second: float
    chart: str
    text: str


def encode(values: np.ndarray) -> dict[str, Any]:
    """A column (rows,) as base64 of 16-bit numbers: value = low + step * code, MISSING for NaN."""
    known = np.isfinite(values)
    low, high = (float(values[known].min()), float(values[known].max())) if known.any() else (0.0, 0.0)
    step = (high - low) / HIGHEST or 1.0
    codes = np.full(len(values), MISSING, dtype="<u2")
    codes[known] = np.round((values[known] - low) / step)
    return {"low": low, "step": step, "codes": base64.b64encode(codes.tobytes()).decode()}


def charts_of(channels: Iterable[str]) -> list[tuple[str, int, Channel]]:
    """Name, prediction column and channel of each chart of a run that is scored in these channels."""
    known = set(channels)
    return [
        (name, column, channel)
        for channel in ROUGHIE_MEASURES.channels if channel.name in known
        for name, column in zip(AXES.get(channel.name, (channel.name,)), channel.columns, strict=True)
    ]  # fmt: skip


class Traces:
    """The drawn runs, and where something is largest in them."""

    def __init__(self, record: DiagnosisRecord):
        self.record = record
        self.runs = list(zip(record.details.pictures, record.curves, strict=True))
        self.numbers = {picture.name: n for n, (picture, _) in enumerate(self.runs)}

    def plain(self) -> list[dict[str, Any]]:
        """The runs for the script."""
        return [self._run(picture, curves) for picture, curves in self.runs]

    def claim(self, run: str, second: float, reading: str) -> Claim | None:
        """A second of a run in the chart of a reading; None where the run is not drawn or has no such chart."""
        n, chart = self.numbers.get(run), CHART_OF_READING.get(reading, reading)
        if n is None or chart not in [name for name, _, _ in charts_of(self.runs[n][0].channels)]:
            return None
        return Claim(n, round(second, 1), chart, f"{chart} in {run} at {second:.0f} s")

    def largest(self, reading: str | None, model: str) -> Claim | None:
        """Where a model (`nominal`, `corrected`) is off most in a reading (None: in any), in tolerances."""
        chart, best, most = CHART_OF_READING.get(reading or "", reading), None, -1.0
        for picture, curves in self.runs:
            for name, column, channel in charts_of(picture.channels):
                if chart is not None and name != chart:
                    continue
                error = curves.measured[:, column] - getattr(curves, model)[:, column]
                error = (wrap(error) if channel.wrapped else error) / channel.tolerance
                mean = smoothed(_scored(error**2, curves.t), curves.t)
                at = int(mean.argmax())
                if mean[at] > most:
                    most, best = float(mean[at]), self.claim(picture.name, float(curves.t[at]), name)
        return best

    def _run(self, picture: Picture, curves: Curves) -> dict[str, Any]:
        listed = ROUGHIE_MEASURES.windows(curves.t)
        rows = np.arange(0, len(curves.t), max(1, int(np.ceil(len(curves.t) / MOST_ROWS))))
        t = curves.t[rows]

        def gaps(name: str) -> list[str]:
            return [words.number(number(table.get(name))) for table in (picture.before, picture.after)]

        commands = [] if curves.commands is None else [
            {"name": name, "unit": unit, "values": encode(scale * curves.commands[rows, n])}
            for n, (name, unit, scale) in enumerate(COMMANDS)
        ]  # fmt: skip
        return {
            "name": picture.name, "title": with_flight(picture.name, self.record.details.data.flights),
            "t": encode(t), "windows": [_seconds(one, curves.t) for one in listed], "gap": gaps("total"),
            "charts": [self._chart(curves, rows, listed, *one) | {"gap": gaps(one[2].name)}
                       for one in charts_of(picture.channels)],
            "commands": commands,
        }  # fmt: skip

    def _chart(
        self, curves: Curves, rows: np.ndarray, listed: list[Window], name: str, column: int, channel: Channel
    ) -> dict[str, Any]:
        seen = _held(curves.t, curves.measured[:, column], channel.wrapped)
        found: dict[str, Any] = {
            "name": name, "unit": channel.unit, "down": name == "depth", "tolerance": channel.tolerance * channel.scale,
            "measured": encode(channel.scale * seen[rows]),
        }  # fmt: skip
        beside = np.interp(curves.t, curves.t[np.isfinite(seen)], seen[np.isfinite(seen)]) if channel.wrapped else None
        begins = np.searchsorted(rows, [window.first for window in listed])
        for model in ("nominal", "corrected"):
            values = getattr(curves, model)[:, column].copy()
            if beside is not None:
                values = beside + wrap(values - beside)
            values = values[rows]
            values[begins[begins < len(rows)]] = np.nan  # a prediction starts anew with each window
            found[model] = encode(channel.scale * values)
        return found


def _seconds(window: Window, t: np.ndarray) -> list[float]:
    """First, start and end of a window, s, and whether it is scored."""
    start, end = (float(t[min(row, len(t) - 1)]) for row in (window.start, window.end - 1))
    return [round(float(t[window.first]), 3), round(start, 3), round(end, 3), int(window.scored)]


def _scored(square: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Squares (rows,) where a window is scored, 0 elsewhere."""
    return np.where(scored_rows(ROUGHIE_MEASURES.windows(t), len(t)), np.nan_to_num(square), 0.0)


def _held(t: np.ndarray, values: np.ndarray, wrapped: bool) -> np.ndarray:
    """Readings (rows,), angles without jumps of a turn, short gaps filled by straight lines."""
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < 2:
        return values
    seen = np.unwrap(values[known]) if wrapped else values[known]
    filled = np.interp(t, t[known], seen)
    after = np.minimum(np.searchsorted(known, np.arange(len(t))), len(known) - 1)
    apart = t[known[after]] - t[known[np.maximum(after - 1, 0)]]
    missing = ~np.isfinite(values) & ~((apart > 0.0) & (apart <= LONGEST_HELD))
    filled[missing] = np.nan
    return filled
