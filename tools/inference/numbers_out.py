"""The numbers of a vehicle file or of a corrected model, on their way into other programs: TOML, JSON, Python literals.

A corrected model's effects are folded into the numbers that they scale; those that are no number of the vehicle stay
beside them, by label.
"""

import json
import pprint
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from glider.firmware.model.vehicle import COEFFICIENTS, PLACES, Vehicle
from glider.hal.strict import decode
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.hydrodynamics import effective_coefficients
from glider.sim_backend.core.effects.mass import effective_masses
from glider.sim_backend.ocean.vehicle import PLACES as OCEAN_PLACES
from glider.tools.data.errors import InputError
from glider.tools.data.plain import as_plain
from glider.tools.data.sources import load_any_vehicle, read_text
from glider.tools.data.tomltext import toml_text
from glider.tools.data.vehicle_kinds import kind_of
from glider.tools.inference.corrected import BIASES, CorrectedTable, is_corrected, load_corrected
from glider.tools.inference.model import effect_vector, effects_in, vehicle_model
from glider.tools.inference.vehicle_parameters import coefficients

_UNITS = {
    **dict.fromkeys(("m_t", "m_r", "m_s", "net_mass"), "kg"),
    **{f"added_mass_{axis}": "kg" for axis in "xyz"},
    **dict.fromkeys(("R_r", "R_s", "x_b"), "m"),
    **{f"cg_{axis}": "m" for axis in "xyz"},
    **{f"J_{axis}": "kg m2" for axis in "xyz"},
    **{f"added_inertia_{axis}": "kg m2" for axis in "xyz"},
    **dict.fromkeys(("D_p", "D_q", "D_r"), "N m s/rad"),
}
_OCEAN_UNITS = {
    "mass": "kg", "volume": "m3", "compressibility": "1/dbar", "thermal_expansion": "1/K", "pitch_offset": "rad",
    "roll_trim": "rad",
}  # fmt: skip


@dataclass(frozen=True)
class VehicleNumbers:
    """A vehicle's numbers: P (N_P,) SI, effects F (N_F,), and 1 sigma of those that were identified, by name."""

    name: str
    source: str
    P: np.ndarray
    F: np.ndarray = field(default_factory=lambda: np.zeros(ef.N_F))
    sd: dict[str, float] = field(default_factory=dict)

    @property
    def places(self) -> dict[str, int]:
        """Where numbers stand in P, by name."""
        return PLACES

    @property
    def units(self) -> dict[str, str]:
        """Units by name, 1 where none is given."""
        return _UNITS | dict(zip(COEFFICIENTS, (free.unit for free in coefficients(self.P)), strict=True))

    @property
    def effective(self) -> np.ndarray:
        """P with the effects that scale or shift its numbers, (N_P,)."""
        P = self.P.copy()
        effective_coefficients(self.F, P)
        effective_masses(self.F, P)
        return P

    def plain(self) -> dict[str, Any]:
        """Numbers, effects and offsets of readings as a table."""
        found = self.table()
        found["effects"] = effects_in(self.F)
        found["bias"] = {name: float(self.F[entry]) for name, entry in BIASES.items() if self.F[entry] != 0.0}
        return found

    def table(self) -> dict[str, Any]:
        """Its numbers by name with unit and 1 sigma."""
        P, units = self.effective, self.units
        parameters = {
            name: {"value": float(P[place]), "unit": units.get(name, "1"), "sd": self.sd.get(name)}
            for name, place in self.places.items()
        }
        return {"vehicle": self.name, "source": self.source, "parameters": parameters}


class OceanNumbers(VehicleNumbers):
    """The same of an ocean glider, whose P (ocean layout.N_P,) no effect scales."""

    @property
    def places(self) -> dict[str, int]:
        return OCEAN_PLACES

    @property
    def units(self) -> dict[str, str]:
        return _OCEAN_UNITS

    @property
    def effective(self) -> np.ndarray:
        return self.P

    def plain(self) -> dict[str, Any]:
        return self.table()


def load_numbers(wanted: str) -> VehicleNumbers:
    """The numbers of a vehicle (shipped name or file) or of a corrected.toml; InputError or ConfigError."""
    path = Path(wanted)
    if path.is_file() and is_corrected(read_text(path)):
        table = decode(read_text(path), CorrectedTable, wanted)
        vehicle = load_any_vehicle(table.vehicle, path.parent)
        if not isinstance(vehicle, Vehicle):
            raise InputError(f"the corrected model of {kind_of(vehicle).noun} is not exported", source=wanted)
        model = load_corrected(path, vehicle_model(vehicle.name, vehicle))
        return VehicleNumbers(vehicle.name, wanted, model.P, effect_vector(model), _sd(vehicle))
    vehicle = load_any_vehicle(wanted)
    model = vehicle_model(vehicle.name, vehicle)
    found: VehicleNumbers = kind_of(vehicle).numbers(vehicle.name, wanted, model, _sd(vehicle))
    return found


def _sd(vehicle: Any) -> dict[str, float]:
    """1 sigma of what was identified, by name."""
    found = vehicle.identified
    if found is None or not found.parameters:
        return {}
    sizes = np.sqrt(np.maximum(np.diag(np.array(found.covariance)), 0.0))
    return dict(zip(found.parameters, sizes.tolist(), strict=True))


def as_text(table: dict[str, Any], form: str, name: str) -> str:
    """A table as JSON, as TOML, or as a Python module that assigns it to `name`."""
    plain = _without_none(as_plain(table))
    if form == "json":
        return json.dumps(plain, indent=1) + "\n"
    if form == "toml":
        return toml_text(plain)
    return f"{name} = {pprint.pformat(plain, sort_dicts=False, width=110)}\n"


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return value
