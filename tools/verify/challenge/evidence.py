"""Whether what is allowed (parameters within [uncertainty], sensor biases) could pass for an effect."""

import numpy as np

from glider.firmware.model.estimator_settings import parameter_sigma
from glider.firmware.model.vehicle import Vehicle
from glider.tools.inference.channels import ROUGHIE_MEASURES, errors
from glider.tools.verify.challenge.trial import Trial, TrialFlight

THIN = 5  # rows
MEMORY = 20.0  # rows over which a gap is autocorrelated: as many count as one
STEPS = 6  # of the search, its Jacobian kept
BIASES = 9


def evidence(trial: Trial, flights: list[TrialFlight], F: np.ndarray, floor: dict[str, float]) -> float:
    """Evidence (nat) for a model with effects F over one with none, when both may take all that is allowed.

    Half the difference of the least regularised squares over the parameters (priors of [uncertainty] about the file's
    values) and the sensors' biases: from true starts, errors weighed by the channel's floor, rows that hang together
    counted as one. Searched by Gauss and Newton with the Jacobian of the true parameters.
    """
    P0 = trial.vehicle.vector()
    sigma = parameter_sigma(P0, trial.vehicle.uncertainty)
    which = np.flatnonzero(sigma)

    def residual(shift: np.ndarray, effects: np.ndarray, plain: bool) -> np.ndarray:
        P = trial.P.copy()
        P[which] += sigma[which] * shift
        return np.concatenate(
            [_errors(flight, trial.predict(flight, P, effects, plain, seen=plain), floor) for flight in flights]
        )

    still = np.zeros(len(which))
    base = residual(still, trial.shapes, True)
    pushed = [base - residual(one, trial.shapes, True) for one in np.eye(len(which))]
    J = np.column_stack([*pushed, np.concatenate([_biases(trial.vehicle, flight, floor) for flight in flights])])
    prior = np.zeros(J.shape[1])
    prior[: len(which)] = (P0[which] - trial.P[which]) / sigma[which]
    inverse = np.linalg.inv(J.T @ J + np.eye(J.shape[1]))
    costs = []
    for effects, plain in ((F, False), (trial.shapes, True)):
        theta, least = np.zeros(J.shape[1]), np.inf
        for _ in range(STEPS):
            r = residual(theta[: len(which)], effects, plain) - J[:, len(which) :] @ theta[len(which) :]
            cost = np.sum(r**2) + np.sum((theta - prior) ** 2)
            if not cost < least:
                break
            least = cost
            theta = theta + inverse @ (J.T @ r + prior - theta)
        costs.append(least)
    return float(0.5 * (costs[1] - costs[0]))


def _rows(flight: TrialFlight) -> np.ndarray:
    rows = [np.arange(w.start, w.end, THIN) for w in flight.windows if w.scored]
    return np.concatenate(rows)


def _errors(flight: TrialFlight, Y: np.ndarray, floor: dict[str, float]) -> np.ndarray:
    """Errors of a prediction at the thinned rows, channel by channel, in weighed floors; what is missing is 0."""
    rows, table = _rows(flight), ROUGHIE_MEASURES.measured(flight.run)
    parts = [errors(c, table[rows], Y[rows]).ravel() / floor[c.name] for c in ROUGHIE_MEASURES.channels_of(flight.run)]
    return np.nan_to_num(np.concatenate(parts)) * np.sqrt(THIN / MEMORY)


def _biases(vehicle: Vehicle, flight: TrialFlight, floor: dict[str, float]) -> np.ndarray:
    """What 1 sigma of each sensor's bias does to `_errors`, (errors, BIASES)."""
    sensors = vehicle.sensors
    tables = (*3 * (sensors.attitude,), *3 * (sensors.gyro,), sensors.depth, sensors.slider, sensors.ballast)
    parts = []
    for channel in ROUGHIE_MEASURES.channels_of(flight.run):
        one = np.zeros((len(channel.columns), BIASES))
        for k, column in enumerate(channel.columns):
            if column < BIASES:
                one[k, column] = tables[column].bias / channel.tolerance / floor[channel.name]
        parts.append(np.tile(one, (len(_rows(flight)), 1)))
    return np.concatenate(parts) * np.sqrt(THIN / MEMORY)
