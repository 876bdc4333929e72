"""The filter driven from Python, with its whole covariance: what the tests of the estimator look at."""

from dataclasses import dataclass, field

import numpy as np

from glider.firmware.core.estimation.estimator import estimator_predict, estimator_start, estimator_update
from glider.firmware.core.layouts import estimator_layout as kf
from glider.firmware.core.maths.rotations import quaternion_from_euler
from glider.firmware.model.estimator_settings import estimator_settings, first_spread, parameter_sigma
from glider.firmware.model.vehicle import Vehicle
from glider.tools.data.sources import load_vehicle


@dataclass
class Filter:
    """One estimator and its arrays."""

    vehicle: Vehicle = field(default_factory=lambda: load_vehicle("roughie"))
    mode: int = 0
    uncertain: bool = True

    def __post_init__(self):
        self.P = self.vehicle.vector()
        self.settings = estimator_settings(self.vehicle.sensors, self.vehicle.disturbance, self.mode)
        self.sigma = parameter_sigma(self.P, self.vehicle.uncertainty) * self.uncertain
        if not self.uncertain:
            self.settings[[kf.S_SLIDER_BIAS, kf.S_BALLAST_BIAS]] = 0.0
        self.x, self.cov = np.zeros(kf.N_XE), np.zeros((kf.N_E, kf.N_E))
        self.inflation, self.rejected_for_s, self.scores = np.ones(2), np.zeros(kf.N_Z), np.full(kf.N_Z, np.nan)
        self.work = np.zeros((kf.N_WORK_ROWS, kf.N_W))
        self.x[3] = 1.0

    def start(self, depth=2.0, euler=(0.0, -0.2, 0.5), speed=0.3, spread=None) -> "Filter":
        """At a place, with the spread that a recording begins with unless another is given."""
        self.x[2], self.x[7] = depth, speed
        self.x[3:7] = quaternion_from_euler(*euler)
        spread = first_spread(self.P, self.mode, (True, True, True)) if spread is None else spread
        estimator_start(self.P, self.settings, self.sigma, self.x, self.cov, spread, self.work)
        return self

    def predict(self, dt: float, commands=(0.0, 0.0, 0.0)) -> None:
        arrays = (self.P, self.settings, self.sigma, self.x, self.cov, self.inflation)
        estimator_predict(*arrays, self.mode, *map(float, commands), dt, self.work)

    def update(self, dt: float = 0.1, **readings: float) -> np.ndarray:
        """Readings by name: roll, pitch, yaw, p, q, r, depth, slider, ballast, mocap_x .. mocap_yaw."""
        z = np.full(kf.N_Z, np.nan)
        for name, value in readings.items():
            z[getattr(kf, f"Z_{name.upper()}")] = value
        return self.take(z, dt)

    def take(self, z: np.ndarray, dt: float = 0.1) -> np.ndarray:
        arrays = (self.P, self.settings, self.x, self.cov, self.inflation)
        estimator_update(*arrays, z, self.rejected_for_s, self.scores, dt, self.work)
        return self.scores

    def positive_definite(self) -> bool:
        """Symmetric to the last bit, and no direction of negative variance."""
        scale = np.sqrt(np.diag(self.cov))
        kept = scale > 0.0
        shape = self.cov[np.ix_(kept, kept)] / np.outer(scale[kept], scale[kept])
        return bool((self.cov == self.cov.T).all() and np.linalg.eigvalsh(shape).min() > -1e-9)


def state_error(truth: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Error state (E_ERR,) between two states: position, attitude (body axes), nu, actuators."""
    a, b = x[3:7], truth[3:7]
    scalar = a @ b
    vector = a[0] * b[1:] - b[0] * a[1:] - np.cross(a[1:], b[1:])
    attitude = 2.0 * np.sign(scalar) * vector
    return np.concatenate([truth[:3] - x[:3], attitude, truth[7:16] - x[7:16]])
