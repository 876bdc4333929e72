"""What a vehicle file leaves open, drawn: parameters by its [uncertainty], sensor biases by its [sensors]."""

import numpy as np

from firmware.model.estimator_settings import parameter_sigma
from firmware.model.vehicle import Vehicle
from sim_backend.core import layout as wl


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


def sensor_errors(vehicle: Vehicle, rng: np.random.Generator) -> np.ndarray:
    """Bias (drawn, row 0) and white noise (row 1) of the nine measured values, shape (2, N_ERRORS)."""
    tables = vehicle.sensors
    rows = [tables.attitude] * 3 + [tables.gyro] * 3 + [tables.depth, tables.slider, tables.ballast]
    errors = np.zeros((2, wl.N_ERRORS))
    errors[0] = [table.bias * rng.standard_normal() for table in rows]
    errors[1] = [table.noise for table in rows]
    return errors
