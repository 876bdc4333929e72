"""Results of the API's functions. Each holds the answer that the command prints with --json, read-only, as `answer`."""

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from glider.tools.api import sentences
from glider.tools.api.result import EXTRA, Result, frozen, read_only
from glider.tools.data.errors import need
from glider.tools.data.files import write_bytes, write_files
from glider.tools.data.plain import as_plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from xarray import Dataset

    from glider.sim_backend.core.effects.base import Effect
    from glider.tools.data.vehicle_kinds import Identified
    from glider.tools.gap.assess import CaseGap
    from glider.tools.readings.check import Readings as ReadingCheck
    from glider.tools.watch.answer import WatchAnswer

DRAWN_CAUSES = 6


@dataclass(frozen=True)
class Gap(Result):
    """The gap between a case and a model: root mean square errors in tolerances (docs/reference/gap.md)."""

    _found: "CaseGap" = field(repr=False)

    @property
    def answer(self) -> Mapping[str, Any]:
        """The result as `glider gap measure --json` prints it."""
        return frozen(as_plain(self._found.plain()))

    @property
    def total(self) -> float:
        """Root mean square over channels and runs, tolerances."""
        return float(self._found.total)

    @property
    def channels(self) -> Mapping[str, float]:
        """Root mean square over the runs by channel, tolerances."""
        return frozen({name: float(value) for name, value in self._found.channels.items()})

    def measured(self, run: int) -> Mapping[str, np.ndarray]:
        """Return what was measured in a run while it was under water, by column, each (rows,), SI, NaN if missing."""
        return self._table(self._found.measures.measured(self._found.case.runs[run]))

    def predicted(self, run: int) -> Mapping[str, np.ndarray]:
        """Return the model's prediction of the same rows, by column, each (rows,), SI."""
        return self._table(self._found.predictions[run])

    def _table(self, values: np.ndarray) -> Mapping[str, np.ndarray]:
        return frozen({name: read_only(values[:, n]) for n, name in enumerate(self._found.measures.columns)})

    def save(self, path: Path | str) -> None:
        """Write the report of the gap, one offline HTML page, to a file."""
        from glider.tools.report.gap import write_report

        write_report(Path(path), self._found)

    def _lines(self) -> list[str]:
        return sentences.gap_lines(self._found)

    def _columns(self) -> dict[str, list[Any]]:
        runs = self._found.runs
        found: dict[str, list[Any]] = {"run": [run.name for run in runs]}
        found |= {name: [float(run.channels.get(name, np.nan)) for run in runs] for name in self._found.channels}
        return found | {"total": [float(run.total) for run in runs], "windows": [run.windows for run in runs]}

    def to_xarray(self) -> "Dataset":
        """Return measured and predicted values of all runs along `row`, with coordinates `run` and `t_s`.

        Returns
        -------
        xarray.Dataset
            Variables `measured` and `predicted`, each of dimensions (row, column).
        """
        need(EXTRA, "xarray")
        case, measures = self._found.case, self._found.measures
        runs = np.concatenate([np.full(run.rows, run.name) for run in case.runs])
        both = {
            "measured": (("row", "column"), np.concatenate([measures.measured(run) for run in case.runs])),
            "predicted": (("row", "column"), np.concatenate(self._found.predictions)[:, : len(measures.columns)]),
        }
        times = np.concatenate([run.t for run in case.runs])
        coordinates = {"run": ("row", runs), "t_s": ("row", times), "column": list(measures.columns)}
        return importlib.import_module("xarray").Dataset(both, coords=coordinates)

    def _draw(self, ax: "Axes") -> None:
        """Gap by channel, a group of bars a run."""
        channels, runs = list(self._found.channels), self._found.runs
        width = 0.8 / max(len(runs), 1)
        for n, run in enumerate(runs):
            heights = [run.channels.get(name, np.nan) for name in channels]
            ax.bar(np.arange(len(channels)) + (n - 0.5 * (len(runs) - 1)) * width, heights, width, label=run.name)
        ax.axhline(1.0, color="black", linewidth=0.8, linestyle="--")
        ax.set_xticks(np.arange(len(channels)), channels)
        ax.set_ylabel("gap, tolerances")
        if 1 < len(runs) <= 10:
            ax.legend()


