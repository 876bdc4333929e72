"""A case: a folder of `case.toml` and its runs, with the vehicle they were flown with."""

import itertools
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, TypeVar

import msgspec

from glider.firmware.model.vehicle import Assumed, DisturbanceTable, NonNegative, SensorsTable, SensorTable, Vehicle
from glider.hal.strict import MAX_BYTES, Table, decode
from glider.tools.data.errors import InputError
from glider.tools.data.files import require_file, write_bytes
from glider.tools.data.runs import csvfile
from glider.tools.data.runs.gate import LeftOut, parted, wrong_rate
from glider.tools.data.runs.origin import ORIGIN_FILE, flight_columns, set_flights
from glider.tools.data.runs.run import Run, load_run, run_name, write_run
from glider.tools.data.sources import load_any_vehicle, read_text
from glider.tools.data.tomltext import toml_text
from glider.tools.data.vehicle_kinds import VehicleKind, kind_of, kinds

V = TypeVar("V")
CASE_FILE = "case.toml"
VEHICLE_FILE = "vehicle.toml"  # beside it, where the vehicle is not a shipped one
_RUN_FILE = re.compile(r"run(?!s\.csv).*\.csv(\.gz)?\Z")  # runs.csv is a table of them
_NUMBER = re.compile(r"\d+")


class SensorsPart(Table):
    """[sensors] of a case: any of the vehicle's entries, each in place of the vehicle's."""

    attitude: SensorTable | None = None
    gyro: SensorTable | None = None
    depth: SensorTable | None = None
    slider: SensorTable | None = None
    ballast: SensorTable | None = None
    mocap_position: SensorTable | None = None
    mocap_attitude: SensorTable | None = None


class DisturbancePart(Table):
    """[disturbance] of a case."""

    linear: NonNegative | None = None
    angular: NonNegative | None = None


class CaseTable(Table):
    """case.toml."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    vehicle: Annotated[str, msgspec.Meta(min_length=1, max_length=1000)]
    site: Annotated[str, msgspec.Meta(max_length=1000)]
    log_rate_hz: Annotated[float, msgspec.Meta(gt=0.0, le=10_000.0)]
    water_density_kg_m3: Annotated[float, msgspec.Meta(ge=900.0, le=1300.0)]
    motion_capture: bool
    runs: Annotated[int, msgspec.Meta(ge=1, le=100_000)]
    sensors: SensorsPart = SensorsPart()
    disturbance: DisturbancePart = DisturbancePart()
    assumed: dict[str, Assumed] = msgspec.field(default_factory=dict)


@dataclass
class Case:
    """Runs of one vehicle at one site."""

    folder: Path
    vehicle: Any  # Vehicle, or another kind's (tools/data/vehicle_kinds)
    vehicle_name: str  # as case.toml gives it: a shipped name or a path
    site: str
    log_rate_hz: float
    water_density_kg_m3: float
    motion_capture: bool
    runs: list[Run]
    sensors: Any  # SensorsTable or OceanSensors: the vehicle's, with the case's entries in their place
    disturbance: Any  # DisturbanceTable or OceanDisturbance
    assumed: dict[str, Assumed] = field(default_factory=dict)  # the vehicle's and the case's, but what was identified
    left_out: list[LeftOut] = field(default_factory=list)  # runs that hold what no run can, if they were to be left out

    @property
    def roughie(self) -> Vehicle:
        """The vehicle of a command that takes no other kind; InputError where it is one."""
        return self.of(Vehicle)

    def of(self, wanted: type[V]) -> V:
        """The vehicle of a command that takes one kind alone, by its class; InputError where it is another."""
        if not isinstance(self.vehicle, wanted):
            asked = next(kind.noun for kind in kinds().values() if kind.vehicle is wanted)
            message = f"{self.vehicle_name} is {kind_of(self.vehicle).noun}: this command takes {asked}"
            raise InputError(message, source=self.folder, column="vehicle")
        return self.vehicle


def run_files(folder: Path) -> list[Path]:
    """The folder's run files by number; InputError where one run is there packed and unpacked."""
    files = [path for path in folder.iterdir() if _RUN_FILE.match(path.name)]

    def place(path: Path) -> tuple[int, str]:
        number = _NUMBER.search(run_name(path))
        return (int(number.group()) if number else -1, path.name)

    files.sort(key=place)
    for first, second in itertools.pairwise(files):
        if run_name(first) == run_name(second):
            raise InputError(f"the run is there twice, as {first.name} too", source=second)
    return files


