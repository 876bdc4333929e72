"""The report of a measured gap: one HTML file that opens offline, on a phone too."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.data.files import write_bytes
from glider.tools.data.runs.origin import flights_of, with_flight
from glider.tools.gap.assess import CaseGap
from glider.tools.inference.channels import Channel, errors
from glider.tools.report.charts import Chart, Curve, svg
from glider.tools.report.lines import bands, broken, compared, plan_chart
from glider.tools.report.page import render

MOST_RUNS = 12  # with pictures; of a longer case those with the largest gaps
OFF_HEIGHT = 110  # px, of measured minus predicted below its channel
RATE_NAMES = ("roll rate p", "pitch rate q", "yaw rate r")
# What a part's name says to a reader who has not read the contract.
PARTS = {
    "allowed": "what noise, disturbance and parameter uncertainty leave anyway",
    "unexplained": "what no part explains",
}


def _charts(found: CaseGap, n: int) -> list[dict[str, Any]]:
    """The pictures of one run: title, gap and SVG."""
    run, Y, listed = found.case.runs[n], found.predictions[n], found.windows[n]
    table, gaps, t = found.measures.measured(run), found.runs[n].channels, run.t
    drawn: list[dict[str, Any]] = []

    def add(channel: Channel, chart: Chart, least: float, off: str = "") -> None:
        drawn.append({"title": chart.title, "gap": gaps.get(channel.name), "svg": svg(chart, least), "off": off})

    for channel in found.measures.channels_of(run):
        if channel.joint:
            continue
        for k, column in enumerate(channel.columns):
            title = f"{RATE_NAMES[k] if channel.name == 'rates' else channel.name}, {channel.unit}"
            said = {"predicted": Y[:, column]}
            lines = compared(t, table[:, column], said, listed, channel.scale, channel.wrapped)
            chart = Chart(title, "s", lines, bands(t, listed), down=channel.name == "depth")
            tolerance = channel.tolerance * channel.scale
            error = errors(channel, table, Y)[:, k] * tolerance
            limits = [Curve(t[[0, -1]], np.full(2, side * tolerance), "limit") for side in (-1.0, 1.0)]
            off = Chart(
                f"{title}: measured minus predicted, between dashed lines within the tolerance", "s",
                [*limits, broken(t, error, listed, "predicted")], bands(t, listed), chart.down, height=OFF_HEIGHT,
            )  # fmt: skip
            add(channel, chart, 4.0 * tolerance, svg(off, 2.6 * tolerance))
    for channel in found.measures.channels_of(run):
        if channel.joint:
            add(channel, plan_chart(table, {"predicted": Y}, channel.columns, listed), 1.0)
    return drawn


def tint_of(value: float | None) -> int:
    """Shade of a table cell, 0 (none) to 5: twice the gap is one shade more."""
    if value is None or not math.isfinite(value) or value < 0.5:
        return 0
    return min(5, 1 + int(math.log2(value / 0.5)))


def _context(found: CaseGap) -> dict[str, Any]:
    names = list(found.channels)
    order = sorted(range(len(found.runs)), key=lambda n: -np.nan_to_num(found.runs[n].total))
    shown = sorted(order[:MOST_RUNS])

    def cells(channels: dict[str, float], total: float) -> list[dict[str, Any]]:
        values = [*(channels.get(name) for name in names), total]
        return [{"value": value, "tint": tint_of(value)} for value in values]

    shares = [
        {
            "name": PARTS.get(s.subsystem, f"{s.subsystem}: {s.element}"),
            "percent": 100.0 * s.share,
            "kind": s.subsystem if s.subsystem in PARTS else "part",
        }
        for s in found.where
    ]
    tolerances = [
        {"name": c.name, "tolerance": f"{c.tolerance * c.scale:g} {c.unit}"}
        for c in found.measures.channels
        if c.name in names
    ]
    flights = flights_of(found.case.runs)
    return {
        "case": found.case.folder.resolve().name,
        "vehicle": found.case.vehicle.name,
        "site": found.case.site,
        "rate": found.case.log_rate_hz,
        "mocap": found.case.motion_capture,
        "model": found.model.name,
        "total": found.total,
        "names": names,
        "runs": [
            {"name": with_flight(run.name, flights), "cells": cells(run.channels, run.total)} for run in found.runs
        ],
        "all": cells(found.channels, found.total),
        "shares": shares,
        "tolerances": tolerances,
        "pictures": [
            {
                "name": with_flight(found.runs[n].name, flights),
                "total": found.runs[n].total,
                "charts": _charts(found, n),
            }
            for n in shown
        ],
        "left_out": len(found.runs) - len(shown),
        "commands": all(run.has_commands for run in found.case.runs),
    }


def report_html(found: CaseGap) -> str:
    """The page's text."""
    return render("gap.html", _context(found))


def write_report(path: Path, found: CaseGap) -> None:
    """Write the page to a file."""
    write_bytes(path, report_html(found).encode("utf-8"))
