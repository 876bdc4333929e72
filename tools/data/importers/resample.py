"""From uneven samples to even rows: time that goes on, means, short gaps, angles that wrap, rates out of attitude."""

from bisect import bisect_left

import numpy as np

from glider.firmware.core.maths.rotations import wrap


def longest_increasing(t: np.ndarray) -> np.ndarray:
    """The rows of the longest course of times that go on, each later than the one before; t (rows,) without gaps.

    Leaves out the fewest rows, whichever way a damaged time is off: one far ahead costs itself, not all behind it.
    """
    if (np.diff(t) > 0.0).all():
        return np.arange(len(t))
    ends: list[float] = []  # the earliest time that a course of this length can end with, and the row it ends at
    rows: list[int] = []
    before = np.empty(len(t), dtype=np.int64)
    for row, moment in enumerate(t.tolist()):
        length = bisect_left(ends, moment)
        ends[length : length + 1], rows[length : length + 1] = [moment], [row]
        before[row] = rows[length - 1] if length else -1
    course = [rows[-1]]
    while before[course[-1]] >= 0:
        course.append(int(before[course[-1]]))
    return np.array(course[::-1])


def zero_order_hold(t: np.ndarray, values: np.ndarray, grid_s: np.ndarray) -> np.ndarray:
    """A command at the rows of `grid_s`: the last that was logged, at `t`, until then; NaN before the first."""
    known = np.isfinite(values)
    place = np.searchsorted(t[known], grid_s + 1e-9, side="right")
    return np.concatenate(([np.nan], values[known]))[place]


def bins_of(t: np.ndarray, start_s: float, rate_hz: float) -> np.ndarray:
    """The output row nearest in time to every sample (row k is at start_s + k / rate_hz), shape of `t`, int64.

    Row k takes what lies within half a period of its time; of a sample just between two, the rounding of its time
    decides.
    """
    return np.rint((t - start_s) / (1.0 / rate_hz)).astype(np.int64)


def means(values: np.ndarray, bins: np.ndarray, rows: int, angle: bool) -> np.ndarray:
    """Means of the samples of each bin, NaN where it has none, shape (rows,). Missing samples are passed over.

    The mean of an angle is taken around the bin's first sample, so that it is right across the jump at pi. It stays
    wrapped if the samples are.
    """
    use = (bins >= 0) & (bins < rows) & ~np.isnan(values)
    taken, place = values[use], bins[use]
    count = np.bincount(place, minlength=rows)
    first = np.zeros(rows)
    if angle:
        first[place[::-1]] = taken[::-1]
        total = np.bincount(place, wrap(taken - first[place]), minlength=rows)
    else:
        total = np.bincount(place, taken, minlength=rows)
    mean = np.full(rows, np.nan)
    there = count > 0
    mean[there] = first[there] + total[there] / count[there]
    return _as_the_samples(mean, taken) if angle else mean


def _as_the_samples(angle: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Wrapped where all samples are."""
    return wrap(angle) if samples.size and np.abs(samples).max() <= np.pi + 1e-9 else angle


def fill_gaps(
    mean: np.ndarray, grid_s: np.ndarray, t: np.ndarray, values: np.ndarray, max_gap_s: float, angle: bool
) -> np.ndarray:
    """`mean` with its empty rows interpolated, where the samples around them are max_gap_s apart at most."""
    there = ~np.isnan(values)
    if max_gap_s <= 0.0 or np.count_nonzero(there) < 2:
        return mean
    times, samples = t[there], values[there]
    after = np.clip(np.searchsorted(times, grid_s), 1, len(times) - 1)
    before = after - 1
    span = times[after] - times[before]
    share = (grid_s - times[before]) / span
    step = samples[after] - samples[before]
    between = samples[before] + share * (wrap(step) if angle else step)
    if angle:
        between = _as_the_samples(between, samples)
    use = np.isnan(mean) & (span <= max_gap_s) & (share >= 0.0) & (share <= 1.0)
    return np.where(use, between, mean)


def body_rates(t: np.ndarray, roll: np.ndarray, pitch: np.ndarray, yaw: np.ndarray) -> tuple[np.ndarray, ...]:
    """Body rates p, q, r, rad/s, by central differences of roll, pitch, yaw, rad; NaN beside missing samples.

    The kinematics of Z-Y-X Euler angles; no smoothing, so they are as rough as the angles are.
    """
    if len(t) < 2:
        return tuple(np.full(len(t), np.nan) for _ in range(3))
    roll_rate, pitch_rate, yaw_rate = (_derivative(t, angle) for angle in (roll, pitch, yaw))
    return (
        roll_rate - yaw_rate * np.sin(pitch),
        pitch_rate * np.cos(roll) + yaw_rate * np.cos(pitch) * np.sin(roll),
        -pitch_rate * np.sin(roll) + yaw_rate * np.cos(pitch) * np.cos(roll),
    )


def _derivative(t: np.ndarray, angle: np.ndarray) -> np.ndarray:
    continuous = angle.copy()
    there = ~np.isnan(angle)
    continuous[there] = np.unwrap(angle[there])
    return np.gradient(continuous, t)
