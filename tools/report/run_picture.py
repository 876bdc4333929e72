"""Values over runs in their order as inline SVG: points with 90 % intervals, spans of events, runs by name and date."""

from dataclasses import dataclass, field
from html import escape

import numpy as np

from glider.tools.report.charts import label, ticks

WIDTH, PLOT_HEIGHT = 620, 170
LEFT, RIGHT, TOP, BELOW, DATES = 56, 12, 12, 60, 18
LEAST_APART = 30.0  # px between two names under the axis
MOST_LETTERS = 12  # of a name there


@dataclass(frozen=True)
class Point:
    """A run's value, with its interval where it has one; `style` is a CSS class, `said` what a pointer shows."""

    value: float
    ci90: tuple[float, float] | None
    style: str
    said: str


@dataclass(frozen=True)
class Span:
    """Runs first to last of an event (by number), and its size over them where no run has its own."""

    first: int
    last: int
    value: float | None = None
    ci90: tuple[float, float] | None = None


@dataclass
class RunPicture:
    """A picture over runs: by run a point or None (nothing known), names under the axis, spans behind."""

    title: str
    names: list[tuple[str, str]]  # of each run, and its date ("" where that is not known)
    points: list[Point | None]
    spans: list[Span] = field(default_factory=list)


def svg_over_runs(picture: RunPicture) -> str:
    """The picture as an <svg> element."""
    count = len(picture.names)
    step = (WIDTH - LEFT - RIGHT) / max(count, 1)
    known = [v for one in picture.points if one is not None for v in (one.value, *(one.ci90 or ()))]
    known += [v for span in picture.spans if span.value is not None for v in (span.value, *(span.ci90 or ()))]
    finite = [v for v in known if np.isfinite(v)]
    low, high = min([0.0, *finite]), max([0.0, *finite])
    margin = 0.08 * (high - low) or 1.0
    low, high = (low if low == 0.0 else low - margin), high + margin

    def px(n: float) -> float:
        return LEFT + (n + 0.5) * step

    def py(value: float) -> float:
        return TOP + (high - value) / (high - low) * PLOT_HEIGHT

    height = TOP + PLOT_HEIGHT + BELOW + (DATES if any(date for _, date in picture.names) else 0)
    out = [f'<svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{escape(picture.title)}">']
    for span in picture.spans:
        x, wide = px(span.first - 0.5), (span.last - span.first + 1) * step
        out.append(f'<rect class="span" x="{x:.1f}" y="{TOP}" width="{wide:.1f}" height="{PLOT_HEIGHT}"/>')
        if span.value is not None:
            ends = span.ci90 or (span.value, span.value)
            top, bottom = py(max(ends)), py(min(ends))
            out.append(
                f'<rect class="size" x="{x:.1f}" y="{top:.1f}" width="{wide:.1f}" height="{max(bottom - top, 1):.1f}"/>'
            )
            out.append(f'<path class="line size-line" d="M{x:.1f} {py(span.value):.1f}h{wide:.1f}"/>')
    for value in ticks(low, high):
        y = py(float(value))
        out.append(f'<path class="grid" d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}"/>')
        out.append(f'<text class="tick" x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{label(value)}</text>')
    out.append(f'<path class="axis" d="M{LEFT} {py(0.0):.1f}H{WIDTH - RIGHT}"/>')
    for n, one in enumerate(picture.points):
        if one is None or not np.isfinite(one.value):
            continue
        bar = "" if one.ci90 is None else f'<path d="M{px(n):.1f} {py(one.ci90[0]):.1f}V{py(one.ci90[1]):.1f}"/>'
        dot = f'<circle cx="{px(n):.1f}" cy="{py(one.value):.1f}" r="4.5"/>'
        out.append(f'<g class="point {one.style}"><title>{escape(one.said)}</title>{bar}{dot}</g>')
    every = max(1, int(np.ceil(LEAST_APART / step)))
    for n in range(0, count, every):
        name, date = picture.names[n]
        x, y = px(n), TOP + PLOT_HEIGHT + 16
        written = name if len(name) <= MOST_LETTERS else f"{name[: MOST_LETTERS - 1]}\N{HORIZONTAL ELLIPSIS}"
        turned = f'transform="rotate(-40 {x:.1f} {y})" text-anchor="end"'
        out.append(f'<path class="notch" d="M{x:.1f} {TOP + PLOT_HEIGHT}v4"/>')
        out.append(f'<text class="tick" x="{x:.1f}" y="{y}" {turned}>{escape(written)}')
        out.append(f'<tspan x="{x:.1f}" dy="14">{escape(date)}</tspan></text>' if date else "</text>")
    return "".join([*out, "</svg>"])
