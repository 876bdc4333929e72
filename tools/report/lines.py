"""Lines of a recorded run and of what a model predicted of it, window by window, for charts."""

import numpy as np

from firmware.core.maths.rotations import wrap
from tools.inference.windows import START, Window
from tools.report.charts import Band, Line


def unwrapped(seen: np.ndarray) -> np.ndarray:
    """Measured angles (rows,) in rad without jumps of a turn; NaN stays."""
    seen, valid = seen.copy(), np.isfinite(seen)
    seen[valid] = np.unwrap(seen[valid])
    return seen


def near(t: np.ndarray, seen: np.ndarray, said: np.ndarray) -> np.ndarray:
    """Predicted angles (rows,) brought to the turn of the measured ones (already unwrapped) next to them."""
    valid = np.isfinite(seen)
    beside = np.interp(t, t[valid], seen[valid]) if valid.any() else np.zeros_like(t)
    return beside + wrap(said - beside)


def broken(x: np.ndarray, y: np.ndarray, listed: list[Window], style: str) -> Line:
    """A predicted line, which starts anew with each window."""
    begins = [window.first for window in listed[1:]]
    return Line(np.insert(x, begins, x[begins]), np.insert(y, begins, np.nan), style)


def bands(t: np.ndarray, listed: list[Window]) -> list[Band]:
    """The 2 s in which each window finds its start, and what is left unscored."""
    found = []
    for window in listed:
        first, last = t[window.first], t[window.end - 1]
        if window.scored:
            found.append(Band(first, min(first + START, last), "start"))
        else:
            found.append(Band(first, last, "unscored"))
    return found
