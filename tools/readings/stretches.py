"""Stretches of a run in which the vehicle does not fly: at the surface, lying still, hauled or handled.

They are left out of every comparison and said as findings. A vehicle at the surface moves on the waves and is held up
by what is out of the water; one on the bottom, in a net or against a wall does not move though it is commanded to; one
in somebody's hands turns faster than it can by itself.
"""

from dataclasses import replace

import numpy as np

from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run
from glider.tools.data.runs.sampling import own_period
from glider.tools.readings.findings import Finding

SPAN = 8.0  # s that a stretch lasts at least
SURFACE = 0.25  # m about the surface: a hull of a metre that is partly out of the water, and a gauge that is off
HIGHEST = -1.0  # m, of a depth at the surface
SURFACE_RANGE = 0.1  # m that the depth moves within SPAN there: waves, no dive
LEAST_SAID = 1.0  # s; a shorter end afloat is left out without a word
OUT, OUT_SPAN = 0.05, 0.5  # m, less than a hull's radius: partly out of the water; s before and after
MOST_OUT = 0.5  # of a run; more of it is a gauge that is far off
STILL_ANGLE, STILL_DEPTH = 0.004, 0.02  # rad, m: ranges within STILL_SPAN of a vehicle that lies on something
STILL_SPAN = 15.0  # s
HANDLED_RATE = 1.5  # rad/s; the fastest turns of gliders of this class are some 0.5 rad/s
HANDLED_SPEED = 1.5  # m/s up or down
HANDLED_SPAN = 3.0  # s that it goes on at least, with pauses of as much


def rolling_range(t: np.ndarray, values: np.ndarray, span: float) -> np.ndarray:
    """Range of the values over a span (s) about each row, (rows,); NaN where nothing was read."""
    period = float(np.median(np.diff(t))) if len(t) > 1 else span
    half = max(1, round(0.5 * span / period))
    padded = np.concatenate([np.full(half, np.nan), values, np.full(half, np.nan)])
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1)
    known = np.isfinite(windows).any(axis=1)
    out = np.full(len(values), np.nan)
    out[known] = np.nanmax(windows[known], axis=1) - np.nanmin(windows[known], axis=1)
    return out


def lasting(t: np.ndarray, state: np.ndarray, span: float) -> np.ndarray:
    """The state (bool, rows) where it lasts `span` s at least."""
    out = np.zeros(len(state), dtype=bool)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], state.astype(int), [0]])))
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if t[last - 1] - t[first] >= span:
            out[first:last] = True
    return out


def states(run: Run) -> dict[str, np.ndarray]:
    """Why the vehicle does not fly, by reason: bool of shape (rows,) each."""
    t, found = run.t, {}
    depth = run.columns.get(names.DEPTH, run.columns.get(names.MOCAP_POSITION[2]))
    attitude = [run.columns[name] for name in names.ATTITUDE if name in run.columns]
    if depth is not None and np.isfinite(depth).any():
        depth = between_samples(t, depth)
        found["afloat at the end"] = afloat_at_end(t, depth)
        shallow = depth < SURFACE + max(0.0, float(np.nanmin(depth)))
        surface = shallow & (rolling_range(t, depth, SPAN) < SURFACE_RANGE) & ~found["afloat at the end"]
        found["at the surface"] = lasting(t, surface, SPAN)
        still = rolling_range(t, depth, STILL_SPAN) < STILL_DEPTH
        for values in attitude:
            still &= rolling_range(t, np.unwrap(np.nan_to_num(values)), STILL_SPAN) < STILL_ANGLE
        found["lying still"] = lasting(t, still & ~found["at the surface"] & bool(attitude), STILL_SPAN)
        speed = np.abs(np.gradient(depth, t)) if len(t) > 1 else np.zeros(len(t))
        fast = np.nan_to_num(speed) > HANDLED_SPEED
    else:
        fast = np.zeros(len(t), dtype=bool)
    for values in attitude[:2]:
        if len(t) > 1:
            fast |= np.nan_to_num(np.abs(np.gradient(values, t))) > HANDLED_RATE
    found["handled or hauled"] = lasting(t, near(t, fast, 0.5 * HANDLED_SPAN), 2.0 * HANDLED_SPAN)
    return found


