"""The model that a prediction flies with: the case's nominal vehicle, or a vehicle file's."""

from dataclasses import dataclass

import numpy as np

from firmware.model.estimator_settings import parameter_sigma
from firmware.model.vehicle import Vehicle
from tools.data.runs.case import Case

NOMINAL = "nominal"  # its name


@dataclass(frozen=True)
class Model:
    """What predicts: parameter vector P and its 1 sigma, both (layout.N_P,), and effects F (N_F,) where it has any."""

    name: str
    P: np.ndarray
    sigma: np.ndarray
    F: np.ndarray | None = None
    spread: np.ndarray | None = (
        None  # (n, N_P): independent directions of what identification left; sigma covers the rest
    )


def nominal_model(case: Case) -> Model:
    """The case's own vehicle."""
    return vehicle_model(NOMINAL, case.vehicle)


def vehicle_model(name: str, vehicle: Vehicle) -> Model:
    """A vehicle as a model: what is uncertain as [uncertainty] says, or where it was identified as its covariance."""
    P = vehicle.vector()
    sigma = parameter_sigma(P, vehicle.uncertainty)
    found = vehicle.identified
    if found is None or not found.parameters:
        return Model(name, P, sigma)
    C = np.array(found.covariance)
    sigma[found.places] = np.sqrt(np.maximum(np.diag(C), 0.0))
    values, vectors = np.linalg.eigh(C)
    spread = np.zeros((len(values), len(P)))
    spread[:, found.places] = (vectors * np.sqrt(np.maximum(values, 0.0))).T
    return Model(name, P, sigma, spread=spread[np.abs(spread).max(axis=1) > 0.0])
