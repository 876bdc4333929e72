"""Where windows begin for a model that lacks an effect of a sensor: where its own reading shows the vehicle."""

from dataclasses import replace

import numpy as np

from glider.firmware.core.maths.rotations import quaternion_from_euler
from glider.firmware.core.vehicle.layout import X_DOWN, X_NU, X_QUAT
from glider.firmware.core.vehicle.state import euler_angles
from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.inference.problem import Gains, Problem, cut


def begun_as_read(problem: Problem, F: np.ndarray, other: np.ndarray, gains: Gains) -> Gains:
    """Where a filter with effects F stands, its windows' starts moved to where effects `other` read the same there.

    Only attitude and depth that motion capture does not see: an offset of those is taken up by the start, and nobody
    can tell it from another place.
    """
    unseen = [onboard for onboard, mocap in problem.kind.doubled if not problem.valid[:, mocap].any()]
    if not unseen:
        return gains
    r, tables = problem.recording, np.empty((2, *problem.z.shape))
    for effects, table in zip((F, other), tables, strict=True):
        problem.kind.read_rows(effects, gains.X, gains.path, r.t, r.bounds, table)
    apart = np.zeros_like(problem.z)
    apart[:, unseen] = (tables[0] - tables[1])[:, unseen]
    X = gains.X.copy()
    for i in cut(problem).first - 1:
        angles = np.array(euler_angles(X[i])) + apart[i, ef.Y_ROLL : ef.Y_YAW + 1]
        X[i, X_QUAT:X_NU] = quaternion_from_euler(*angles)
        X[i, X_DOWN] += apart[i, ef.Y_DEPTH]
    return replace(gains, X=X)