def between_samples(t: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values, interpolated in rows between samples of a sensor that is slower than the log; NaN in holes stays."""
    ok = np.isfinite(values)
    if ok.all() or ok.sum() < 2:
        return values
    return np.where(near(t, ok, own_period(t, values)), np.interp(t, t[ok], values[ok]), np.nan)


def afloat_at_end(t: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Rows, bool, behind the last at which the vehicle is deeper than its hull; none where it never dived.

    What of the hull is out of the water carries no model here, and with a light ballast it stands on its tail. Readings
    higher than a gauge's zero can be off (HIGHEST) are no surface.
    """
    deep = np.flatnonzero(depth >= SURFACE)
    tail = np.arange(len(t)) > (deep[-1] if len(deep) else len(t))
    return tail & (np.nanmin(depth[tail], initial=0.0) > HIGHEST)


def near(t: np.ndarray, state: np.ndarray, span: float) -> np.ndarray:
    """Rows within `span` s of a row in the state."""
    at = t[state]
    if not len(at):
        return state
    after = np.searchsorted(at, t)
    left = np.abs(t - at[np.maximum(after - 1, 0)])
    right = np.abs(at[np.minimum(after, len(at) - 1)] - t)
    return np.minimum(left, right) <= span


def flying(run: Run) -> np.ndarray:
    """Whether the vehicle flies, (rows,) bool."""
    found = states(run)
    return ~np.any(list(found.values()), axis=0) if found else np.ones(run.rows, dtype=bool)


def out_of_water(run: Run) -> np.ndarray:
    """Rows afloat at the end, and moments between two dives in which the gauge reads less than a hull's radius: bool of
    shape (rows,). None where the gauge has another zero."""
    t, nothing = run.t, np.zeros(run.rows, dtype=bool)
    depth = run.columns.get(names.DEPTH, np.full(run.rows, np.nan))
    seen = np.isfinite(depth)
    if not seen.any() or float(depth[seen].min()) < -SURFACE:
        return nothing
    afloat = afloat_at_end(t, between_samples(t, depth))
    found = near(t, np.interp(t, t[seen], depth[seen]) < OUT, OUT_SPAN)
    if found.mean() >= MOST_OUT or found.all():
        return afloat
    found[: first_dive(run)] = False
    return afloat | found & ~lasting(t, found, SPAN)


def first_dive(run: Run) -> int:
    """The first row that is deeper than a hull's radius; 0 where the gauge has another zero or nothing dives."""
    depth = run.columns.get(names.DEPTH, np.full(run.rows, np.nan))
    seen = np.isfinite(depth)
    if not seen.any() or float(depth[seen].min()) < -SURFACE:
        return 0
    out = near(run.t, np.interp(run.t, run.t[seen], depth[seen]) < OUT, OUT_SPAN)
    return 0 if out.mean() >= MOST_OUT else int(np.flatnonzero(~out)[0])


def under_water(run: Run) -> Run:
    """The run without what was measured out of the water: no model has the force of a hull that is partly out of it.

    What it measured in a moment at the surface between two dives is missing; rows behind the last under water are cut
    off. Before the first dive, and where it stays at the surface, the rows are as they were recorded: an observer
    without readings would know nothing of where the windows begin.
    """
    out = out_of_water(run)
    if not out.any() or out.all():
        return run
    columns = {
        name: values if name in (names.TIME, *names.COMMANDS) else np.where(out, np.nan, values)
        for name, values in run.columns.items()
    }
    end = int(np.flatnonzero(~out)[-1]) + 1
    if end == run.rows:
        return replace(run, columns=columns)
    return replace(run, columns={name: values[:end] for name, values in columns.items()}, extra={})


def since_dive(run: Run) -> Run:
    """The run from its first dive on, for a fit: what a floating hull does is in no model, and an observer that takes
    it for flight is led astray for as long as it lasts. Measures begin with the first sample all the same.
    """
    first = first_dive(run)
    if not first:
        return run
    return replace(run, columns={name: values[first:] for name, values in run.columns.items()}, extra={})


def judge_stretches(runs: list[Run]) -> list[Finding]:
    """One finding for every reason and run, of LEAST_SAID at least."""
    said = []
    for run in runs:
        for reason, state in states(run).items():
            if not state.any():
                continue
            period = float(np.median(np.diff(run.t)))
            seconds = float(state.sum() * period)
            if seconds < LEAST_SAID:
                continue
            first, last = run.t[state][0], run.t[state][-1]
            text = f"{run.name}: {reason} for {seconds:.0f} s between {first:.0f} and {last:.0f} s; left out."
            said.append(Finding("vehicle", "depth", "not_flying", seconds, (seconds, seconds), "s", None, True, text))
    return said
