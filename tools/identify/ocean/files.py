"""What the identification of an ocean glider leaves behind: a vehicle file, and the answer as JSON."""

import json
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from glider.sim_backend.ocean.catalogue import catalogue
from glider.sim_backend.ocean.core import layout as at
from glider.sim_backend.ocean.vehicle import PLACES, OceanVehicle, decode_ocean_vehicle
from glider.tools.data.files import write_files
from glider.tools.data.plain import as_plain
from glider.tools.data.tomltext import toml_text
from glider.tools.identify.ocean.identify import OceanIdentification
from glider.tools.inference.model import effects_in

VEHICLE, RESULT = "identified.toml", "identified.json"
DIGITS = 10  # of a covariance


def numbers_table(vehicle: OceanVehicle, P: np.ndarray) -> dict[str, Any]:
    """A vehicle file's content: the vehicle with the numbers of P (N_P,) in place."""
    table: dict[str, Any] = msgspec.to_builtins(vehicle)
    weight, water = ("volume", "compressibility", "thermal_expansion", "oil_scale"), ("Cd0", "Cd1", "lift_slope")
    table["buoyancy"] |= {name: float(P[PLACES[name]]) for name in weight}
    table["hydrodynamics"] |= {name: float(P[PLACES[name]]) for name in water}
    table["attitude"] = {name: float(P[PLACES[name]]) for name in ("pitch_offset", "pitch_scale", "roll_trim")}
    return table


def vehicle_table(found: OceanIdentification) -> dict[str, Any]:
    """The vehicle file's content: the case's vehicle with what was found in place."""
    vehicle = found.case.of(OceanVehicle)
    table = numbers_table(vehicle, found.P)
    table["identified"] = {
        "runs": len(found.problem.runs),
        "from_vehicle": found.case.vehicle_name,
        "parameters": [one.name for one in found.parameters],
        "covariance": _rows(found.covariance),
        "allowed": _rows(found.allowed),
    }
    return table


def _rows(C: np.ndarray) -> list[list[float]]:
    """A covariance (n, n) as a file has it."""
    return [[float(f"{value:.{DIGITS}g}") for value in row] for row in (0.5 * (C + C.T)).tolist()]


def vehicle_text(found: OceanIdentification) -> str:
    """identified.toml; checked by reading it back."""
    said = "A vehicle identified by `glider identify`; [identified] says from what, and how sure the numbers are."
    return checked_text(said, vehicle_table(found), VEHICLE)


def corrected_text(vehicle: OceanVehicle, P: np.ndarray, F: np.ndarray) -> str:
    """corrected.toml of a diagnosis: the vehicle with its numbers fitted, and the effects of F (N_F,)."""
    table = numbers_table(vehicle, P) | {"effects": effects_in(F, catalogue())}
    table.pop("identified", None)
    return checked_text("A vehicle as `glider gap diagnose` corrects it: [effects] are beside its numbers.", table, "")


def checked_text(said: str, table: dict[str, Any], source: str) -> str:
    """A vehicle file's text; checked by reading it back."""
    text = f"# {said}\n" + toml_text(table, inline=("sensors", "effects"))
    decode_ocean_vehicle(text, source)
    return text


def plain(found: OceanIdentification) -> dict[str, Any]:
    """The answer as it is written."""
    d = found.case.disturbance
    return {
        "kind": "ocean",
        "runs": [run.name for run in found.problem.runs],
        "parameters": [
            {"name": one.name, "mean": one.mean, "sd": one.sd, "ci90": list(one.ci90), "unit": one.unit,
             "prior_sd": one.prior_sd} for one in [*found.parameters, found.net_mass]
        ],
        "ridges": [{"names": one.names, "weights": one.weights, "left": one.left} for one in found.ridges],
        "groups": found.groups,
        "findings": [one.plain() for one in found.findings],
        "next_run": found.next_run,
        "water": {"sd": d.water, "time": d.water_time, "rms": found.water_rms, "runs": found.water},
        "left_out": found.left_out,
        "gravity": float(found.P[at.GRAVITY]),
    }  # fmt: skip


def write(found: OceanIdentification, out: Path) -> None:
    """All files into a folder."""
    out.mkdir(parents=True, exist_ok=True)
    result = (json.dumps(as_plain(plain(found)), indent=1) + "\n").encode("utf-8")
    write_files({out / VEHICLE: vehicle_text(found).encode("utf-8"), out / RESULT: result})
