"""What an identification leaves behind: a vehicle file that says where it comes from, the posterior for others."""

import datetime
import hashlib
import json
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from glider.firmware.core.jit import kernels_digest
from glider.firmware.core.vehicle import layout
from glider.firmware.model.vehicle import COEFFICIENTS, PLACES, Vehicle, decode_vehicle
from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.data.files import whole, write_files
from glider.tools.data.runs.case import CASE_FILE
from glider.tools.data.tomltext import toml_text
from glider.tools.data.version import software
from glider.tools.identify.pipeline import Identified
from glider.tools.inference.corrected import corrected_text
from glider.tools.inference.levels import DISTURBANCE
from glider.tools.inference.model import effect_vector, effects_in, nominal_model

VEHICLE, CORRECTED, POSTERIOR, RESULT = "identified.toml", "corrected.toml", "posterior.nc", "identified.json"
DIGITS = 10  # of a covariance


def data_hash(found: Identified) -> str:
    """Over case.toml and every run's samples that were fitted, 16 hex digits."""
    digest = hashlib.sha256()
    path = found.case.folder / CASE_FILE
    if path.is_file():
        digest.update(path.read_bytes())
    for run in found.runs:
        digest.update(run.name.encode())
        for name, values in sorted(run.columns.items()):
            digest.update(name.encode())
            digest.update(np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()[:16]


def provenance(found: Identified) -> dict[str, Any]:
    """[identified]: names and covariance in SI of everything that stands in a vehicle file."""
    listed = [n for n, name in enumerate(found.free.names) if name in PLACES]
    draws = found.free.si(found.chains.flat)[:, listed]
    C = np.cov(draws.T)
    rounded = [[float(f"{value:.{DIGITS}g}") for value in row] for row in 0.5 * (C + C.T)]
    return {
        "data": data_hash(found),
        "runs": len(found.runs),
        "revision": f"{software()} {kernels_digest()}",
        "date": datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%MZ"),
        "from_vehicle": found.case.vehicle_name,
        "parameters": [found.free.names[n] for n in listed],
        "covariance": rounded,
    }


def _uncertainty(found: Identified, old: dict[str, float]) -> dict[str, float]:
    """[uncertainty]: what is left, as far as five numbers can say it; [identified] has it all."""
    by_name = {one.name: one for one in found.summaries}
    # What flies takes them as independent (tools/inference/model.alone).
    alone = dict(zip(found.free.names, found.free.alone(found.quadratic.normal).tolist(), strict=True))

    def relative(names: list[str], fallback: float) -> float:
        shares = [alone[n] / abs(by_name[n].mean) for n in names if n in by_name and by_name[n].mean != 0.0]
        return float(f"{max(shares):.3g}") if shares else fallback

    steady = [name for name in COEFFICIENTS if name not in ("K_L0", "K_M0")]  # those two may be near 0
    return {
        "K": relative(steady, old["K"]),
        "mass": relative(["m_t", "m_r", "m_s"], old["mass"]),
        "added": relative([f"added_{what}_{axis}" for what in ("mass", "inertia") for axis in "yz"], old["added"]),
        "net_mass": by_name["net_mass"].sd if "net_mass" in by_name else old["net_mass"],
        "length": relative(["x_b", "R_r", "R_s"], old["length"]),
        "cg": max((by_name[f"cg_{axis}"].sd for axis in "xyz" if f"cg_{axis}" in by_name), default=old["cg"]),
    }


def vehicle_table(found: Identified) -> dict[str, Any]:
    """The vehicle file's content: the case's vehicle with the posterior's mode in place."""
    vehicle = found.case.roughie
    table: dict[str, Any] = msgspec.to_builtins(vehicle)
    table["form"] = None if found.held is None else found.held.form
    if found.file_stays:
        return table
    P, F, _ = found.free.place(found.read.model, found.best)
    table["hydrodynamics"] |= {name: float(P[PLACES[name]]) for name in (*COEFFICIENTS, "D_p", "D_q", "D_r")}
    table["mass"] |= {name: float(P[PLACES[name]]) for name in ("m_t", "m_r", "m_s", "R_r", "R_s", "x_b")}
    table["mass"]["J"] = P[layout.J_XX : layout.J_ZZ + 1].tolist()
    table["mass"]["added_mass"] = P[layout.A_X : layout.A_Z + 1].tolist()
    table["mass"]["added_inertia"] = P[layout.B_X : layout.B_Z + 1].tolist()
    table["trim"] = {"net_mass": float(P[layout.NET_MASS]), "cg": P[layout.CG_X : layout.CG_Z + 1].tolist()}
    table["effects"] = effects_in(F)
    table["readings"] = {"depth_with_ballast": float(F[ef.GAUGE_TANK])}
    if found.levels is not None:
        for name, log in zip(found.levels.names, found.levels.log.tolist(), strict=True):
            if name in DISTURBANCE:
                axis = name.removeprefix("disturbance_")
                table["disturbance"][axis] = getattr(found.case.disturbance, axis) * float(np.exp(log))
    if found.fit is None or found.fit.at is not None:  # else the observer stays as it was in the fit
        table["uncertainty"] = _uncertainty(found, table["uncertainty"])
    table["identified"] = provenance(found)
    table["assumed"] = {name: one for name, one in table["assumed"].items() if name not in found.free.names}
    return table


def vehicle_text(found: Identified) -> str:
    """identified.toml; checked by reading it back."""
    said = (
        "`glider identify` found nothing that flies runs left out better: the vehicle as its file has it."
        if found.file_stays
        else "A vehicle identified by `glider identify`; [identified] says from what, and how sure the numbers are."
    )
    text = f"# {said}\n" + toml_text(vehicle_table(found), inline=("sensors", "assumed"))
    decode_vehicle(text, VEHICLE)
    return text


def corrected(found: Identified) -> str | None:
    """The same as a model on top of the case's own vehicle, where it has effects: draw-wires' scales, readings."""
    if found.file_stays:
        return None
    P, F, _ = found.free.place(found.read.model, found.best)
    nominal = nominal_model(found.case)
    F[ef.BIAS : ef.BIAS + ef.N_BIASES] = 0.0
    F -= effect_vector(nominal)
    effects = effects_in(F)
    if not effects:
        return None
    return corrected_text(found.case.vehicle_name, nominal.P, P, F, effects)


def write_posterior(found: Identified, path: Path) -> None:
    """The draws, SI, as ArviZ's InferenceData in netCDF."""
    import arviz

    draws = found.free.si(found.chains.values)
    posterior = {name: draws[:, :, n] for n, name in enumerate(found.free.names)}
    posterior |= {f"log_noise_{name}": found.chains.levels[:, :, g] for g, name in enumerate(found.chains.groups)}
    data = arviz.from_dict(posterior=posterior, attrs={"likelihood": found.likelihood, "seed": found.chains.seed})
    with whole(path) as (temporary,):
        data.to_netcdf(str(temporary))


def write(found: Identified, out: Path) -> Vehicle:
    """All files but the report into a folder; returns the vehicle as it will be read."""
    from glider.tools.data.plain import as_plain

    out.mkdir(parents=True, exist_ok=True)
    text = vehicle_text(found)
    model = corrected(found)
    texts = {VEHICLE: text, RESULT: json.dumps(as_plain(found.plain()), indent=1) + "\n"}
    texts |= {} if model is None else {CORRECTED: model}
    write_posterior(found, out / POSTERIOR)
    write_files({out / name: one.encode("utf-8") for name, one in texts.items()})
    return decode_vehicle(text, VEHICLE)
