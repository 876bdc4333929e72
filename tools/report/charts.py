"""Small line charts as inline SVG: no library, no script, readable on a phone; colours come from the page's CSS."""

from dataclasses import dataclass, field
from html import escape

import numpy as np

WIDTH, HEIGHT = 560, 210
LEFT, RIGHT, TOP, BOTTOM = 56, 14, 10, 26
MOST_POINTS = 700


@dataclass
class Curve:
    """One series: points (n,), NaN breaks it; `style` is a CSS class."""

    x: np.ndarray
    y: np.ndarray
    style: str


@dataclass
class Band:
    """A shaded stretch of the x axis; `style` is a CSS class."""

    first: float
    last: float
    style: str


@dataclass
class Chart:
    """A chart with its axes. `down` turns the y axis over (depth); `square` gives both axes one scale (a plan)."""

    title: str
    x_unit: str  # behind the last number of the x axis
    lines: list[Curve]
    bands: list[Band] = field(default_factory=list)
    down: bool = False
    square: bool = False
    height: int = HEIGHT


def ticks(low: float, high: float, count: int = 5) -> np.ndarray:
    """Round numbers within [low, high], some `count` of them."""
    span = high - low
    step = 10.0 ** np.floor(np.log10(span / count))
    step *= next(factor for factor in (1.0, 2.0, 5.0, 10.0) if span / (step * factor) <= count)
    return np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1) * step


def label(value: float) -> str:
    """A tick's number, without a tail of rounding."""
    return f"{value:.6g}".replace("-", "\N{MINUS SIGN}") if abs(value) > 1e-12 else "0"


def _range(values: list[np.ndarray], least: float) -> tuple[float, float]:
    """Lowest and highest finite value with a margin; at least `least` wide."""
    finite = np.concatenate([v[np.isfinite(v)] for v in values]) if values else np.zeros(0)
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    margin = max(0.06 * (high - low), 0.5 * (least - (high - low)))
    return low - margin, high + margin


def _thin(line: Curve) -> tuple[np.ndarray, np.ndarray]:
    """At most MOST_POINTS points; breaks stay."""
    stride = max(1, int(np.ceil(len(line.x) / MOST_POINTS)))
    if stride == 1:
        return line.x, line.y
    keep = np.zeros(len(line.x), dtype=bool)
    keep[::stride] = True
    gaps = ~np.isfinite(line.y)
    keep |= gaps | np.roll(gaps, 1) | np.roll(gaps, -1)
    return line.x[keep], line.y[keep]


def _path(x: np.ndarray, y: np.ndarray) -> str:
    """SVG path data of pixel points; NaN lifts the pen, a point alone becomes a dot."""
    parts, pen = [], False
    for a, b in zip(x.tolist(), y.tolist(), strict=True):
        if a != a or b != b:
            pen = False
            continue
        parts.append(f"{'L' if pen else 'M'}{a:.1f} {b:.1f}")
        pen = True
    return "".join(parts)


def svg(chart: Chart, least: float = 1e-3) -> str:
    """The chart as an <svg> element; `least` is the smallest span of the y axis, so that noise is not blown up."""
    height = 2 * HEIGHT if chart.square else chart.height
    box_w, box_h = WIDTH - LEFT - RIGHT, height - TOP - BOTTOM
    x0, x1 = _range([line.x for line in chart.lines], 1e-3 if not chart.square else least)
    y0, y1 = _range([line.y for line in chart.lines], least)
    if not chart.square:  # time axes begin and end with the data
        xs = np.concatenate([line.x for line in chart.lines])
        x0, x1 = float(xs.min()), float(max(xs.max(), xs.min() + 1e-3))
    else:
        scale = max((x1 - x0) / box_w, (y1 - y0) / box_h)
        x0, x1 = (x0 + x1 - scale * box_w) / 2, (x0 + x1 + scale * box_w) / 2
        y0, y1 = (y0 + y1 - scale * box_h) / 2, (y0 + y1 + scale * box_h) / 2

    def px(x):
        return LEFT + (np.asarray(x, dtype=float) - x0) / (x1 - x0) * box_w

    def py(y):
        share = (np.asarray(y, dtype=float) - y0) / (y1 - y0)
        return TOP + (share if chart.down else 1.0 - share) * box_h

    out = [f'<svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{escape(chart.title)}">']
    for band in chart.bands:
        a, b = float(px(max(band.first, x0))), float(px(min(band.last, x1)))
        if b > a:
            out.append(f'<rect class="{band.style}" x="{a:.1f}" y="{TOP}" width="{b - a:.1f}" height="{box_h}"/>')
    for value in ticks(y0, y1, 8 if chart.square else 5 if chart.height == HEIGHT else 3):
        y = float(py(value))
        out.append(f'<path class="grid" d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}"/>')
        out.append(f'<text class="tick" x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{label(value)}</text>')
    marks = ticks(x0, x1, 6)
    for n, value in enumerate(marks):
        x, text = float(px(value)), label(value) + (f" {chart.x_unit}" if n == len(marks) - 1 else "")
        out.append(f'<path class="notch" d="M{x:.1f} {TOP + box_h}v4"/>')
        # a long label at the right edge would be cut off in the middle
        x, anchor = (WIDTH - 1.0, "end") if x + 4.0 * len(text) > WIDTH else (x, "middle")
        at = f'x="{x:.1f}" y="{TOP + box_h + 18}" text-anchor="{anchor}"'
        out.append(f'<text class="tick" {at}>{escape(text)}</text>')
    for line in chart.lines:
        thin_x, thin_y = _thin(line)
        out.append(f'<path class="line {line.style}" d="{_path(px(thin_x), py(thin_y))}"/>')
    out.append(f'<path class="axis" d="M{LEFT} {TOP}V{TOP + box_h}H{WIDTH - RIGHT}"/>')
    return "".join([*out, "</svg>"])
