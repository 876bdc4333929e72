"""Cases, runs and onboard logs of the API."""

import importlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from glider.tools.api.result import EXTRA, Result, read_only
from glider.tools.data.errors import InputError, need
from glider.tools.data.first_vehicle import in_words
from glider.tools.data.log.reader import Log as RecordedLog
from glider.tools.data.runs import case as cases
from glider.tools.data.runs import columns as names
from glider.tools.data.runs import overview
from glider.tools.data.runs.run import Run as RecordedRun

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame
    from xarray import Dataset


@dataclass(frozen=True)
class Run(Result):
    """A recorded or simulated flight: columns of equal length, SI units, NaN where a sample is missing.

    Examples
    --------
    >>> import glider
    >>> run = glider.simulate("spiral", seed=1)[0]
    >>> run.name, run["depth_m"].shape == run.t.shape
    ('run00', True)
    """

    _run: RecordedRun = field(repr=False)

    @property
    def name(self) -> str:
        """Name of the run, such as `run00`."""
        return self._run.name

    @property
    def flight(self) -> str:
        """Log and date of the flight, where they are known."""
        return self._run.flight

    @property
    def t(self) -> np.ndarray:
        """Time since the start of the run, s, shape (rows,)."""
        return read_only(self._run.t)

    @property
    def columns(self) -> Mapping[str, np.ndarray]:
        """Recorded columns by name, each float64 of shape (rows,), read-only."""
        return MappingProxyType({name: read_only(values) for name, values in self._run.columns.items()})

    def __getitem__(self, column: str) -> np.ndarray:
        return read_only(self._run.columns[column])

    def _lines(self) -> list[str]:
        return overview.lines([self._run])

    def _columns(self) -> dict[str, list[Any]]:
        return {name: values.tolist() for name, values in self._run.columns.items()}

    def to_pandas(self) -> "DataFrame":
        """Return the columns, indexed by `t_s`.

        Returns
        -------
        pandas.DataFrame
        """
        return super().to_pandas().set_index(names.TIME)

    def to_xarray(self) -> "Dataset":
        """Return the columns along the coordinate `t_s`, each with its unit as an attribute.

        Returns
        -------
        xarray.Dataset
        """
        need(EXTRA, "xarray")
        units = {one.name: one.unit for one in overview.overview([self._run])}
        columns = {
            name: (names.TIME, values.copy(), {"units": units[name]})
            for name, values in self._run.columns.items()
            if name != names.TIME
        }
        dataset = importlib.import_module("xarray").Dataset(columns, coords={names.TIME: self._run.t.copy()})
        return dataset.assign_attrs(run=self.name, flight=self.flight)

    def _draw(self, ax: "Axes") -> None:
        _draw_depth(ax, [self._run])


@dataclass(frozen=True)
class Case(Result):
    """Runs of one vehicle at one site (docs/reference/runs.md); a sequence of runs.

    Examples
    --------
    >>> import glider
    >>> case = glider.simulate(["spiral", "spiral"], effects={"drag": {"scale": 0.3}}, seed=1)
    >>> len(case), case.vehicle, [run.name for run in case[1:]]
    (2, 'roughie', ['run01'])
    """

    _case: cases.Case = field(repr=False)
    notes: tuple[str, ...] = ()  # what a person should know of its making
    _vehicle_text: str | None = field(default=None, repr=False)  # its file's, unless it is a shipped one

    @property
    def vehicle(self) -> str:
        """Shipped name of the vehicle, or path of its file."""
        return self._case.vehicle_name

    @property
    def site(self) -> str:
        """Name of the site."""
        return self._case.site

    @property
    def log_rate_hz(self) -> float:
        """Rows a second, Hz."""
        return self._case.log_rate_hz

    @property
    def runs(self) -> tuple[Run, ...]:
        """The runs, in their order."""
        return tuple(Run(one) for one in self._case.runs)

    def __len__(self) -> int:
        return len(self._case.runs)

    def __iter__(self) -> Iterator[Run]:
        return iter(self.runs)

    @overload
    def __getitem__(self, which: int | str) -> Run: ...
    @overload
    def __getitem__(self, which: slice) -> "Case": ...
    def __getitem__(self, which: int | str | slice) -> "Run | Case":
        """A run by its number or name; a slice of runs is a case."""
        if isinstance(which, slice):
            chosen = self._case.runs[which]
            if not chosen:
                raise InputError(f"no run in {which.start}:{which.stop}", source=self._case.folder)
            return replace(self, _case=replace(self._case, runs=chosen))
        if isinstance(which, str):
            found = next((one for one in self._case.runs if one.name == which), None)
            if found is None:
                raise KeyError(which)
            return Run(found)
        return Run(self._case.runs[which])

    def save(self, folder: Path | str) -> list[Path]:
        """Write the case into a new folder, from which `load_case` and every command read it.

        Parameters
        ----------
        folder : path
            Folder that holds no case yet.

        Returns
        -------
        list of pathlib.Path
            The run files.

        Raises
        ------
        InputError
            If the folder already holds a case.
        """
        case = self._case
        return cases.write_case(
            folder, case.runs, vehicle=case.vehicle_name, vehicle_text=self._vehicle_text, site=case.site,
            log_rate_hz=case.log_rate_hz, water_density_kg_m3=case.water_density_kg_m3,
            motion_capture=case.motion_capture, sensors=case.sensors, disturbance=case.disturbance,
        )  # fmt: skip

    def _lines(self) -> list[str]:
        assumed = in_words(self._case.assumed)
        notes = [*self.notes, *([f"{self.vehicle} has assumed numbers ({assumed})"] if assumed else [])]
        return [*overview.lines(self._case.runs), *(f"note: {one}" for one in notes)]

    def _columns(self) -> dict[str, list[Any]]:
        found = overview.overview(self._case.runs)
        return {
            "column": [one.name for one in found], "unit": [one.unit for one in found],
            "smallest": [one.smallest for one in found], "largest": [one.largest for one in found],
            "missing_percent": [one.missing_percent for one in found],
        }  # fmt: skip

    def to_pandas(self) -> "DataFrame":
        """Return all rows of all runs, indexed by run and `t_s`.

        Returns
        -------
        pandas.DataFrame
        """
        need(EXTRA, "pandas")
        parts = {run.name: run.to_pandas() for run in self.runs}
        return importlib.import_module("pandas").concat(parts, names=["run"])

    def to_xarray(self) -> "Dataset":
        """Return all rows of all runs along one dimension, `row`, with coordinates `run` and `t_s`.

        Returns
        -------
        xarray.Dataset
        """
        need(EXTRA, "xarray")
        listed = overview.overview(self._case.runs)
        missing = {run.name: np.full(run.rows, np.nan) for run in self._case.runs}
        columns = {
            one.name: (
                "row",
                np.concatenate([run.columns.get(one.name, missing[run.name]) for run in self._case.runs]),
                {"units": one.unit},
            )
            for one in listed
        }
        run_names = np.concatenate([np.full(run.rows, run.name) for run in self._case.runs])
        coordinates = {"run": ("row", run_names), names.TIME: columns.pop(names.TIME)}
        return importlib.import_module("xarray").Dataset(columns, coords=coordinates)

    def _draw(self, ax: "Axes") -> None:
        _draw_depth(ax, self._case.runs)


