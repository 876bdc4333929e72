"""The gap between measured and predicted, channel by channel (docs/reference/gap.md, Measures)."""

from dataclasses import dataclass

import numpy as np

from glider.tools.data.runs.run import Run
from glider.tools.inference.channels import Channel, Measures, errors
from glider.tools.inference.windows import Window


@dataclass
class RunGap:
    """One run's gaps, in tolerances."""

    name: str
    channels: dict[str, float]
    total: float
    windows: int  # scored ones


def scored_rows(listed: list[Window], rows: int) -> np.ndarray:
    """Which rows of a run are scored, bool of shape (rows,)."""
    mask = np.zeros(rows, dtype=bool)
    for window in listed:
        if window.scored:
            mask[window.start : window.end] = True
    return mask


def mean_square(channel: Channel, error: np.ndarray) -> float:
    """Mean square of a channel's errors, NaN if there are none; a distance's components add up in each row."""
    if channel.joint:
        error = np.sqrt((error**2).sum(axis=1))
    valid = error[np.isfinite(error)]
    return float(np.mean(valid**2)) if valid.size else float("nan")


def run_gap(
    measures: Measures,
    run: Run,
    Y: np.ndarray,
    listed: list[Window],
    table: np.ndarray | None = None,
    only: np.ndarray | None = None,
) -> RunGap:
    """The gap of a run against its prediction Y (rows, N_Y). Channels without a scored sample are left out.

    `table` (rows, N_Y or more) stands in the place of what the run measured; only (rows,): rows that count.
    """
    rows, table = scored_rows(listed, run.rows), measures.measured(run) if table is None else table
    if only is not None:
        rows &= only
    squares = {
        channel.name: mean_square(channel, errors(channel, table, Y)[rows]) for channel in measures.channels_of(run)
    }
    gaps = {name: float(np.sqrt(value)) for name, value in squares.items() if np.isfinite(value)}
    return RunGap(run.name, gaps, root_mean_square(gaps.values()), sum(window.scored for window in listed))


def root_mean_square(values) -> float:
    """Root mean square of what is finite; NaN of nothing."""
    finite = np.array([value for value in values if np.isfinite(value)])
    return float(np.sqrt(np.mean(finite**2))) if finite.size else float("nan")


def case_channels(gaps: list[RunGap]) -> dict[str, float]:
    """Each channel's rms over the runs that have it, in the order of the runs that have most."""
    names = dict.fromkeys(name for gap in sorted(gaps, key=lambda gap: -len(gap.channels)) for name in gap.channels)
    return {name: root_mean_square([gap.channels[name] for gap in gaps if name in gap.channels]) for name in names}


def with_total(gaps: list[RunGap]) -> dict[str, float]:
    """The same with the `total` first."""
    return {"total": root_mean_square([gap.total for gap in gaps]), **case_channels(gaps)}
