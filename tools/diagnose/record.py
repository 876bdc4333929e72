"""A diagnosis on disk: diagnosis.json (the answer), report.json (what else a report says), report.npz (its curves).

The answer's keys are those of docs/reference/gap.md; those of the other two are in docs/explanation/diagnosis.md,
Files. Numbers that are not
finite are null.
"""

import io
import json
import math
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.data.errors import InputError
from glider.tools.data.files import require_file, write_files
from glider.tools.data.plain import as_plain, read_json
from glider.tools.data.vehicle_kinds import kinds
from glider.tools.diagnose.stages import STAGES
from glider.tools.readings.pictures import Shown

ANSWER, DETAILS, CURVES = "diagnosis.json", "report.json", "report.npz"
NONE, UNKNOWN = "none", "unknown"
AGAINST_HEALTHY = "reference"  # a kind of answer
MOST_BYTES = 100_000_000
SHOWN = ("x", "read", "expected", "mended")  # of a picture of a reading
TABLES = ("measured", "nominal", "corrected")  # (rows, N_Y) of a run that is drawn
COMMANDS = "commands"  # (rows, 3) beside them, where the run has commands

Format = Annotated[int, msgspec.Meta(ge=1, le=1)]
Number = float | None


class Place(msgspec.Struct):
    """Where, and how probable."""

    subsystem: str
    element: str
    probability: float


class EstimateRecord(msgspec.Struct):
    """A parameter of an effect, SI."""

    estimate: Number
    ci90: tuple[Number, Number]
    unit: str


class CauseRecord(msgspec.Struct):
    """A label, `none` or `unknown`."""

    label: str
    probability: float
    group: list[str]
    parameters: dict[str, EstimateRecord]


class Interval(msgspec.Struct):
    """A share and its 90 % interval over runs."""

    value: Number
    ci90: tuple[Number, Number]


class Gap(msgspec.Struct):
    """Gaps in tolerances by channel, and in all (`total`), of four models."""

    before: dict[str, Number]
    recalibrated: dict[str, Number]
    after: dict[str, Number]
    floor: dict[str, Number]
    shrinkage: Interval
    closed: Interval


class CorrectionRecord(msgspec.Struct):
    """A data-driven correction of an unknown gap: its link, its shapes (rms in `unit`), and what it does."""

    link: str
    unit: str
    goes_with: dict[str, float]
    model: str
    gap: dict[str, Number]
    shrinkage: Interval


class Unexplained(msgspec.Struct):
    """What is known of an unknown gap."""

    correction: CorrectionRecord | None = None


class ReadingRecord(msgspec.Struct):
    """Something wrong with a reading (docs/explanation/readings.md)."""

    channel: str
    against: str
    finding: str
    size: Number
    ci90: tuple[Number, Number]
    unit: str
    label: str | None
    mended: bool
    text: str


class StepRecord(msgspec.Struct):
    """A stage of the waterfall: gaps of runs left out, in tolerances, and the total's 90 % interval."""

    stage: str
    added: list[str]
    gap: dict[str, Number]
    ci90: tuple[Number, Number] = (None, None)


class NextRun(msgspec.Struct):
    """The manoeuvre proposed."""

    description: str
    parts: list[str]
    distance: Number
    mission: str


class QuestionRecord(msgspec.Struct):
    """The kind of vehicle that was asked of, where it is said."""

    kind: str = ""


class Entry(msgspec.Struct):
    """A number of the vehicle file that a selected effect changes: the file's, and what it is to be."""

    label: str
    parameter: str
    key: str
    file: Number
    value: Number
    ci90: tuple[Number, Number]
    unit: str


class AnswerRecord(msgspec.Struct):
    """diagnosis.json, as far as a report says it."""

    format: Format
    verdict: Literal["none", "cause", "unknown"]
    where: list[Place]
    causes: Annotated[list[CauseRecord], msgspec.Meta(min_length=2)]
    selected: list[str]
    gap: Gap
    unknown: Unexplained | None
    cautions: list[str]
    next_run: NextRun
    readings: list[ReadingRecord] = []
    stages: list[StepRecord] = []
    enter: list[Entry] = []
    identify_first: bool = False

    @property
    def main(self) -> str:
        """The most probable: a label, `none` or `unknown`."""
        return self.causes[0].label

    def cause(self, label: str) -> CauseRecord:
        """The entry of a label."""
        return next(cause for cause in self.causes if cause.label == label)


