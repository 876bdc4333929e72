"""A segment of an ocean glider's mission on its way to a run: one dive, or what lies between two surfacings."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from glider.tools.data.errors import InputError
from glider.tools.data.importers.resample import fill_gaps, longest_increasing

DAY = 86400.0
LONGEST_S = 7 * DAY  # of one segment or dive: the longest of years at sea stay under two days
FIRST_TIME = 788_918_400.0  # 1995-01-01: no glider logged before
OUT_OF_WATER_DBAR = 0.3  # a sensor this near to the surface is in air, foam or the vehicle's own wake
# What an instrument in the sea can have measured, in SI (pressure dbar, conductivity S/m).
PLAUSIBLE = {
    "pitch_rad": (-0.5 * np.pi, 0.5 * np.pi), "roll_rad": (-np.pi, np.pi), "yaw_rad": (-2.0 * np.pi, 4.0 * np.pi),
    "depth_m": (-5.0, 7000.0), "oil_m3": (-2e-3, 2e-3), "pump": (0.0, 1.0), "speed_m_s": (0.0, 5.0),
    "vn_m_s": (-5.0, 5.0), "ve_m_s": (-5.0, 5.0), "battery_m": (-0.5, 0.5), "fin_rad": (-1.6, 1.6),
    "temperature": (-3.0, 45.0), "conductivity": (1e-3, 9.0), "salinity": (0.0, 45.0), "pressure": (-10.0, 7000.0),
}  # fmt: skip
# A sample is a spike where it stands off both its neighbours, to the same side, by more than a + b dt.
SPIKES = {
    "depth_m": (2.0, 1.5), "pressure": (2.0, 1.5), "temperature": (5.0, 0.0), "conductivity": (0.5, 0.0),
    "salinity": (5.0, 0.0),
}  # fmt: skip


@dataclass
class Segment:
    """Rows of one dive or segment, the vehicle's own, and what of its files is not among them."""

    files: list[Path]
    glider: str  # which one, as its files say
    start: float  # of the first row, s since 1970-01-01 UTC
    columns: dict[str, np.ndarray]  # as run data (docs/reference/runs.md), t_s from the first row
    latitude: float  # deg
    longitude: float  # deg
    variation: float = 0.0  # magnetic, rad, still to be added to yaw_rad; 0 where it is known to be in
    left_out: dict[str, int] = field(default_factory=dict)  # samples by the reason why
    notes: list[str] = field(default_factory=list)
    # At the surface, before and behind it: (n, 3) s since 1970-01-01 UTC, latitude, longitude, deg
    fixes: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))

    @property
    def end(self) -> float:
        """Time of the last row, s since 1970-01-01 UTC."""
        return self.start + float(self.columns["t_s"][-1])


def usable_fixes(t: np.ndarray, latitude: np.ndarray, longitude: np.ndarray) -> np.ndarray:
    """Fixes (n, 3) as a Segment has them, in order, of those on earth and in the age of GPS gliders."""
    there = np.isfinite(t) & (np.abs(latitude) <= 90.0) & (np.abs(longitude) <= 360.0) & (t >= FIRST_TIME)
    there &= (latitude != 0.0) | (longitude != 0.0)
    found = np.column_stack([t, latitude, longitude])[there]
    return found[np.argsort(found[:, 0], kind="stable")]


def count(left_out: dict[str, int], reason: str, samples: int | np.integer) -> None:
    """Add to what was left out."""
    if samples:
        left_out[reason] = left_out.get(reason, 0) + int(samples)


def in_the_mission(t: np.ndarray, left_out: dict[str, int], which: str = "") -> np.ndarray:
    """The rows of a log whose times belong to its mission and go on; t s since 1970, NaN where it has none.

    Taken out are rows without a time, more than LONGEST_S from the median of the log's times, before FIRST_TIME, and
    the fewest that make the rest go on. `which` stands before the reason in left_out.
    """
    timed = np.flatnonzero(np.isfinite(t))
    count(left_out, f"{which}without a time", len(t) - len(timed))
    possible = timed[t[timed] > FIRST_TIME]
    middle = np.median(t[possible]) if possible.size else np.nan
    inside = possible[np.abs(t[possible] - middle) <= LONGEST_S]
    count(left_out, f"{which}at a time outside the mission", len(timed) - len(inside))
    kept = inside[longest_increasing(t[inside])] if inside.size else inside
    count(left_out, f"{which}whose time does not go on", len(inside) - len(kept))
    return kept


