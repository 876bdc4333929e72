"""What the form of a model lacks as a function of how it is flown: a force, constant in a run, at every noise.

It is a Gaussian process of the run's mean inputs z, in usual deviations from the usual ones: with points Z,
L L' = k(Z, Z) and k squared exponential, f(z) = k(z, Z) L^-T w, w ~ N(0, tau^2). Identified runs give Z and what is
known of w; runs that are asked about add points, whose w is known by tau alone: near identified runs the force is
known, far from them it is uncertain, for all runs there in the same way.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from glider.tools.own.declare import Declaration
from glider.tools.own.runs import OwnRun

KERNEL_LENGTH = 2.0  # usual deviations of an input, over which the force is much the same: a prior
ROUNDING = 1e-9  # of the variance: keeps points of a file that are the same apart
ONE_COMMAND = 0.99  # correlation of the means of two inputs that are under one command
NEW_POINT_VARIANCE = 0.05  # of the variance, that known points leave: less is no point of its own


def mean_inputs(declared: Declaration, driven: np.ndarray) -> np.ndarray:
    """Mean inputs (rows, inputs) of a run, of inputs that are not the same all along, in usual deviations.

    Inputs under one command count as one: each by the root of its share.
    """
    means = driven.mean(axis=0)
    return np.array([(means[n] - mean) / sd * np.sqrt(declared.input_shares.get(one.name, 1.0))
                     for n, one in enumerate(declared.inputs)
                     for mean, sd in [declared.usual_inputs.get(one.name, (0.0, 0.0))] if sd > 0.0])  # fmt: skip


def input_shares(declared: Declaration, runs: Sequence[OwnRun]) -> dict[str, float]:
    """Share of every input in the distance between runs: 1 / how many have the same course of means (ONE_COMMAND)."""
    names = [one.name for one in declared.inputs if one.name in declared.usual_inputs]
    z = np.array([mean_inputs(declared, run.inputs) for run in runs]).reshape(len(runs), len(names))
    z -= z.mean(axis=0)
    length = np.sqrt((z**2).sum(axis=0))
    moving = np.outer(length, length)
    r = np.divide(z.T @ z, moving, out=np.eye(len(names)), where=moving > 0.0)
    return {name: float(1.0 / (np.abs(row) > ONE_COMMAND).sum()) for name, row in zip(names, r, strict=True)}


def point_weights(declared: Declaration, driven: np.ndarray) -> np.ndarray:
    """What the force of a run, driven by inputs (rows, inputs), has of each w (points,)."""
    return _weights(declared.operating_points, mean_inputs(declared, driven)) if declared.operating_points else _NONE


def with_operating_points(declared: Declaration, runs: Sequence[OwnRun]) -> Declaration:
    """The declaration with runs' mean inputs among its points, the farthest from all others first."""
    points, left = declared.operating_points, [mean_inputs(declared, run.inputs) for run in runs]
    while left and len(left[0]):
        unknown = [1.0 - float(np.sum(_weights(points, z) ** 2)) for z in left]
        farthest = int(np.argmax(unknown))
        if unknown[farthest] < NEW_POINT_VARIANCE:
            break
        points = (*points, tuple(left.pop(farthest).tolist()))
    return replace(declared, operating_points=points)


_NONE = np.zeros(0)


def _weights(points: tuple[tuple[float, ...], ...], z: np.ndarray) -> np.ndarray:
    """L^-1 k(Z, z), (points,)."""
    if not points:
        return _NONE
    return _inverse_factor(points) @ _kernel(np.array(points), z[None])[:, 0]


@lru_cache(maxsize=64)
def _inverse_factor(points: tuple[tuple[float, ...], ...]) -> np.ndarray:
    Z = np.array(points)
    return np.linalg.inv(np.linalg.cholesky(_kernel(Z, Z) + ROUNDING * np.eye(len(Z))))


def _kernel(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.exp(-0.5 * ((a[:, None, :] - b[None, :, :]) ** 2).sum(axis=2) / KERNEL_LENGTH**2)
