"""Captured runs as a case: Qualisys exports alone, or beside the onboard logs of a case."""

from pathlib import Path

from glider.tools.data.errors import InputError
from glider.tools.data.importers.align import Offset, aligned, find_offset
from glider.tools.data.importers.qualisys import Capture, read_capture
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import load_case, write_case
from glider.tools.data.runs.gate import refuse_impossible
from glider.tools.data.runs.run import Run
from glider.tools.data.sources import load_vehicle

DENSITY = 998.0  # kg/m3, fresh water at 20 deg C


def _alone(number: int, path: Path, capture: Capture) -> Run:
    columns = {names.TIME: capture.t} | dict(zip(names.MOCAP, capture.pose.T, strict=True))
    return Run(f"run{number:02d}", path, columns, source=path.name)


def import_qualisys(
    files: list[Path], log: Path | None, body: str | None, vehicle: str, out: Path
) -> tuple[list[Path], list[Offset | None]]:
    """Write the case; its files, and the clocks' offsets. InputError in one line where something does not fit."""
    captures = [read_capture(path, body) for path in files]
    if log is None:
        load_vehicle(vehicle)
        own = Path(vehicle)
        text = own.read_text(encoding="utf-8") if own.is_file() else None
        alone = [_alone(n, *one) for n, one in enumerate(zip(files, captures, strict=True))]
        refuse_impossible(alone)
        written = write_case(
            out, alone, vehicle=vehicle, vehicle_text=text,
            site="pool", log_rate_hz=captures[0].rate_hz, water_density_kg_m3=DENSITY, motion_capture=True,
        )  # fmt: skip
        return written, [None] * len(captures)
    case = load_case(log)
    if len(case.runs) != len(captures):
        raise InputError(f"{len(case.runs)} runs, but {len(captures)} files of motion capture", source=log)
    runs, offsets = [], []
    for path, run, capture in zip(files, case.runs, captures, strict=True):
        try:
            offset = find_offset(run, capture)
        except InputError as error:
            raise InputError(f"with {path.name}: {error}") from None
        runs.append(aligned(run, capture, offset))
        offsets.append(offset)
    refuse_impossible(runs)
    beside = case.folder / case.vehicle_name
    text = beside.read_text(encoding="utf-8") if beside.is_file() else None
    written = write_case(
        out, runs, vehicle=case.vehicle_name, vehicle_text=text, site=case.site, log_rate_hz=case.log_rate_hz,
        water_density_kg_m3=case.water_density_kg_m3, motion_capture=True, sensors=case.sensors,
        disturbance=case.disturbance,
    )  # fmt: skip
    return written, list(offsets)
