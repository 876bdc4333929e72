"""How often a sensor is read, which may be less often than a log has rows, and what is missing of that."""

import numpy as np

REGULAR_SHARE = 0.98  # of the intervals between samples that a regular sensor keeps
JITTER = 0.25  # of a row, by which a row's time may be off


def own_period(t: np.ndarray, values: np.ndarray) -> float:
    """The time between a sensor's samples where none is missing, s; NaN with fewer than two samples.

    A sample can stand in rows only, so that intervals differ by a row: 20 Hz in a log of 50 Hz has two rows and three
    in turn. Args: t (rows,) s, values (rows,) with NaN where nothing was read.
    """
    at = t[np.isfinite(values)]
    if len(at) < 2:
        return float("nan")
    row, between = float(np.median(np.diff(t))), np.diff(at)
    usual = float(np.median(between))
    longest = usual + (1.0 + JITTER) * row
    # Between one row and two, a slower sensor and lost samples look alike, but for the order in which they come.
    if usual < 1.5 * row and np.quantile(between, REGULAR_SHARE) > (2.0 + JITTER) * row:
        longest = 1.5 * row
    return float(between[between <= longest].mean())


def expected_samples(t: np.ndarray, values: np.ndarray) -> int:
    """How many samples a sensor would have at its own rate from the first row to the last; at least those it has."""
    there, period = int(np.isfinite(values).sum()), own_period(t, values)
    return len(t) if np.isnan(period) else max(there, min(len(t), round(float(t[-1] - t[0]) / period) + 1))


def missing_share(t: np.ndarray, values: np.ndarray) -> float:
    """The share of its own samples that a sensor lacks, 0 to 1."""
    return 1.0 - int(np.isfinite(values).sum()) / expected_samples(t, values)
