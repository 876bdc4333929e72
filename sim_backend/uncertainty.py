"""What a vehicle file leaves open, drawn: parameters by its [uncertainty], sensor biases by its [sensors]."""

import numpy as np

from glider.firmware.core.vehicle.layout import N_DRAWN, N_P
from glider.firmware.model.estimator_settings import parameter_sigma
from glider.firmware.model.vehicle import Vehicle
from glider.sim_backend.core import layout as wl


def deviates(rng: np.random.Generator) -> np.ndarray:
    """A standard normal deviate for every parameter that may be drawn, 0 for the others, (N_P,)."""
    return np.concatenate([rng.standard_normal(N_DRAWN), np.zeros(N_P - N_DRAWN)])


def draw_parameters(vehicle: Vehicle, rng: np.random.Generator, scale: float = 1.0) -> np.ndarray:
    """A parameter vector P (N_P,): each entry named in [uncertainty] moved by a normal deviate of `scale` sigma.

    No coefficient, mass or inertia changes its sign, however large the scale: such a draw is drawn again.
    """
    nominal = vehicle.vector()
    sigma = scale * parameter_sigma(nominal, vehicle.uncertainty)
    while True:
        drawn = nominal + sigma * deviates(rng)
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
