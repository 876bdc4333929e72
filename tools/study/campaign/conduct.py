"""A campaign from plan to results: what is already there is read, the rest is flown, kept as it comes, added up."""

import contextlib
import csv
import io
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from glider.tools.data.files import write_bytes
from glider.tools.study.campaign.fingerprint import fingerprint
from glider.tools.study.campaign.flights import CHUNK, COLUMNS, ENDINGS, FlightJob, compile_loop, cut, fly_chunk
from glider.tools.study.campaign.plan import CampaignPlan
from glider.tools.study.campaign.store import Store
from glider.tools.study.workers import check_reachable, work_through

FLIGHTS_FILE = "flights.csv"


@dataclass
class FlownChunk:
    """All flights of a campaign."""

    plan: CampaignPlan
    table: np.ndarray  # (flights, len(COLUMNS)), in the order mission, seed, controller
    fresh: int  # flights flown now; the others were there
    seconds: float  # that those took

    def column(self, name: str) -> np.ndarray:
        """One column of the table by its name in COLUMNS, shape (flights,)."""
        return self.table[:, COLUMNS.index(name)]


def fly_campaign(
    plan: CampaignPlan,
    folder: Path | None = None,
    *,
    jobs: int = 0,
    dask: str | None = None,
    chunk: int = CHUNK,
    advance: Callable[[int], None] = lambda flights: None,
) -> FlownChunk:
    """Fly what is not yet in the folder (None: keep nothing); advance(n) is called with the flights as they are done.

    jobs: processes, 0 for one a core; dask: address of a scheduler, which then gets the same chunks instead. The
    result does not depend on any of them.
    """
    if dask:
        check_reachable(dask)
    job = FlightJob(plan, fingerprint(plan))
    store = None if folder is None else Store(folder, plan, job.fingerprint, chunk)
    chunks = cut(plan, chunk if store is None else store.chunk)
    rows: dict[int, np.ndarray] = {}
    for piece in chunks:
        found = None if store is None else store.read(piece, len(plan.campaign.controllers))
        if found is not None:
            rows[piece.number] = found
            advance(len(found))
    missing = [piece for piece in chunks if piece.number not in rows]
    fresh, begin = 0, time.perf_counter()
    if missing:
        if not dask and jobs != 1:
            compile_loop(plan)  # before several processes do
        with contextlib.closing(work_through(partial(fly_chunk, job), missing, jobs, dask)) as flown:
            for piece, table in flown:
                if store is not None:
                    store.keep(piece, table)
                rows[piece.number] = table
                fresh += len(table)
                advance(len(table))
    return FlownChunk(plan, np.concatenate([rows[n] for n in range(len(chunks))]), fresh, time.perf_counter() - begin)


def write_flights(path: Path, flown: FlownChunk) -> None:
    """All flights as CSV, one line each, with names where the table has numbers."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in flown.table.tolist():
        values = dict(zip(COLUMNS, row, strict=True))
        values["mission"] = flown.plan.missions[int(values["mission"])].name
        values["controller"] = flown.plan.campaign.controllers[int(values["controller"])]
        values["ended"] = ENDINGS[values["ended"]]
        for name in ("seed", "completed", "within_limits", "leg"):
            values[name] = int(values[name])
        values["leg"] += 1  # legs count from 1 to a reader
        writer.writerow("" if value != value else value for value in values.values())
    write_bytes(path, text.getvalue().encode())
