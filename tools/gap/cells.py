"""Every scored sample of a case in one long vector, weighed so that the sum of squares is the squared total gap."""

from dataclasses import dataclass

import numpy as np

from glider.firmware.core.maths.rotations import wrap
from glider.tools.data.runs.run import Run
from glider.tools.inference.channels import Measures
from glider.tools.inference.windows import Window


@dataclass
class Cells:
    """Scored samples; a cell is what one channel scores in one window."""

    names: list[str]  # of the channels
    rows: np.ndarray  # (samples,) in the recording's table
    columns: np.ndarray  # (samples,) of the prediction
    scale: np.ndarray  # (samples,) tolerance
    wrapped: np.ndarray  # (samples,) bool
    share: np.ndarray  # (samples,) weight in the squared gap of the case
    channel: np.ndarray  # (samples,) index into `names`
    cell: np.ndarray  # (samples,) which cell it belongs to

    def residual(self, table: np.ndarray, Y: np.ndarray) -> np.ndarray:
        """(table - Y) / tolerance at the scored samples; both (rows, N_Y)."""
        difference = table[self.rows, self.columns] - Y[self.rows, self.columns]
        return np.where(self.wrapped, wrap(difference), difference) / self.scale

    def squared_gap(self, residual: np.ndarray) -> float:
        """Squared total gap of the case."""
        return float(self.share @ residual**2)

    def cell_sizes(self) -> np.ndarray:
        """How many samples each sample's cell holds, (samples,)."""
        return np.bincount(self.cell)[self.cell]


def cells_of(
    measures: Measures, runs: list[Run], bounds: np.ndarray, listed: list[list[Window]], table: np.ndarray
) -> Cells:
    """The scored samples of a case's runs by their windows; bounds (runs + 1,) in the table (rows, N_Y) of what was
    measured."""
    scored = []
    for n, run in enumerate(runs):
        begin, of_run = bounds[n], []
        for channel in measures.channels_of(run):
            found = []
            for w, window in enumerate(listed[n]):
                block = table[begin + window.start : begin + window.end][:, list(channel.columns)]
                at, column = np.nonzero(np.isfinite(block) & window.scored)
                found.append((begin + window.start + at, np.array(channel.columns)[column], np.full(len(at), w)))
            rows, columns, windows = (np.concatenate(part) for part in zip(*found, strict=True))
            if len(rows):
                of_run.append((channel, rows, columns, windows))
        if of_run:
            scored.append(of_run)
    names: list[str] = []
    parts: list[tuple[np.ndarray, ...]] = []
    cell = 0
    for of_run in scored:
        for channel, rows, columns, windows in of_run:
            if channel.name not in names:
                names.append(channel.name)
            count = len(rows) / (len(channel.columns) if channel.joint else 1)
            _, within = np.unique(windows, return_inverse=True)
            share = 1.0 / (count * len(of_run) * len(scored))
            common = (channel.tolerance, channel.wrapped, share, names.index(channel.name))
            parts.append((rows, columns, *(np.full(len(rows), value) for value in common), cell + within))
            cell += int(within.max()) + 1
    return Cells(names, *(np.concatenate(part) for part in zip(*parts, strict=True)))
