"""The model that a prediction flies with: the case's nominal vehicle, or a vehicle file's."""

from dataclasses import dataclass

import numpy as np

from firmware.estimation.settings import parameter_sigma
from tools.runs.case import Case
from tools.sources import load_vehicle

NOMINAL = "nominal"


@dataclass(frozen=True)
class Model:
    """What predicts: parameter vector P and its 1 sigma, both (layout.N_P,)."""

    name: str
    P: np.ndarray
    sigma: np.ndarray


def nominal_model(case: Case) -> Model:
    """The case's own vehicle."""
    P = case.vehicle.vector()
    return Model(NOMINAL, P, parameter_sigma(P, case.vehicle.uncertainty))


def load_model(wanted: str, case: Case) -> Model:
    """`nominal`, or the vehicle of a file; InputError or ConfigError where it cannot be used."""
    if wanted == NOMINAL:
        return nominal_model(case)
    vehicle = load_vehicle(wanted)
    P = vehicle.vector()
    return Model(wanted, P, parameter_sigma(P, vehicle.uncertainty))