@dataclass(frozen=True)
class Readings(Result):
    """What is wrong with the readings of a case, each compared with the others (docs/explanation/readings.md)."""

    _found: "ReadingCheck" = field(repr=False)

    @property
    def answer(self) -> tuple[Mapping[str, Any], ...]:
        """The findings as `glider gap readings --json` prints them."""
        return frozen(as_plain([one.plain() for one in self._found.findings]))

    def __len__(self) -> int:
        return len(self._found.findings)

    def _lines(self) -> list[str]:
        return sentences.reading_lines(self._found.findings)

    def _columns(self) -> dict[str, list[Any]]:
        found = self._found.findings
        return {
            "channel": [one.channel for one in found], "finding": [one.finding for one in found],
            "size": [float(one.size) for one in found], "low": [float(one.ci90[0]) for one in found],
            "high": [float(one.ci90[1]) for one in found], "unit": [one.unit for one in found],
            "label": [one.label or "" for one in found], "text": [one.text for one in found],
        }  # fmt: skip

    def _draw(self, ax: "Axes") -> None:
        """Size and 90 % interval of each finding, as shares of the size."""
        found = self._found.findings
        for n, one in enumerate(found):
            scale = abs(one.size) or 1.0
            ax.plot([one.ci90[0] / scale, one.ci90[1] / scale], [n, n], color="C0")
            ax.plot(one.size / scale, n, "o", color="C0")
        ax.set_yticks(range(len(found)), [f"{one.channel}: {one.finding}" for one in found])
        ax.set_xlabel("size and 90 % interval, in units of the size")


@dataclass(frozen=True)
class Diagnosis(Result):
    """Where and why a simulator is wrong about a case (docs/explanation/diagnosis.md)."""

    answer: Mapping[str, Any] = field(repr=False)  # diagnosis.json
    sentence: str = ""  # the verdict in one sentence
    files: Mapping[str, bytes] = field(default_factory=dict, repr=False)  # answer, report and the like, by name

    @property
    def verdict(self) -> str:
        """`none`, `cause` or `unknown`."""
        return self.answer["verdict"]

    @property
    def selected(self) -> tuple[str, ...]:
        """Labels of the selected effects, the main one first."""
        return self.answer["selected"]

    @property
    def probabilities(self) -> Mapping[str, float]:
        """Probability of every label, of `none` and of `unknown`."""
        return frozen({cause["label"]: cause["probability"] for cause in self.answer["causes"]})

    @property
    def cautions(self) -> tuple[str, ...]:
        """What these runs cannot say."""
        return self.answer["cautions"]

    def save(self, folder: Path | str) -> None:
        """Write the answer's files into a folder: diagnosis.json, corrected.toml, report.html and the others.

        Parameters
        ----------
        folder : path
            Made if it is not there; files of the same name are replaced.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        write_files({folder / name: data for name, data in self.files.items()})

    def _lines(self) -> list[str]:
        return [self.sentence, *sentences.verdict_lines(self.answer)]

    def _columns(self) -> dict[str, list[Any]]:
        rows = []
        for cause in self.answer["causes"]:
            for name, one in (cause["parameters"] or {"": {}}).items():
                low, high = one.get("ci90") or (None, None)
                label, probability = cause["label"], cause["probability"]
                rows.append((label, probability, name, one.get("estimate"), low, high, one.get("unit", "")))
        heads = ("label", "probability", "parameter", "estimate", "low", "high", "unit")
        return {head: [np.nan if row[n] is None else row[n] for row in rows] for n, head in enumerate(heads)}

    def _draw(self, ax: "Axes") -> None:
        """Probabilities of the most probable causes."""
        causes = sorted(self.probabilities.items(), key=lambda item: -item[1])[:DRAWN_CAUSES]
        ax.barh([label for label, _ in causes], [p for _, p in causes])
        ax.invert_yaxis()
        ax.set_xlim(0.0, 1.0)
        ax.set_xlabel("probability")


@dataclass(frozen=True)
class Watch(Result):
    """What changed from run to run (docs/explanation/watch.md)."""

    _found: "WatchAnswer" = field(repr=False)

    @property
    def answer(self) -> Mapping[str, Any]:
        """The result as `glider gap watch --json` prints it."""
        return frozen(as_plain(self._found.plain()))

    @property
    def events(self) -> tuple[Mapping[str, Any], ...]:
        """Changes, each with label, group, first and last run, course, probability and size."""
        return self.answer["events"]

    @property
    def cautions(self) -> tuple[str, ...]:
        """What these runs cannot say."""
        return tuple(self._found.cautions)

    def save(self, folder: Path | str) -> None:
        """Write the answer's files into a folder: watch.json and report.html."""
        import json

        from glider.tools.report.watch import write_watch_report
        from glider.tools.watch.answer import FILE

        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        text = json.dumps(as_plain(self._found.plain()), indent=1) + "\n"
        write_bytes(folder / FILE, text.encode())
        write_watch_report(folder)

    def _lines(self) -> list[str]:
        return sentences.watch_lines(self._found)

    def _columns(self) -> dict[str, list[Any]]:
        runs = self._found.runs
        causes = [run.causes[0] if run.causes else None for run in runs]
        return {
            "run": [run.run for run in runs], "verdict": [run.verdict for run in runs],
            "gap": [np.nan if run.gap is None else float(run.gap) for run in runs],
            "label": ["" if one is None else one.label for one in causes],
            "probability": [np.nan if one is None else float(one.probability) for one in causes],
            "skipped": [run.skipped or "" for run in runs],
        }  # fmt: skip

    def _draw(self, ax: "Axes") -> None:
        """Gap of every run, and the runs of each event."""
        runs = [run.run for run in self._found.runs]
        ax.plot(range(len(runs)), self._columns()["gap"], "o-")
        for n, event in enumerate(self._found.events):
            first = runs.index(event.from_run) if event.from_run in runs else 0
            last = len(runs) - 1 if event.to_run is None else runs.index(event.to_run)
            ax.axvspan(first - 0.4, last + 0.4, color=f"C{n + 1}", alpha=0.25, label=event.label or "unknown")
        ax.set_xticks(range(len(runs)), runs, rotation=45)
        ax.set_ylabel("gap, tolerances")
        if self._found.events:
            ax.legend()


