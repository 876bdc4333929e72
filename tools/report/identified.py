"""The report of an identification: marginals as in the paper's Fig. 4, corner plot, residuals, flights left out."""

import base64
import io
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from glider.firmware.model.vehicle import COEFFICIENTS
from glider.tools.data.files import write_bytes
from glider.tools.identify.identifiability import sentences, unidentifiable_directions
from glider.tools.identify.pipeline import Identified
from glider.tools.inference.channels import ROUGHIE_MEASURES
from glider.tools.inference.levels import SENSORS, group_of_reading
from glider.tools.report.alarm import alarms
from glider.tools.report.charts import Chart, Curve, svg
from glider.tools.report.lines import compared
from glider.tools.report.page import render

INK, TRUTH, SOFT = "#1d3f72", "#d9480f", "#8a94a3"
SHOWN = 4  # flights left out with pictures: those whose gap was largest before
POINTS = 1500  # of the chains, in a corner plot
PANEL = (0.03, 0.97)  # of its row and column
DRAWN = ("depth", "pitch", "roll")


def png(figure) -> str:
    """A figure as a data URI."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=110)
    return "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode()


def marginals(found: Identified, truth: dict[str, float] | None = None):
    """Histograms of the twelve coefficients beside their priors, mean and 90 % interval marked, and the known truth."""
    from matplotlib.figure import Figure

    draws = found.free.si(found.chains.flat)
    figure = Figure(figsize=(11, 7), layout="constrained")
    axes = figure.subplots(3, 4)
    for n, (axis, one) in enumerate(zip(axes.flat, found.coefficients, strict=True)):
        axis.hist(draws[:, n], bins=50, density=True, color=INK, alpha=0.55)
        low, high = axis.get_xlim()
        x, centre, spread = np.linspace(low, high, 100), found.free.nominal[n], found.free.spreads[n]
        axis.plot(x, np.exp(-0.5 * ((x - centre) / spread) ** 2) / (spread * np.sqrt(2.0 * np.pi)), color=SOFT, ls=":")
        axis.axvspan(*one.ci90, color=SOFT, alpha=0.2)
        axis.axvline(one.mean, color=INK)
        if truth is not None:
            axis.axvline(truth[one.name], color=TRUTH, linestyle="--")
        axis.set_title(f"{one.name} = {one.mean:.4g}, sd {one.sd:.2g} {one.unit}", fontsize=8)
        axis.set_yticks([])
        axis.locator_params(axis="x", nbins=5)
        axis.tick_params(labelsize=7)
    return figure


def corner(found: Identified):
    """Pairs of coefficients: draws below the diagonal, marginals on it, correlations above."""
    from matplotlib.collections import PatchCollection
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    flat = found.free.si(found.chains.flat)[:, : len(COEFFICIENTS)]
    count, low, span = len(COEFFICIENTS), flat.min(axis=0), np.ptp(flat, axis=0) + np.finfo(float).tiny

    def place(n: int, values: np.ndarray) -> np.ndarray:
        """Values of a coefficient along its column, of width 1; the same upwards along its row."""
        return PANEL[0] + (PANEL[1] - PANEL[0]) * (0.05 + 0.9 * (values - low[n]) / span[n])

    # One pair of axes for all panels: one for each takes six times as long.
    figure = Figure(figsize=(11, 11))
    axis = figure.subplots()
    figure.subplots_adjust(0.05, 0.05, 0.99, 0.99)
    axis.set(xlim=(0, count), ylim=(0, count))
    axis.axis("off")
    correlation = np.corrcoef(flat.T)
    shades = np.triu(np.abs(correlation), 1)
    corners = [(j + PANEL[0], count - 1 - i + PANEL[0]) for i in range(count) for j in range(count)]
    panels = [Rectangle(at, PANEL[1] - PANEL[0], PANEL[1] - PANEL[0]) for at in corners]
    colours = [(0.85, 0.28, 0.06, 0.7 * shade) for shade in shades.flat]
    axis.add_collection(PatchCollection(panels, facecolors=colours, edgecolors="black", linewidths=0.8))
    for n, name in enumerate(COEFFICIENTS):
        up = count - 1 - n
        often, edges = np.histogram(flat[:, n], bins=30)
        bars = up + PANEL[0] + (PANEL[1] - PANEL[0]) * often / (1.05 * often.max())
        axis.stairs(bars, n + place(n, edges), baseline=up + PANEL[0], fill=True, color=INK, alpha=0.6)
        axis.text(n + 0.5, -0.05, name, ha="center", va="top", fontsize=7)
        axis.text(-0.05, up + 0.5, name, ha="right", va="center", rotation="vertical", fontsize=7)
    few = flat[:: max(1, len(flat) // POINTS)]
    for i, j in combinations(range(count), 2):
        axis.plot(i + place(i, few[:, i]), count - 1 - j + place(j, few[:, j]), ",", color=INK, alpha=0.4)
        axis.text(j + 0.5, count - 0.5 - i, f"{correlation[i, j]:+.2f}", ha="center", va="center", fontsize=7)
    return figure


def residual_rows(found: Identified) -> list[dict[str, Any]]:
    """Whitened innovations by sensor: mean square, and correlation with themselves a sample later."""
    if found.fit is None or found.fit.at is None:
        return []
    E, rows = found.fit.at.gains.E, []
    for g, name in enumerate(SENSORS):
        columns = np.flatnonzero(group_of_reading() == g)
        e = E[:, columns]
        if not np.isfinite(e).any():
            continue
        same = found.fit.problem.run_of[1:] == found.fit.problem.run_of[:-1]
        product = (e[1:] * e[:-1])[same]
        rows.append({
            "name": name.replace("_", " "), "square": float(np.nanmean(e**2)), "count": int(np.isfinite(e).sum()),
            "next": float(np.nanmean(product)) / max(float(np.nanmean(e**2)), 1e-12),
        })  # fmt: skip
    return rows


def residual_chart(found: Identified) -> str | None:
    """Distribution of all whitened innovations beside the normal one."""
    if found.fit is None or found.fit.at is None:
        return None
    edges = np.linspace(-5.0, 5.0, 61)
    middle = 0.5 * (edges[1:] + edges[:-1])
    density, _ = np.histogram(found.fit.at.e, edges, density=True)
    normal = np.exp(-0.5 * middle**2) / np.sqrt(2.0 * np.pi)
    return svg(
        Chart("whitened innovations", "sigma", [Curve(middle, density, "measured"), Curve(middle, normal, "predicted")])
    )


def flights(found: Identified) -> list[dict[str, Any]]:
    """Pictures of flights left out of the fit: measured, nominal, identified."""
    held = found.held
    if held is None:
        return []
    order = np.argsort([-gap.total for gap in held.before])[:SHOWN]
    shown = []
    for n in sorted(order.tolist()):
        run = held.runs[n]
        listed, table, charts = ROUGHIE_MEASURES.windows(run.t), ROUGHIE_MEASURES.measured(run), []
        for channel in (c for c in ROUGHIE_MEASURES.channels if c.name in DRAWN):
            column, scale, down = channel.columns[0], channel.scale, channel.name == "depth"
            title = f"{channel.name}, {channel.unit}"
            if not np.isfinite(table[:, column]).any():
                continue
            said = {"nominal": held.candidates[0].flown[n][:, column], "corrected": held.chosen.flown[n][:, column]}
            lines = compared(run.t, table[:, column], said, listed, scale, wraps=not down)
            charts.append({"title": title, "svg": svg(Chart(title, "s", lines, down=down), 0.05)})
        shown.append(
            {"name": run.name, "before": held.before[n].total, "after": held.after[n].total, "charts": charts}
        )  # fmt: skip
    return shown


def report_html(found: Identified) -> str:
    """The page's text."""
    held = None if found.held is None else found.held.plain()
    levels = [] if found.levels is None else list(zip(found.levels.names, found.levels.log, strict=True))
    noise = {name.replace("_", " "): float(np.exp(log)) for name, log in levels}
    open_directions = [one.sentence() for one in unidentifiable_directions(found.free, found.chains.flat)]
    context = {
        "alarms": alarms(held, noise, found.notes, open_directions),
        "case": found.case.folder.resolve().name, "vehicle": found.case.vehicle.name, "site": found.case.site,
        "runs": len(found.runs), "seconds": found.seconds, "likelihood": found.likelihood,
        "summaries": [one.plain() for one in found.coefficients],
        "others": [one.plain() for one in found.summaries[len(COEFFICIENTS) :]],
        "sentences": sentences(found.free, found.chains.flat),
        "left_out": [str(one) for one in found.left_out], "spikes": found.spikes,
        "marginals": png(marginals(found)), "corner": png(corner(found)),
        "noise": noise,
        "inflation": found.quadratic.inflation, "check": found.check, "residuals": residual_rows(found),
        "residual_chart": residual_chart(found), "held": held, "flights": flights(found),
        "compared": found.compared(), "acceptance": float(found.chains.acceptance.mean()),
        "chains": found.chains.values.shape[0], "draws": found.chains.values.shape[1],
    }  # fmt: skip
    return render("identified.html", context)


def write_report(path: Path, found: Identified) -> None:
    """Write the page to a file."""
    write_bytes(path, report_html(found).encode("utf-8"))