def _draw_depth(ax: "Axes", runs: list[RecordedRun]) -> None:
    """Depth of every run over its time, down positive."""
    for run in runs:
        if run.has(names.DEPTH):
            ax.plot(run.t, run.columns[names.DEPTH], label=run.name)
    ax.set_xlabel("time, s")
    ax.set_ylabel("depth, m")
    if not ax.yaxis_inverted():
        ax.invert_yaxis()
    if len(runs) <= 10:
        ax.legend()


@dataclass(frozen=True)
class Log(Result):
    """An onboard log (docs/reference/log.md): complete, or what is readable of a cut one."""

    _log: RecordedLog = field(repr=False)
    run: Run = field(repr=False)
    notes: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether the log was closed by its writer and holds no damaged record."""
        return self._log.whole

    @property
    def duration_s(self) -> float:
        """Time from the first record to the last, s."""
        return self._log.duration_s

    @property
    def metadata(self) -> Mapping[str, str]:
        """What the log says of itself."""
        return MappingProxyType({**self._log.metadata, **self._log.ending})

    @property
    def events(self) -> tuple[tuple[float, str], ...]:
        """Events with their times, s."""
        return tuple((event.time_s, event.text) for event in self._log.events)

    def to_case(self, vehicle: str | None = None) -> Case:
        """Return the log's run as a case.

        Parameters
        ----------
        vehicle : str, optional
            Shipped vehicle or vehicle file in place of the one in the log.

        Returns
        -------
        Case
        """
        return case_of_logs([self._log], vehicle=vehicle)

    def _lines(self) -> list[str]:
        log = self._log
        state = "complete" if log.whole else f"readable up to byte {log.end} of {log.size}"
        topics = [f"  {name}: {topic.count} records" for name, topic in log.topics.items()]
        return [f"{log.path}: {state}; {log.duration_s:.2f} s", *topics, *(f"note: {one}" for one in self.notes)]

    def _columns(self) -> dict[str, list[Any]]:
        return {"time_s": [time for time, _ in self.events], "event": [text for _, text in self.events]}

    def _draw(self, ax: "Axes") -> None:
        self.run._draw(ax)


def case_of_logs(logs: list[RecordedLog], vehicle: str | None = None, notes: list[str] | None = None) -> Case:
    """Logs as the runs of a case, the way `glider log export` makes one; InputError where they cannot be one."""
    import tempfile

    from glider.tools.data.log.rundata import export_case

    with tempfile.TemporaryDirectory(prefix="glider-") as folder:
        exported = export_case(logs[0], Path(folder) / "case", vehicle=vehicle, more=logs[1:])
        return case_of(cases.load_case(Path(folder) / "case"), (*(notes or ()), *exported.notes))


def case_of(case: cases.Case, notes: tuple[str, ...] = ()) -> Case:
    """A loaded case as the API's, with the text of its vehicle's file where it is not a shipped one."""
    from glider.tools.data.sources import name_or_path
    from glider.tools.data.vehicle_kinds import shipped_vehicles

    if case.vehicle_name in shipped_vehicles():
        return Case(case, notes)
    return Case(case, notes, name_or_path(case.vehicle_name, "vehicle", "model/vehicles", base=case.folder)[0])
