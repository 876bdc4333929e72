"""Vehicles as identification leaves them: parameters drawn about the nominal ones, by the file's [uncertainty]."""

import numpy as np

from firmware.estimation.settings import parameter_sigma
from firmware.model.vehicle import Vehicle


def draw_parameters(vehicle: Vehicle, rng: np.random.Generator, scale: float = 1.0) -> np.ndarray:
    """A parameter vector P (N_P,): each entry named in [uncertainty] moved by a normal deviate of `scale` sigma.

    No coefficient, mass or inertia changes its sign, however large the scale: such a draw is drawn again.
    """
    nominal = vehicle.vector()
    sigma = scale * parameter_sigma(nominal, vehicle.uncertainty)
    while True:
        drawn = nominal + sigma * rng.standard_normal(len(nominal))
        if (np.sign(drawn) == np.sign(nominal))[(sigma > 0.0) & (nominal != 0.0)].all():
            return drawn