def _read_case_file(folder: Path) -> CaseTable:
    path = folder / CASE_FILE
    if not folder.is_dir():
        if folder.suffix == ".mcap":
            raise InputError(f"{folder.name} is an onboard log: glider log export {folder} first")
        raise InputError("not a folder" if folder.exists() else "no such folder", source=folder)
    if not path.is_file():
        raise InputError(f"no {CASE_FILE} in this folder", source=folder)
    if path.stat().st_size > 4 * MAX_BYTES:  # UTF-8 takes up to four bytes a character
        raise InputError(f"longer than {MAX_BYTES} characters", source=path)
    return decode(read_text(path), CaseTable, str(path))


def _assemble(folder: Path, table: CaseTable, runs: list[Run], instead: str | None, leave_out: bool = False) -> Case:
    vehicle = load_any_vehicle(table.vehicle, folder) if instead is None else load_any_vehicle(instead)
    known = [] if vehicle.identified is None else vehicle.identified.parameters
    kind = kind_of(vehicle)
    _refuse_other_kinds(folder, runs, kind, table.vehicle if instead is None else instead)
    runs, out = parted(runs, kind.sparse_rows)
    if out and not (leave_out and runs):
        raise out[0].error(len(out) if leave_out else 0)
    contradicted = None if kind.sparse_rows else wrong_rate(runs, table.log_rate_hz)
    if contradicted is not None:
        raise InputError(contradicted, source=folder / CASE_FILE, column="log_rate_hz")
    return Case(
        folder=folder,
        vehicle=vehicle,
        vehicle_name=table.vehicle if instead is None else instead,
        site=table.site,
        log_rate_hz=table.log_rate_hz,
        water_density_kg_m3=table.water_density_kg_m3,
        motion_capture=table.motion_capture,
        runs=runs,
        sensors=_replaced(vehicle.sensors, table.sensors),
        disturbance=_replaced(vehicle.disturbance, table.disturbance),
        assumed={name: one for name, one in {**vehicle.assumed, **table.assumed}.items() if name not in known},
        left_out=out,
    )


def _refuse_other_kinds(folder: Path, runs: list[Run], kind: VehicleKind, named: str) -> None:
    """InputError where a run has a column that only another kind's runs have."""
    for run in runs:
        for other in kinds().values():
            column = next((one for one in other.own_columns if one in run.columns and other is not kind), None)
            if column is not None:
                message = f"{named} is {kind.noun}, {run.name} is {other.noun}'s ({column}): name its vehicle"
                raise InputError(message, source=folder, column="vehicle")


def _given(part: Table | None) -> dict[str, Any]:
    """The entries of a table that are there."""
    whole = {} if part is None else msgspec.structs.asdict(part)
    return {name: value for name, value in whole.items() if value is not None}


def _replaced(whole: Any, part: Table) -> Any:
    return msgspec.structs.replace(whole, **_given(part))


def load_case(folder: Path | str, vehicle: str | None = None, leave_out: bool = False) -> Case:
    """A case with all its runs; InputError or ConfigError, one line, where it cannot be used.

    vehicle: a shipped name or a file that stands in for the vehicle that the case names. A run that holds what none can
    (gate.py) is refused, or with `leave_out` left out, as long as others remain.
    """
    folder = Path(folder)
    return _assemble(folder, *load_runs(folder), vehicle, leave_out)


def load_runs(folder: Path) -> tuple[CaseTable, list[Run]]:
    """case.toml and all runs of a case, without its vehicle; InputError or ConfigError as load_case."""
    table = _read_case_file(folder)
    files = run_files(folder)
    if len(files) != table.runs:
        message = f"{table.runs} expected, {len(files)} files run*.csv found"
        raise InputError(message, source=folder / CASE_FILE, column="runs")
    runs = [load_run(path) for path in files]
    set_flights(folder, runs)
    return table, runs


