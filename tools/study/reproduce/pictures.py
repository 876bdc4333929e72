"""The figures as pictures: time histories beside the error against noise, and the circle from above and in space."""

from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.data.files import whole
from glider.tools.study.reproduce import circle, tracking
from glider.tools.study.reproduce.design import Batch

COLOURS = {"law": "#1b5e9b", "hybrid": "#2a8f5b", "pid": "#c4572a", "pid_tuned": "#8c6bb1", "law+": "#444444"}
NAMES = {"law": "law", "hybrid": "hybrid", "pid": "PID by rule", "pid_tuned": "PID best-tuned", "law+": "law+"}


def _figure(**options: Any):
    from matplotlib.figure import Figure

    return Figure(layout="constrained", **options)


def _save(sheet: Any, path: Path) -> None:
    with whole(path) as (temporary,):
        sheet.savefig(temporary, format="png", dpi=110)


def tracking_picture(
    figure: tracking.TrackingFigure,
    rows: list[dict[str, Any]],
    shown: Batch,
    noise: float,
    marked: float | None,
    path: Path,
) -> None:
    """Flights of one seed against their references, and the mean error against the noise's strength, into a PNG."""
    assert shown.result is not None
    columns = (len(figure.targets) + 2) // 2
    sheet = _figure(figsize=(3.2 * columns, 6.4))
    axes = sheet.subplots(2, columns)
    column, reference = figure.trace, figure.trace.replace("true", "ref")
    time = shown.result.column("t")[0]
    for ax, target in zip(axes.flat, figure.targets, strict=False):
        for i, key in enumerate(shown.keys):
            if key["target"] != target:
                continue
            values = shown.result.column(column)[i] * figure.scale - figure.offset
            ax.plot(time, values, color=COLOURS[key["controller"]], lw=1.0, label=NAMES[key["controller"]])
            wanted = shown.result.column(reference)[i] * figure.scale - figure.offset
        ax.plot(time, wanted, "k--", lw=0.9, label="reference")
        ax.set_title(f"target {target:+g} {figure.unit}", fontsize=9)
        ax.tick_params(labelsize=7)
        if figure.unit == "m":
            ax.invert_yaxis()
    for ax in axes.flat[len(figure.targets) : -1]:
        ax.set_axis_off()
    error = axes.flat[-1]
    strengths = sorted({row["noise"] for row in rows})
    big = tracking.BIG if figure is tracking.FIG5 else tuple(t for t in figure.targets if t)
    for name, colour in COLOURS.items():
        means = [tracking.average(rows, name, s, big) for s in strengths]
        error.plot(strengths, means, "o-", ms=3, color=colour, label=NAMES[name])
    if marked is not None:
        error.axvline(marked, color="#999999", lw=0.8, ls=":")
        error.axhline(tracking.PAPER_PID_ERROR, color="#999999", lw=0.8, ls=":")
    error.set_xscale("symlog", linthresh=0.003)
    error.set_xlim(left=0.0)
    error.set_title("tracking error, % of target", fontsize=9)
    error.set_xlabel("noise, m/s2 and rad/s2", fontsize=8)
    error.tick_params(labelsize=7)
    error.legend(fontsize=6)
    sheet.suptitle(f"{figure.name}: noise {noise:g} in the flights shown", fontsize=10)
    _save(sheet, path)


def circle_picture(flown: circle.Circles, path: Path) -> None:
    """One flight for each strength, from above and in space, into a PNG."""
    strengths = np.unique(flown.strengths)
    sheet = _figure(figsize=(4.0 * len(strengths), 8.0))
    for n, strength in enumerate(strengths):
        i = int(np.flatnonzero(flown.strengths == strength)[0])
        north, east, down, leg = (flown.result.column(name)[i] for name in ("true_x", "true_y", "true_depth", "leg"))
        top = sheet.add_subplot(2, len(strengths), n + 1)
        space = sheet.add_subplot(2, len(strengths), len(strengths) + n + 1, projection="3d")
        for part, colour, name in (
            (leg < circle.CIRCLE_LEGS.start, "#999999", "entry"),
            ((leg >= circle.CIRCLE_LEGS.start) & (leg < circle.CIRCLE_LEGS.stop), COLOURS["law"], "circle"),
            (leg >= circle.CIRCLE_LEGS.stop, COLOURS["pid"], "S"),
        ):
            top.plot(east[part], north[part], color=colour, label=name)
            space.plot(east[part], north[part], down[part], color=colour)
        top.set_aspect("equal")
        top.set_title(f"noise {strength:g}: closes within {circle.closure(flown.result, i):.2f} m", fontsize=9)
        top.set_xlabel("east, m", fontsize=8)
        top.set_ylabel("north, m", fontsize=8)
        top.legend(fontsize=7)
        space.invert_zaxis()
        space.set_zlabel("depth, m", fontsize=8)
        for ax in (top, space):
            ax.tick_params(labelsize=7)
    _save(sheet, path)