def clean(name: str, t: np.ndarray, values: np.ndarray, left_out: dict[str, int]) -> np.ndarray:
    """Values with NaN where they cannot be (PLAUSIBLE) or are spikes (SPIKES); counted."""
    low, high = PLAUSIBLE[name]
    found = np.where((values >= low) & (values <= high), values, np.nan)
    count(left_out, f"{name} outside {low:.4g} to {high:.4g}", np.count_nonzero(np.isfinite(values) & np.isnan(found)))
    if name in SPIKES:
        spikes = _spikes(t, found, *SPIKES[name])
        count(left_out, f"spike of {name}", len(spikes))
        found[spikes] = np.nan
    return found


def _spikes(t: np.ndarray, values: np.ndarray, step: float, rate: float) -> np.ndarray:
    there = np.flatnonzero(np.isfinite(values))
    if len(there) < 3:
        return there[:0]
    allowed = step + rate * np.diff(t[there])
    steps = np.diff(values[there])
    before, after = steps[:-1] / allowed[:-1], -steps[1:] / allowed[1:]
    return there[1:-1][(np.minimum(before, after) > 1.0) | (np.maximum(before, after) < -1.0)]


def at_rows(t: np.ndarray, values: np.ndarray, rows_t: np.ndarray, hole_s: float) -> np.ndarray:
    """Samples at the times of rows: the sample of that very time, or interpolated over holes of at most hole_s."""
    there = np.isfinite(values)
    t, values = t[there], values[there]
    found = np.full(len(rows_t), np.nan)
    if not len(t):
        return found
    place = np.minimum(np.searchsorted(t, rows_t), len(t) - 1)
    same = t[place] == rows_t
    found[same] = values[place[same]]
    return fill_gaps(found, rows_t, t, values, hole_s, angle=False)


def clock_offset(t: np.ndarray, depth: np.ndarray, other_t: np.ndarray, other: np.ndarray) -> float | None:
    """Seconds to add to the other computer's clock so that both depths agree best; None where they do not say.

    Least squares of the difference (less its mean) over shifts of up to 300 s, a parabola about the best. It says
    something where the vehicle moved through 20 m at least and the best shift halves the scatter of no shift.
    """
    use, of_other = np.isfinite(depth), np.isfinite(other)
    if np.count_nonzero(use) < 20 or np.count_nonzero(of_other) < 20 or np.ptp(depth[use]) < 20.0:
        return None
    shifts = np.arange(-300.0, 301.0, 2.0)
    scatter = np.array([_scatter(t[use], depth[use], other_t[of_other] + s, other[of_other]) for s in shifts])
    best = int(np.argmin(scatter))
    unmoved = scatter[len(shifts) // 2]
    if not 0 < best < len(shifts) - 1 or not scatter[best] < 0.25 * unmoved < np.inf:
        return None
    low, middle, high = scatter[best - 1 : best + 2]
    return float(shifts[best] + (low - high) / (low - 2.0 * middle + high))


def _scatter(t: np.ndarray, depth: np.ndarray, other_t: np.ndarray, other: np.ndarray) -> float:
    there = (t >= other_t[0]) & (t <= other_t[-1])
    if np.count_nonzero(there) < 0.5 * len(t):
        return np.inf
    return float(np.var(np.interp(t[there], other_t, other) - depth[there]))


def require_same_time(t: np.ndarray, path: Path, other_t: np.ndarray, other: Path) -> None:
    """InputError where two files of a segment have no time in common; t s, either may be empty."""
    if len(t) and len(other_t) and (t[-1] < other_t[0] or t[0] > other_t[-1]):
        raise InputError(f"no time in common with {other}: not of the same segment", source=path)


def require_unit(found: str | None, allowed: dict[str, float], path: Path, variable: str) -> float:
    """The factor to SI (dbar, S/m) of a unit as the file spells it; InputError where it is another one, or none."""
    factor = allowed.get((found or "").strip())
    if factor is None:
        wanted = " or ".join(dict.fromkeys(name or "none" for name in list(allowed)[:3]))
        raise InputError(f"unit {found!r}, expected {wanted}", source=path, column=variable)
    return factor
