"""A model by its name: the nominal vehicle, a corrected model, or a vehicle."""

from pathlib import Path

from glider.hal.strict import ConfigError
from glider.tools.data.runs.case import Case
from glider.tools.data.sources import load_any_vehicle, read_text
from glider.tools.inference.corrected import is_corrected, load_corrected
from glider.tools.inference.kind import ROUGHIE
from glider.tools.inference.kinds import kind_of
from glider.tools.inference.model import NOMINAL, Model, nominal_model, vehicle_model


def load_model(wanted: str, case: Case) -> Model:
    """`nominal`, a corrected model's file, or a vehicle; InputError or ConfigError where it cannot be used."""
    if wanted == NOMINAL:
        return nominal_model(case)
    ours = kind_of(case.vehicle)
    if Path(wanted).is_file() and is_corrected(read_text(Path(wanted))):
        if ours is not ROUGHIE:
            raise ConfigError(wanted, f"a corrected model of another kind of vehicle than {case.vehicle_name}")
        return load_corrected(wanted, nominal_model(case))
    vehicle = load_any_vehicle(wanted)
    if kind_of(vehicle) is not ours:
        raise ConfigError(wanted, f"another kind of vehicle than the case's, {case.vehicle_name}", key="kind")
    return vehicle_model(wanted, vehicle)