def load_case_of_run(path: Path | str, vehicle: str | None = None) -> tuple[Case, Run]:
    """One run and its case, by the case.toml beside it; the case's other runs are neither read nor counted.

    vehicle: as in load_case.
    """
    path = Path(path)
    require_file(path)
    table = _read_case_file(path.parent)
    run = load_run(path)
    set_flights(path.parent, [run])
    return _assemble(path.parent, table, [run], vehicle), run


def case_text(facts: dict[str, Any], sensors: Table | None = None, disturbance: Table | None = None) -> str:
    """The text of a case.toml; raises ConfigError where a value is not one that reading would take.

    facts: the keys of CaseTable that are no tables, but `format`.
    """
    tables = {"sensors": msgspec.to_builtins(_given(sensors)), "disturbance": _given(disturbance)}
    text = toml_text({"format": 1, **facts, **tables}, inline=("sensors",))
    decode(text, CaseTable, CASE_FILE)
    return text


def write_case(
    folder: Path | str,
    runs: list[Run],
    *,
    vehicle: str,
    vehicle_text: str | None = None,
    site: str,
    log_rate_hz: float,
    water_density_kg_m3: float | None,
    motion_capture: bool | None = None,
    sensors: SensorsPart | SensorsTable | None = None,
    disturbance: DisturbancePart | DisturbanceTable | None = None,
    suffix: str = ".csv",
    decimals: dict[str, int] | None = None,
    digits: int = 2,
    beside: dict[str, bytes] | None = None,
) -> list[Path]:
    """Write runs as a case, run00 on, and return the run files; case.toml comes last, so that a cut one is no case.

    Numbers have `digits` digits at least and all of one case as many; `beside` are other files of the folder, by name.
    Of which flights the runs are goes into origin.csv, where a run knows it.

    `vehicle` is a shipped name or a path from the case's folder; with `vehicle_text`, that file is written too, as
    vehicle.toml. `motion_capture` is, if not given, whether any run has it. InputError where the folder already holds a
    case: runs of two cases in one folder could not be distinguished.
    """
    folder = Path(folder)
    if motion_capture is None:
        motion_capture = any(run.has_mocap for run in runs)
    facts = {
        "vehicle": vehicle if vehicle_text is None else VEHICLE_FILE, "site": site, "log_rate_hz": float(log_rate_hz),
        "water_density_kg_m3": water_density_kg_m3, "motion_capture": bool(motion_capture), "runs": len(runs),
    }  # fmt: skip
    if water_density_kg_m3 is None:  # of a user's model, whose cases need none
        text = toml_text({"format": 1, **facts})
    else:
        text = case_text(facts | {"water_density_kg_m3": float(water_density_kg_m3)}, sensors, disturbance)
    if folder.is_dir() and ((folder / CASE_FILE).exists() or run_files(folder)):
        raise InputError("the folder already holds a case: name another, or empty it", source=folder)
    folder.mkdir(parents=True, exist_ok=True)
    digits = max(digits, len(str(len(runs) - 1)))
    files = [folder / f"run{number:0{digits}d}{suffix}" for number in range(len(runs))]
    others = dict(beside or {})
    if ORIGIN_FILE not in others and any(run.flight for run in runs):
        columns = flight_columns(runs) | {"run": [run_name(path) for path in files]}
        others[ORIGIN_FILE] = csvfile.encode_table(columns)
    if vehicle_text is not None:
        others[VEHICLE_FILE] = vehicle_text.encode("utf-8")
    others[CASE_FILE] = text.encode("utf-8")
    written: list[Path] = []
    try:
        for path, run in zip(files, runs, strict=True):
            write_run(path, run, decimals=decimals)
            written.append(path)
        for name, data in others.items():
            write_bytes(folder / name, data)
            written.append(folder / name)
    except OSError:
        for path in written:
            path.unlink(missing_ok=True)  # half a case is none
        raise
    return files
