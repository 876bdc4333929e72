"""One run: named columns of float64, NaN where a sample is missing, and the columns nobody here knows, as text."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from glider.tools.data.runs import columns as names
from glider.tools.data.runs import csvfile


@dataclass
class Run:
    """A recorded flight. `columns` holds only what was recorded, all of one length, in the file's order."""

    name: str  # "run00"
    path: Path | None
    columns: dict[str, np.ndarray]  # float64, SI, NaN = missing sample
    extra: dict[str, list[str]] = field(default_factory=dict)  # unknown columns, as they stood
    source: str = ""  # name of the log or recording that it was made of
    start_utc: str = ""  # when it began, ISO 8601; empty where nobody knows

    @property
    def t(self) -> np.ndarray:
        """Time since the start of the run, onboard clock, s; strictly increasing, never missing."""
        return self.columns[names.TIME]

    @property
    def flight(self) -> str:
        """'w06.mcap, 2026-11-20': of which flight it is, as far as that is known."""
        return ", ".join(part for part in (self.source, self.start_utc[:10]) if part)

    @property
    def rows(self) -> int:
        return len(self.t)

    def has(self, *wanted: str) -> bool:
        """Whether every one of these columns was recorded."""
        return all(name in self.columns for name in wanted)

    @property
    def has_commands(self) -> bool:
        """All three commands are there."""
        return self.has(*names.COMMANDS)

    @property
    def has_mocap(self) -> bool:
        """Motion capture's position is there (its attitude may still be missing: ask `has`)."""
        return self.has(*names.MOCAP_POSITION)


def run_name(path: Path) -> str:
    """`.../run00.csv.gz` -> 'run00'."""
    return path.name.removesuffix(".gz").removesuffix(".csv")


def load_run(path: Path | str) -> Run:
    """A run from its CSV (or .csv.gz); InputError with file, line and column where it cannot be used."""
    path = Path(path)
    table = csvfile.read_table(path)
    numbers: dict[str, np.ndarray] = {}
    extra: dict[str, list[str]] = {}
    if names.TIME not in table.header:
        raise table.error("the column is missing", column=names.TIME)
    for name in table.header:
        if name in names.KNOWN:
            numbers[name] = table.numbers(name)
        else:
            extra[name] = table.texts(name)
    table.require_increasing(names.TIME, numbers[names.TIME])
    return Run(name=run_name(path), path=path, columns=numbers, extra=extra)


def write_run(path: Path | str, run: Run, *, decimals: dict[str, int] | None = None) -> None:
    """Write a run as CSV, gzipped where the name ends in .gz; whole or not at all.

    Lossless (the shortest text that reads back as the same float64; an empty field for NaN) except for the columns
    that `decimals` names, which are rounded to so many places. ValueError for infinite values, for columns of unequal
    length and for a name that stands twice: those are the caller's mistakes.
    """
    texts: dict[str, list[str]] = {}
    for name, values in run.columns.items():
        places = None if decimals is None else decimals.get(name)
        texts[name] = csvfile.as_texts(name, values, places)
    for name, words in run.extra.items():
        if name in texts:
            raise ValueError(f"{run.name}: column {name} stands twice")
        texts[name] = list(words)
    csvfile.write_table(Path(path), texts)
