"""Windows of a run: one after the other from the first sample, of which the first seconds find the start."""

from dataclasses import dataclass

import numpy as np

_ROUNDING = 1e-6  # s; a clock of 0.1 s steps does not hit 20 s to the last bit


@dataclass(frozen=True)
class Window:
    """Rows first .. end - 1 of a run; rows from `start` on are predicted without looking."""

    first: int
    start: int
    end: int
    scored: bool  # False: what is left at the run's end


def cut_windows(t: np.ndarray, length: float, look_in: float) -> list[Window]:
    """Windows of `length` s, the start in the first `look_in` s, of a run with samples at t (s, increasing).

    A window is whole if the samples reach its end less one sample interval: 200 samples at 10 Hz are 20 s. A run
    shorter than one window is one window.
    """
    interval = float(np.median(np.diff(t))) if len(t) > 1 else 0.0
    since = t - t[0]
    whole = int(np.floor((since[-1] + interval + _ROUNDING) / length))
    begins = np.arange(int(since[-1] // length) + 2) * length
    rows = np.searchsorted(since, np.array([0.0, look_in, length]) + begins[:, None] - _ROUNDING).tolist()
    return [Window(a, b, end, k < max(whole, 1)) for k, (a, b, end) in enumerate(rows) if a < end]
