"""Lines of a recorded run and of what a model predicted of it, window by window, for charts."""

import numpy as np

from glider.firmware.core.maths.rotations import wrap
from glider.tools.inference.windows import Window
from glider.tools.report.charts import Band, Chart, Curve


def broken(x: np.ndarray, y: np.ndarray, listed: list[Window], style: str) -> Curve:
    """A predicted line, which starts anew with each window."""
    begins = [window.first for window in listed[1:]]
    return Curve(np.insert(x, begins, x[begins]), np.insert(y, begins, np.nan), style)


def compared(
    t: np.ndarray, seen: np.ndarray, said: dict[str, np.ndarray], listed: list[Window], scale: float, wraps: bool
) -> list[Curve]:
    """Lines of a measured column (rows,) and of predictions of it by style, times `scale`.

    wraps: angles in rad; the measured ones run on without jumps of a turn, the predicted ones stand by those next to
    them. NaN stays.
    """
    if wraps:
        seen, valid = seen.copy(), np.isfinite(seen)
        seen[valid] = np.unwrap(seen[valid])
        beside = np.interp(t, t[valid], seen[valid]) if valid.any() else np.zeros_like(t)
        said = {style: beside + wrap(values - beside) for style, values in said.items()}
    return [
        Curve(t, seen * scale, "measured"),
        *(broken(t, values * scale, listed, style) for style, values in said.items()),
    ]


def plan_chart(table: np.ndarray, said: dict[str, np.ndarray], columns: tuple, listed: list[Window]) -> Chart:
    """The way over ground, measured (rows, columns) and predicted by style; columns: those of north and east."""
    north, east = columns
    lines = [Curve(table[:, east], table[:, north], "measured")]
    lines += [broken(Y[:, east], Y[:, north], listed, style) for style, Y in said.items()]
    return Chart("plan, north up, m", "east", lines, square=True)


def bands(t: np.ndarray, listed: list[Window]) -> list[Band]:
    """The seconds in which each window finds its start, and what is left unscored."""
    found = []
    for window in listed:
        first, last = t[window.first], t[window.end - 1]
        if window.scored:
            found.append(Band(first, t[min(window.start, window.end - 1)], "start"))
        else:
            found.append(Band(first, last, "unscored"))
    return found
