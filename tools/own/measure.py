"""The gap of a user's vehicle per run and channel, and a run predicted window by window."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.data.runs import csvfile
from glider.tools.data.runs.columns import TIME
from glider.tools.own.load import LoadedVehicle
from glider.tools.own.observers import observer_of
from glider.tools.own.runs import OwnRun


def channel_rms(table: np.ndarray) -> np.ndarray:
    """Root mean square of every column of a table (rows, outputs): (outputs,), NaN where nothing was measured."""
    read, found = np.isfinite(table).any(axis=0), np.full(table.shape[1], np.nan)
    found[read] = np.sqrt(np.nanmean(table[:, read] ** 2, axis=0))
    return found


def total_rms(table: np.ndarray) -> float:
    """Root mean square of all that was measured."""
    return float(np.sqrt(np.nanmean(table**2)))


def gap_row(names: Sequence[str], table: np.ndarray) -> dict[str, float | None]:
    """Gaps by channel, and total, of a table (runs, outputs)."""
    by = [float(one) if np.isfinite(one) else None for one in channel_rms(table)]
    return {**dict(zip(names, by, strict=True)), "total": total_rms(table)}


def measure(vehicle: LoadedVehicle, runs: Sequence[OwnRun]) -> dict[str, Any]:
    """Gaps in tolerances: per run, over all, and the share of the squared gap of each channel."""
    observer = observer_of(vehicle, runs, every_row=True)
    names = [one.name for one in observer.declared.outputs]
    table = np.array([observer.gaps(n, observer.point, observer.horizon) for n in range(len(runs))])

    def row(values: np.ndarray) -> dict[str, float]:
        return {name: float(value) for name, value in zip(names, values, strict=True) if np.isfinite(value)}

    every = channel_rms(table)
    seen = np.isfinite(every)
    shares = every[seen] ** 2 / max(float((every[seen] ** 2).sum()), 1e-300)
    return {
        "format": 1, "vehicle": vehicle.name, "horizon_s": observer.horizon,
        "runs": [{"run": run.name, "channels": row(values), "total": total_rms(values)}
                 for run, values in zip(runs, table, strict=True)],
        "channels": row(every), "total": total_rms(table),
        "where": [{"subsystem": "output", "element": name, "share": float(share)}
                  for name, share in zip(np.array(names)[seen], shares, strict=True)],
        "tolerances": row(observer.tolerances), "notes": list(observer.notes),
    }  # fmt: skip


def predict(vehicle: LoadedVehicle, run: OwnRun, out: Path) -> int:
    """A run predicted window by window into a CSV with its rows and columns; the rows that were written."""
    observer = observer_of(vehicle, [run], every_row=True)
    predicted = observer.predicted(0)
    texts = {TIME: csvfile.as_texts(TIME, run.t, None)}
    for n, one in enumerate(observer.declared.inputs):
        texts[one.column] = csvfile.as_texts(one.column, run.inputs[:, n], None)
    for n, output in enumerate(observer.declared.outputs):
        texts[output.column] = csvfile.as_texts(output.column, predicted[:, n], None)
    csvfile.write_table(out, texts)
    return len(run.t)
