"""The trajectory likelihood: flights held to the recordings by a Kalman filter, linearised in what is free.

What a model fails to predict of each row, whitened (inference/core/filter), is white for the true model whatever
the disturbance did to the course. With the filter's gains kept, the innovations of any other model are a smooth
function of its parameters, so that Gauss-Newton steps find the most probable ones, and their columns J there are the
sufficient statistics of the posterior.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.inference.problem import Gains, Problem
from glider.tools.inference.vehicle_parameters import Parameters

DIFFERENCE_STEP = 0.02  # of a prior's sigma, for columns
STEP_SHARES = (1.0, 0.4, 0.1)  # of a foreseen step, tried in turn
TEMPERED_ABOVE = 1.5  # squared innovations a sample, above which a step is tempered


def reframed(z: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Recordings z (rows, N_Y) with the capture's poses as those of the vehicle.

    frame (6,): the capture's body is turned by small angles about the vehicle's axes (rad), and its origin lies at the
    offset (m, body axes) from the vehicle's.
    """
    if not frame.any():
        return z
    out = z.copy()
    whole = np.isfinite(z[:, ef.Y_MOCAP_X :]).all(axis=1)
    pose = z[whole, ef.Y_MOCAP_X :]
    capture = Rotation.from_euler("ZYX", pose[:, :2:-1])
    vehicle = capture * Rotation.from_rotvec(frame[:3]).inv()
    out[whole, ef.Y_MOCAP_X : ef.Y_MOCAP_ROLL] = pose[:, :3] - vehicle.apply(frame[3:])
    out[whole, ef.Y_MOCAP_ROLL :] = vehicle.as_euler("ZYX")[:, ::-1]
    return out


@dataclass
class Linear:
    """Innovations and their columns at one point, with the gains of the model there."""

    values: np.ndarray  # (n,) in units of the priors
    e: np.ndarray  # (samples,) whitened innovations
    J: np.ndarray  # (n, samples)
    gains: Gains

    @property
    def normal(self) -> np.ndarray:
        """Normal matrix with the priors', (n, n)."""
        return self.J @ self.J.T + np.eye(len(self.values))

    @property
    def misfit(self) -> float:
        return float(self.e @ self.e + self.values @ self.values)


class TrajectoryLikelihood:
    """A problem and what is free in it."""

    def __init__(self, problem: Problem, free: Parameters):
        self.problem, self.free = problem, free
        self.low = np.array([f.low for f in free.free])

    def filter(self, values: np.ndarray, process_noise_scale: float = 1.0, problem: Problem | None = None) -> Gains:
        """The filter of the model at `values`."""
        P, F, frame = self.free.place(self.problem.model, values)
        base = self.problem if problem is None else problem
        return replace(base, z=reframed(base.z, frame)).filter(
            P, F, process_noise_scale=process_noise_scale, begin=True
        )

    def follow(self, points: list[np.ndarray], gains: Gains) -> np.ndarray:
        """Innovations of the models at points, (points, samples), with kept gains."""
        placed = [self.free.place(self.problem.model, values) for values in points]
        kinds: dict[bytes, list[int]] = {}
        for n, (_, _, frame) in enumerate(placed):
            kinds.setdefault(frame.tobytes(), []).append(n)
        out = np.empty((len(points), int(self.problem.valid.sum())))
        for members in kinds.values():
            z = reframed(self.problem.z, placed[members[0]][2])
            out[members] = replace(self.problem, z=z).follow([placed[n][:2] for n in members], gains)
        return out

    def linear(self, values: np.ndarray, process_noise_scale: float = 1.0) -> Linear:
        """The filter at `values`, and the columns of everything free."""
        gains = self.filter(values, process_noise_scale)
        size = np.where(
            values - DIFFERENCE_STEP < self.low, DIFFERENCE_STEP, -DIFFERENCE_STEP
        )  # towards the nominal would do as well
        E = self.follow([values, *(values + s * row for s, row in zip(size, np.eye(len(values)), strict=True))], gains)
        return Linear(values, E[0], (E[1:] - E[0]) / size[:, None], gains)

    def step(self, at: Linear, inflation: float = 1.0) -> np.ndarray:
        """The Gauss-Newton step from a point, or a share of it; tempered where the misfit is large, or by
        `inflation`.
        """
        squares = float(at.e @ at.e) / len(at.e)
        weight = min(1.0 / squares if squares > TEMPERED_ABOVE else 1.0, 1.0 / inflation)
        normal = weight * (at.J @ at.J.T) + np.eye(len(at.values))
        step = -np.linalg.solve(normal, weight * (at.J @ at.e) + at.values)
        best, found = at.values, weight * float(at.e @ at.e) + float(at.values @ at.values)
        for share in STEP_SHARES:
            values = np.maximum(at.values + share * step, self.low)
            e = self.follow([values], at.gains)[0]
            misfit = weight * float(e @ e) + float(values @ values)
            if misfit < found:
                best, found = values, misfit
                break
        return best
