"""From places measured with a ruler or a protractor to the board file's numbers: straight lines, and how they fit."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from glider.tools.bench.client import BenchError

LEAST_SPREAD = {"servo": 5.0, "slider": 5.0, "ballast": 3.0}  # deg, mm between the outermost places


@dataclass
class CalibrationFit:
    """reading = zero + slope * place; residual is the worst, in the place's unit."""

    slope: float
    zero: float
    residual: float


def fit(places: list[float], readings: list[float], least_spread: float) -> CalibrationFit:
    """A straight line through at least two places that lie apart; BenchError where that is not enough."""
    x, y = np.array(places, dtype=float), np.array(readings, dtype=float)
    if len(x) < 2 or np.ptp(x) < least_spread:
        raise BenchError(f"needs two places at least {least_spread:g} apart, got {', '.join(f'{p:g}' for p in places)}")
    if np.ptp(y) == 0.0:
        raise BenchError("the reading does not change with the place")
    slope, zero = (float(value) for value in np.polyfit(x, y, 1))
    return CalibrationFit(slope, zero, float(np.max(np.abs((y - zero) / slope - x))))


def wire_changes(name: str, found: CalibrationFit) -> dict[str, Any]:
    """A draw-wire's new numbers; the fit is in readings per mm."""
    return {f"{name}.per_m": round(found.slope * 1e3, 3), f"{name}.zero": round(found.zero, 3)}


def drive_changes(name: str, found: CalibrationFit) -> dict[str, Any]:
    """A drive's new numbers; the fit is in counts per mm."""
    return {f"{name}.counts_per_m": round(found.slope * 1e3, 1), f"{name}.zero_counts": round(found.zero, 1)}


def servo_changes(found: CalibrationFit) -> dict[str, Any]:
    """The servo's new numbers; the fit is in microseconds per degree."""
    return {"servo.us_per_rad": round(float(np.degrees(found.slope)), 3), "servo.zero_us": round(found.zero, 2)}
