"""The model that a prediction flies with: the case's nominal vehicle, or a vehicle file's."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from firmware.estimation.settings import parameter_sigma
from tools.runs.case import Case
from tools.sources import load_vehicle, read_text

NOMINAL = "nominal"


@dataclass(frozen=True)
class Model:
    """What predicts: parameter vector P and its 1 sigma, both (layout.N_P,), and effects F (N_F,) where it has any."""

    name: str
    P: np.ndarray
    sigma: np.ndarray
    F: np.ndarray | None = None


def nominal_model(case: Case) -> Model:
    """The case's own vehicle."""
    P = case.vehicle.vector()
    return Model(NOMINAL, P, parameter_sigma(P, case.vehicle.uncertainty))


def load_model(wanted: str, case: Case) -> Model:
    """`nominal`, a corrected model's file, or a vehicle; InputError or ConfigError where it cannot be used."""
    from tools.gap.corrected import is_corrected, load_corrected

    if wanted == NOMINAL:
        return nominal_model(case)
    if Path(wanted).is_file() and is_corrected(read_text(Path(wanted))):
        return load_corrected(wanted, nominal_model(case))
    vehicle = load_vehicle(wanted)
    P = vehicle.vector()
    return Model(wanted, P, parameter_sigma(P, vehicle.uncertainty))