@dataclass(frozen=True)
class Identification(Result):
    """Parameters of a vehicle and their distribution.

    See docs/explanation/identification.md, docs/explanation/ocean.md.
    """

    _found: "Identified" = field(repr=False)

    @property
    def answer(self) -> Mapping[str, Any]:
        """The result as `glider identify --json` prints it."""
        return frozen(as_plain(self._found.plain()))

    @property
    def vehicle_text(self) -> str:
        """The identified vehicle file, TOML."""
        return self._found.vehicle_text()

    @property
    def notes(self) -> tuple[str, ...]:
        """Runs that were left out, and what limits the result."""
        return self._found.notes

    @property
    def has_report(self) -> bool:
        """Whether `save` writes a report."""
        return self._found.report

    def save(self, folder: Path | str) -> None:
        """Write the result's files into a folder: identified.toml, and of a pool vehicle report.html, posterior.nc."""
        self._found.write(Path(folder))

    def _lines(self) -> list[str]:
        return self._found.lines()

    def _columns(self) -> dict[str, list[Any]]:
        rows = self.answer["parameters"]
        columns = {name: [one[name] for one in rows] for name in ("name", "unit", "mean", "sd")}
        return columns | {"low": [one["ci90"][0] for one in rows], "high": [one["ci90"][1] for one in rows]}

    def _draw(self, ax: "Axes") -> None:
        """Mean and 90 % interval of every parameter, in units of its mean."""
        columns = self._columns()
        for n, (mean, low, high) in enumerate(zip(columns["mean"], columns["low"], columns["high"], strict=True)):
            scale = abs(mean) or 1.0
            ax.plot([low / scale, high / scale], [n, n], color="C0")
            ax.plot(mean / scale, n, "o", color="C0")
        ax.set_yticks(range(len(columns["name"])), columns["name"])
        ax.set_xlabel("mean and 90 % interval, in units of the mean")


@dataclass(frozen=True)
class EffectTable(Result):
    """Effects of the catalogue (docs/reference/effects.md)."""

    _effects: "tuple[Effect, ...]" = field(repr=False)

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the effects."""
        return tuple(one.label for one in self._effects)

    @property
    def answer(self) -> tuple[Mapping[str, Any], ...]:
        """The effects as `glider effects --json` prints them."""
        return frozen([
            {
                "label": one.label, "subsystem": one.subsystem, "element": one.element, "summary": one.summary,
                "parameters": [
                    {"name": p.name, "unit": p.unit, "low": p.low, "high": p.high, "sigma": p.spread}
                    for p in one.parameters
                ],
            }
            for one in self._effects
        ])  # fmt: skip

    def __len__(self) -> int:
        return len(self._effects)

    def _lines(self) -> list[str]:
        return sentences.effect_lines(list(self._effects))

    def _columns(self) -> dict[str, list[Any]]:
        rows = [(one, p) for one in self._effects for p in one.parameters]
        return {
            "label": [one.label for one, _ in rows], "subsystem": [one.subsystem for one, _ in rows],
            "element": [one.element for one, _ in rows], "parameter": [p.name for _, p in rows],
            "unit": [p.unit for _, p in rows], "low": [p.low for _, p in rows], "high": [p.high for _, p in rows],
            "sigma": [p.spread for _, p in rows],
        }  # fmt: skip

    def _draw(self, ax: "Axes") -> None:
        """Number of effects by subsystem."""
        subsystems = list(dict.fromkeys(one.subsystem for one in self._effects))
        ax.barh(subsystems, [sum(one.subsystem == name for one in self._effects) for name in subsystems])
        ax.set_xlabel("effects")


@dataclass(frozen=True)
class VehicleTable(Result):
    """Shipped vehicles."""

    kinds: Mapping[str, str]  # name -> `pool` or `ocean`

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the vehicles."""
        return tuple(self.kinds)

    def __len__(self) -> int:
        return len(self.kinds)

    def _lines(self) -> list[str]:
        return [f"{name}  {kind}" for name, kind in self.kinds.items()]

    def _columns(self) -> dict[str, list[Any]]:
        return {"vehicle": list(self.kinds), "kind": list(self.kinds.values())}

    def _draw(self, ax: "Axes") -> None:
        """Number of vehicles by kind."""
        kinds = list(dict.fromkeys(self.kinds.values()))
        ax.barh(kinds, [list(self.kinds.values()).count(kind) for kind in kinds])
        ax.set_xlabel("vehicles")
