"""What drives and pushes a model along a run: recorded inputs with what is wrong of them, and forces at its noises."""

import numpy as np

from glider.tools.own.declare import Declaration
from glider.tools.own.effects import ModelPoint
from glider.tools.own.operating_points import point_weights
from glider.tools.own.runs import OwnRun


def driven_inputs(run: OwnRun, declared: Declaration, point: ModelPoint) -> np.ndarray:
    """What the model is driven by, (rows, inputs): the recorded inputs with what is wrong of them."""
    if not point.driven:
        return run.inputs
    found = run.inputs.copy()
    for n, wrong in point.driven.items():
        found[:, n] = _driven(run.t, found[:, n], wrong, declared.inputs[n].interpolated)
    return found


def _driven(t: np.ndarray, u: np.ndarray, wrong: dict[str, float], interpolated: bool) -> np.ndarray:
    """One input (rows,): delayed, limited in rate, range and play, lagged; then gain and offset."""
    travel = float(np.ptp(u)) or float(np.abs(u).max()) or 1.0
    if wrong.get("delay", 0.0) != 0.0:
        # held inputs: what was in force then; between rows shares of both, so that it is smooth in the delay
        u = np.interp(t - wrong["delay"], t, u)
    if wrong.get("rate_limit", 0.0) > 0.0:
        u = _rate_limited(t, u, travel / wrong["rate_limit"])
    if wrong.get("limit", 0.0) > 0.0:
        cut = wrong["limit"]
        middle = 0.5 * (u.max() + u.min())
        half = max(0.5 * travel - cut, 0.0)
        u = np.clip(u, middle - half, middle + half)
    if wrong.get("backlash", 0.0) > 0.0:
        u = _played(u, 0.5 * wrong["backlash"])
    if wrong.get("lag", 0.0) > 0.0:
        u = _lagged(t, u, wrong["lag"], interpolated)
    return u * (1.0 + wrong.get("gain", 0.0)) + wrong.get("offset", 0.0)


def _rate_limited(t: np.ndarray, u: np.ndarray, rate: float) -> np.ndarray:
    out = u.copy()
    for k in range(1, len(u)):
        room = rate * (t[k] - t[k - 1])
        out[k] = out[k - 1] + min(max(u[k] - out[k - 1], -room), room)
    return out


def _played(u: np.ndarray, half: float) -> np.ndarray:
    out = u.copy()
    for k in range(1, len(u)):
        out[k] = min(max(out[k - 1], u[k] - half), u[k] + half)
    return out


def _lagged(t: np.ndarray, u: np.ndarray, lag: float, interpolated: bool) -> np.ndarray:
    """A first-order lag, exact between rows: of a held input its mean until the next row, else its value at the row."""
    dt = np.diff(t)
    left, z, out = np.exp(-dt / lag), u[0], u.copy()
    for k in range(len(dt)):
        if interpolated:
            late = lag * (u[k + 1] - u[k]) / dt[k]
            z = out[k + 1] = u[k + 1] - late + (z - u[k] + late) * left[k]
        else:
            out[k] = u[k] + (z - u[k]) * (1.0 - left[k]) * lag / dt[k]
            z = u[k] + (z - u[k]) * left[k]
    if not interpolated:
        out[-1] = z
    return out


def held_inputs(declared: Declaration, driven: np.ndarray) -> np.ndarray:
    """(rows, 2, inputs): what drives the model from each row to the next, and what it has at the row itself.

    driven (rows, inputs). An interpolated input is the mean of both rows on the way, a held one what the first has.
    """
    found = np.repeat(driven[:, None, :], 2, axis=1)
    for n, one in enumerate(declared.inputs):
        if one.interpolated:
            found[:-1, 0, n] = 0.5 * (driven[:-1, n] + driven[1:, n])
    return found


def forces(declared: Declaration, point: ModelPoint, t: np.ndarray, driven: np.ndarray) -> np.ndarray:
    """What stands beside the noises along a run, (rows, noises), by time (rows,) and the inputs that drive it (rows,
    inputs)."""
    found = point.push + (t - t[0])[:, None] * point.growth
    if point.form.any():
        usual = np.array([declared.usual_inputs.get(one.name, (0.0, 0.0))[0] for one in declared.inputs])
        found += (driven - usual) @ point.form.T
    if point.operating.any():
        found += point.operating @ point_weights(declared, driven)
    return found