class FindingRecord(msgspec.Struct, frozen=True):
    """One test of whitened innovations: what is left in a channel, and what it is correlated with."""

    channel: str
    test: str
    sigma: float


class LinkRecord(msgspec.Struct, frozen=True):
    """A link of the chain: of what the best explanation brings, the share that it brings, 0 to 1."""

    stage: str
    name: str
    share: float


class Panel(msgspec.Struct):
    """Links' shares of what a label brings; label "": of what the likeliest link brings, or of an unknown rest."""

    label: str
    links: list[LinkRecord]


class Noise(msgspec.Struct):
    """Disorder that the search knows of; mean NIS of the recalibrated model with the case's own noise, and with it."""

    name: str
    scale: float
    nis_before: Number = None
    nis_after: Number = None


class Data(msgspec.Struct):
    """What was diagnosed."""

    case: str
    vehicle: str
    site: str
    runs: int
    seconds: float
    log_rate_hz: float
    motion_capture: bool
    columns: list[str]
    channels: list[str]
    flights: dict[str, str] = {}  # run -> file and date of its flight, where they are known


class Picture(msgspec.Struct):
    """A run that is drawn: its gaps, by channel and in all."""

    name: str
    channels: list[str]
    before: dict[str, Number]
    after: dict[str, Number]
    recalibrated: dict[str, Number] = {}
    floor: dict[str, Number] = {}


class RunEstimate(msgspec.Struct):
    """A parameter as one run alone has it, with the same priors, SI."""

    run: str
    estimate: Number
    ci90: tuple[Number, Number]


class Regressor(msgspec.Struct):
    """What a selected effect explains (tools/diagnose/regressors): in which channel, against which feature of flight.

    bins: feature, mean innovation without the effect, its standard error, what the effect predicts, samples;
    innovations in standard deviations. run, second: where the effect predicts most.
    """

    label: str
    channel: str
    feature: str
    unit: str
    run: str
    second: float
    bins: list[tuple[float, float, float, float, int]]
    estimates: dict[str, list[RunEstimate]]  # by parameter, run by run


class Details(msgspec.Struct):
    """report.json."""

    format: Format
    version: str
    data: Data
    evidence: dict[str, float]
    corrected: bool  # whether the corrected model holds any effect
    noise: Noise | None
    panels: list[Panel]
    findings: list[FindingRecord]
    pictures: list[Picture]
    thresholds: dict[str, float]
    shown: list[str] = []  # titles of the pictures of readings
    regressors: list[Regressor] = []


@dataclass(frozen=True)
class Curves:
    """A drawn run: t (rows,) s, what was measured and predicted, each (rows, N_Y), and the commands (rows, 3)."""

    t: np.ndarray
    measured: np.ndarray
    nominal: np.ndarray
    corrected: np.ndarray
    commands: np.ndarray | None = None


@dataclass(frozen=True)
class DiagnosisRecord:
    """A diagnosis as its folder holds it."""

    answer: AnswerRecord
    details: Details
    curves: list[Curves]  # of the runs in details.pictures
    shown: list[Shown] = field(default_factory=list)  # of details.shown
    mission: str = ""  # text of the mission of next_run; "" where its file is not there


def number(value: Number) -> float:
    """A number that may be missing, NaN then."""
    return math.nan if value is None else value


def write_record(
    folder: Path, answer: dict[str, Any], details: Details, curves: list[Curves], shown: list[Shown],
    beside: dict[str, str],
) -> None:  # fmt: skip
    """Write the three files of a diagnosis and texts by name beside them, all or none.

    `answer` holds what Answer does, and whatever else others read.
    """
    tables = {}
    for n, run in enumerate(curves):
        tables[f"t_{n}"] = run.t
        tables |= {f"{name}_{n}": getattr(run, name).astype(np.float32) for name in TABLES}
        if run.commands is not None:
            tables[f"{COMMANDS}_{n}"] = run.commands.astype(np.float32)
    for n, one in enumerate(shown):
        tables |= {f"shown_{name}_{n}": getattr(one, name).astype(np.float32) for name in SHOWN}
    packed = io.BytesIO()
    np.savez_compressed(packed, allow_pickle=False, **tables)
    objects = {ANSWER: answer, DETAILS: msgspec.to_builtins(details, enc_hook=float)}
    texts = {name: json.dumps(as_plain(value), indent=1) + "\n" for name, value in objects.items()} | beside
    folder.mkdir(parents=True, exist_ok=True)
    write_files(
        {folder / name: text.encode("utf-8") for name, text in texts.items()} | {folder / CURVES: packed.getvalue()}
    )


