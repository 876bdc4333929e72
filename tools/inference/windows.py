"""Windows of a run: 20 s, one after the other from the first sample, of which the first 2 s find the start."""

from dataclasses import dataclass

import numpy as np

WINDOW = 20.0  # s
START = 2.0  # s
_ROUNDING = 1e-6  # s; a clock of 0.1 s steps does not hit 20 s to the last bit


@dataclass(frozen=True)
class Window:
    """Rows first .. end - 1 of a run; rows from `start` on are predicted without looking."""

    first: int
    start: int
    end: int
    scored: bool  # False: what is left at the run's end


def windows(t: np.ndarray) -> list[Window]:
    """Windows of a run with samples at t (s, increasing). A run shorter than one window is one window.

    A window is whole if the samples reach its end less one sample interval: 200 samples at 10 Hz are 20 s.
    """
    interval = float(np.median(np.diff(t))) if len(t) > 1 else 0.0
    since = t - t[0]
    whole = int(np.floor((since[-1] + interval + _ROUNDING) / WINDOW))
    found = []
    for k in range(int(since[-1] // WINDOW) + 2):
        first, start, end = np.searchsorted(since, np.array([0.0, START, WINDOW]) + k * WINDOW - _ROUNDING)
        if first < end:
            found.append(Window(int(first), int(start), int(end), k < max(whole, 1)))
    return found
