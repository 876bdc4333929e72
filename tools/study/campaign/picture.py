"""The picture of a campaign: one HTML file that opens offline, table and charts."""

from pathlib import Path
from typing import Any

import numpy as np

from glider.firmware.core.control.controller_rows import CONTROLLERS
from glider.tools.data.files import write_bytes
from glider.tools.data.intervals import wilson
from glider.tools.report.charts import Chart, Curve, svg
from glider.tools.report.page import render
from glider.tools.study.campaign.conduct import FlownChunk
from glider.tools.study.campaign.summary import completed_by_all, summarise

BINS = 5
POINTS = 200  # of a distribution
TAIL = 98.0  # percentile at which a distribution's axis ends
CONDITIONS = (
    ("current_m_s", "current", "m/s"), ("wave_height_m", "wave height", "m"), ("wave_period_s", "wave period", "s"),
    ("disturbance", "disturbance", "m/s2, rad/s2"), ("start_depth_m", "depth at the start", "m"),
)  # fmt: skip
ERRORS = (("depth_error_m", "depth error, m", "m", 1.0), ("pitch_error_rad", "pitch error, deg", "deg", 180.0 / np.pi))
CONTROLLER_NAMES = {"pid_tuned": "PID best-tuned", **{name: row.title for name, row in CONTROLLERS.items()}}


def _style(number: int) -> str:
    """CSS class of a controller's lines."""
    return f"c{number % 5}"


def _own(flown: FlownChunk, number: int) -> np.ndarray:
    return flown.column("controller") == number


def _distributions(flown: FlownChunk) -> list[Chart]:
    """Share of flights (%) with an error up to x, for each controller, in worlds that all of them completed."""
    charts = []
    common = completed_by_all(flown)
    for column, title, unit, scale in ERRORS:
        values = flown.column(column) * scale
        known = common & np.isfinite(values)
        if known.sum() < 2 * len(flown.plan.campaign.controllers):
            continue
        x = np.linspace(0.0, float(np.percentile(values[known], TAIL)), POINTS)
        lines = []
        for number in range(len(flown.plan.campaign.controllers)):
            own = np.sort(values[known & _own(flown, number)])
            lines.append(Curve(x, 100.0 * np.searchsorted(own, x, side="right") / len(own), _style(number)))
        charts.append(Chart(f"flights (%) with a mean {title.split(',')[0]} up to", unit, lines))
    return charts


def _against(flown: FlownChunk, column: str, name: str, unit: str) -> list[Chart]:
    """Flights completed (%, with 90 % intervals) and median errors against something drawn, in BINS even bins."""
    drawn = flown.column(column)
    low, high = float(drawn.min()), float(drawn.max())
    if high - low < 1e-9 * max(1.0, high):
        return []
    bins = np.minimum((BINS * (drawn - low) / (high - low)).astype(int), BINS - 1)
    middles = low + (np.arange(BINS) + 0.5) * (high - low) / BINS
    within, common = flown.column("within_limits"), completed_by_all(flown)
    shares = [Curve(np.array([low, high]), np.array([0.0, 100.0]), "unseen")]  # so that the axis shows 0 to 100
    medians: list[list[Curve]] = [[] for _ in ERRORS]
    controllers = len(flown.plan.campaign.controllers)
    for number in range(controllers):
        own = _own(flown, number)
        # side by side, so that intervals do not hide one another
        x = middles + (number - 0.5 * (controllers - 1)) * 0.06 * (high - low) / BINS
        counts = [(int(within[own & (bins == b)].sum()), int((own & (bins == b)).sum())) for b in range(BINS)]
        share = np.array([100.0 * k / n if n else np.nan for k, n in counts])
        ends = np.array([(*(100.0 * end for end in wilson(k, n)), np.nan) if n else 3 * (np.nan,) for k, n in counts])
        shares.append(Curve(x, share, _style(number)))
        shares.append(Curve(np.repeat(x, 3), ends.ravel(), f"{_style(number)} interval"))
        for (error, _, _, scale), lines in zip(ERRORS, medians, strict=True):
            values = flown.column(error) * scale
            chosen = [values[own & common & (bins == b) & np.isfinite(values)] for b in range(BINS)]
            lines.append(Curve(x, np.array([np.median(v) if v.size else np.nan for v in chosen]), _style(number)))
    charts = [Chart(f"completed, %, against {name}", unit, shares)]
    for (_, title, _, _), lines in zip(ERRORS, medians, strict=True):
        if any(np.isfinite(line.y).any() for line in lines):
            charts.append(Chart(f"median {title}, against {name}", unit, lines))
    return charts


def _context(flown: FlownChunk) -> dict[str, Any]:
    campaign, result = flown.plan.campaign, summarise(flown)
    charts = _distributions(flown)
    for column, name, unit in CONDITIONS:
        charts += _against(flown, column, name, unit)
    several = len(flown.plan.missions) > 1
    rows = result["controllers"] + (result["by_mission"] if several else [])
    for row in rows:
        row["shown"] = CONTROLLER_NAMES[row["controller"]]
        row["why"] = ", ".join(f"{name} {count}" for name, count in row["reasons"].items())
    water, spread, period = campaign.environment, campaign.spread, campaign.environment.wave_period_s
    drawn = [
        f"parameters at {spread.parameters:g} times [uncertainty]",
        f"currents to {water.current_m_s:g} m/s",
        f"waves to {water.wave_height_m:g} m with periods of {period[0]:g} to {period[1]:g} s",
        f"sensor biases at {spread.sensor_bias:g} and noise at {spread.sensor_noise:g} times the file's",
        "the vehicle file's disturbance"
        if water.disturbance is None
        else f"disturbances of {water.disturbance[0]:g} to {water.disturbance[1]:g} m/s2 and rad/s2",
    ]
    return {
        "campaign": campaign,
        "result": result,
        "rows": rows,
        "drawn": drawn,
        "missions": [mission.name for mission in flown.plan.missions],
        "legend": [(CONTROLLER_NAMES[name], _style(n)) for n, name in enumerate(campaign.controllers)],
        "charts": [{"title": chart.title, "svg": svg(chart)} for chart in charts],
    }


def page(flown: FlownChunk) -> str:
    """The page's text."""
    return render("campaign.html", _context(flown))


def write_page(path: Path, flown: FlownChunk) -> None:
    """Write the page to a file."""
    write_bytes(path, page(flown).encode())