def read_record(folder: Path) -> DiagnosisRecord:
    """A diagnosis from its folder; InputError names the file that is missing or not what it should be."""
    if not folder.is_dir():
        raise InputError("no such folder", source=folder)
    answer, details = read_as(folder / ANSWER, AnswerRecord), read_as(folder / DETAILS, Details)
    _check(answer, details, folder)
    curves = _read_curves(folder / CURVES, len(details.pictures))
    mission = folder / Path(answer.next_run.mission).name
    text = mission.read_text(encoding="utf-8", errors="replace") if mission.is_file() else ""
    return DiagnosisRecord(answer, details, curves, _read_shown(folder / CURVES, details.shown), text)


def _present(path: Path) -> Path:
    if not path.is_file():
        raise InputError("no such file: not a folder of `glider gap diagnose`, or of an older one", source=path)
    require_file(path, MOST_BYTES)
    return path


def is_pooled(folder: Path) -> bool:
    """Whether the diagnosis of a folder asks for what all its runs share: another kind's than ROUGHIE's, which alone
    says none, or one against healthy runs (tools/report/pooled draws it)."""
    return (folder / ANSWER).is_file() and read_as(folder / ANSWER, QuestionRecord).kind in (AGAINST_HEALTHY, *kinds())


def read_as(path: Path, kind: Any) -> Any:
    return read_json(_present(path), kind)


def _check(answer: AnswerRecord, details: Details, folder: Path) -> None:
    """InputError where a file names what no catalogue holds, or where the two files are of different diagnoses."""
    known = {*catalogue(), NONE, UNKNOWN}
    named = [cause.label for cause in answer.causes] + answer.selected
    for label in (label for label in named if label not in known):
        raise InputError(f"no label '{label}' in the catalogue", source=folder / ANSWER, column="causes")
    if not {NONE, UNKNOWN, *answer.selected} <= {cause.label for cause in answer.causes}:
        raise InputError("not every answer has its entry", source=folder / ANSWER, column="causes")
    if not set(details.evidence) >= set(answer.selected):
        raise InputError(f"does not belong to the {ANSWER} beside it", source=folder / DETAILS, column="evidence")
    links = [link for panel in details.panels for link in panel.links]
    if any(link.stage not in STAGES for link in links):
        raise InputError("a link of no stage of the chain", source=folder / DETAILS, column="panels")


def _read_shown(path: Path, titles: list[str]) -> list[Shown]:
    with np.load(_present(path), allow_pickle=False) as tables:
        try:
            return [
                Shown(title, *(tables[f"shown_{name}_{n}"].astype(float) for name in SHOWN))
                for n, title in enumerate(titles)
            ]
        except KeyError as error:
            raise InputError(f"not the curves of this diagnosis: {error}", source=path) from None


def _read_curves(path: Path, count: int) -> list[Curves]:
    found = []
    try:
        with np.load(_present(path), allow_pickle=False) as tables:
            for n in range(count):
                commands = tables[f"{COMMANDS}_{n}"].astype(float) if f"{COMMANDS}_{n}" in tables else None
                measured, nominal, corrected = (tables[f"{name}_{n}"].astype(float) for name in TABLES)
                run = Curves(tables[f"t_{n}"], measured, nominal, corrected, commands)
                if any(getattr(run, name).shape[:1] != run.t.shape for name in TABLES) or len(run.t) < 2:
                    raise InputError(f"tables of different lengths for run {n}", source=path)
                found.append(run)
    except (ValueError, KeyError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"not the curves of this diagnosis: {error}", source=path) from None
    return found
