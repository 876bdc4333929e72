"""A model by its name: the nominal vehicle, a corrected model, or a vehicle."""

from pathlib import Path

from tools.data.runs.case import Case
from tools.data.sources import load_any_vehicle, read_text
from tools.inference.corrected import is_corrected, load_corrected
from tools.inference.model import NOMINAL, Model, nominal_model, vehicle_model


def load_model(wanted: str, case: Case) -> Model:
    """`nominal`, a corrected model's file, or a vehicle; InputError or ConfigError where it cannot be used."""
    if wanted == NOMINAL:
        return nominal_model(case)
    if Path(wanted).is_file() and is_corrected(read_text(Path(wanted))):
        return load_corrected(wanted, nominal_model(case))
    return vehicle_model(wanted, load_any_vehicle(wanted))
