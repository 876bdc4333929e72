"""Kernels of the diagnosis: errors of a state, a model flown from row to row of a recording, and what is read there.

Errors of a state are those of core/error_layout.
"""

import math

from glider.firmware.core.jit import kernel
from glider.firmware.core.maths.matrices import copy
from glider.firmware.core.maths.rotations import wrap_angle
from glider.firmware.core.maths.wide import anywhere, everywhere, lane, lanes, spread, where, with_lane
from glider.firmware.core.vehicle.layout import X_ACT, X_NU, X_POS, X_QUAT
from glider.firmware.core.vehicle.state import euler_angles, quaternion
from glider.sim_backend.core.effect_plant import effect_parts, effect_step
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.correction import correction, link_of
from glider.sim_backend.core.effects.sensing import read
from glider.sim_backend.core.effects.timing import mean_input, mocap_lateness
from glider.tools.inference.core.error_layout import E_ACT, E_ATT, E_LATE, E_NU, E_POS

N_Y = ef.N_Y
MAX_STEP = 0.1  # s; a step is divided where the vehicle's time constants ask for it
LARGEST_SPEED = 20.0  # m/s, rad/s: a model that flies faster has left every vehicle, and is held where it was


@kernel
def inject_error(x, error):
    """Add an error (N_ERR) to a state, in place."""
    for i in range(3):
        x[X_POS + i] += error[E_POS + i]
    a, b, c = 0.5 * error[E_ATT], 0.5 * error[E_ATT + 1], 0.5 * error[E_ATT + 2]
    q0, q1, q2, q3 = quaternion(x)
    n0 = q0 - q1 * a - q2 * b - q3 * c
    n1 = q1 + q0 * a + q2 * c - q3 * b
    n2 = q2 + q0 * b + q3 * a - q1 * c
    n3 = q3 + q0 * c + q1 * b - q2 * a
    scale = 1.0 / math.sqrt(n0 * n0 + n1 * n1 + n2 * n2 + n3 * n3)
    x[X_QUAT], x[X_QUAT + 1], x[X_QUAT + 2], x[X_QUAT + 3] = n0 * scale, n1 * scale, n2 * scale, n3 * scale
    for i in range(6):
        x[X_NU + i] += error[E_NU + i]
    for i in range(3):
        x[X_ACT + i] += error[E_ACT + i]
    x[ef.X_GEAR_SERVO] += error[E_ACT]
    x[ef.X_GEAR_SLIDER] += error[E_ACT + 1]
    x[ef.X_LATE] += error[E_LATE]


@kernel
def difference(x, y, error):
    """The small error (N_ERR) that takes y to x, into error."""
    for i in range(3):
        error[E_POS + i] = x[X_POS + i] - y[X_POS + i]
    a0, a1, a2, a3 = y[X_QUAT], -y[X_QUAT + 1], -y[X_QUAT + 2], -y[X_QUAT + 3]
    b0, b1, b2, b3 = quaternion(x)
    sign = 2.0 if a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3 >= 0.0 else -2.0
    error[E_ATT] = sign * (a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2)
    error[E_ATT + 1] = sign * (a0 * b2 + a2 * b0 + a3 * b1 - a1 * b3)
    error[E_ATT + 2] = sign * (a0 * b3 + a3 * b0 + a1 * b2 - a2 * b1)
    for i in range(6):
        error[E_NU + i] = x[X_NU + i] - y[X_NU + i]
    for i in range(3):
        error[E_ACT + i] = x[X_ACT + i] - y[X_ACT + i]
    error[E_LATE] = x[ef.X_LATE] - y[ef.X_LATE]


@kernel
def inputs_of_step(delay, t, inputs, i, begin, since, h):
    """What row i has of the three inputs or, where commands are late by a delay (s), their means over a step of h."""
    c0, c1, c2 = spread(inputs[i, 0], delay), spread(inputs[i, 1], delay), spread(inputs[i, 2], delay)
    if anywhere(delay > 0.0):
        for number in range(lanes(delay)):
            late = lane(delay, number)
            if late > 0.0:
                a = since - late
                c0 = with_lane(c0, number, mean_input(t, inputs, 0, i, begin, a, a + h))
                c1 = with_lane(c1, number, mean_input(t, inputs, 1, i, begin, a, a + h))
                c2 = with_lane(c2, number, mean_input(t, inputs, 2, i, begin, a, a + h))
    return c0, c1, c2


@kernel
def step_count(dt):
    """How many steps of at most MAX_STEP a row of dt (s) is flown in."""
    return max(1, math.ceil(dt / MAX_STEP - 1e-9))


@kernel
def propagate(Pw, F, x, mode, t, inputs, i, begin, acc, zero, work, kept, method, parts=0.0):
    """Fly from row i - 1 to row i, in place; acc (6) added to nu_dot; kept (N_XF), zero (3), work are scratch.

    method: one of firmware/core/maths/steps. x, work and kept of wide numbers fly as many states as have lanes. parts:
    into how many a step is divided; 0: as the time constants at its start ask for.
    """
    dt = t[i] - t[i - 1]
    steps = step_count(dt)
    h, delay = dt / steps, F[ef.COMMAND_DELAY]
    for k in range(steps):
        c0, c1, c2 = inputs_of_step(delay, t, inputs, i - 1, begin, t[i - 1] + k * h, h)
        copy(x, kept)
        since = t[i - 1] - t[begin] + k * h
        divided = spread(parts, x[X_NU])
        if parts == 0.0:
            divided = effect_parts(method, Pw, F, x, mode, h)
        effect_step(method, Pw, F, x, mode, c0, c1, c2, since, acc, 0.0, zero, h, divided, work)
        # a divided step that overflowed is held; a model that has no numbers itself (its steps are whole) stays lost
        sound = (abs(x[X_NU]) < LARGEST_SPEED) | (math.isnan(x[X_NU]) & (divided == 1.0))
        for n in range(X_NU + 1, X_ACT):
            sound = sound & ((abs(x[n]) < LARGEST_SPEED) | (math.isnan(x[n]) & (divided == 1.0)))
        if not everywhere(sound):
            for n in range(len(x)):
                x[n] = where(sound, x[n], kept[n])


@kernel
def log_path(x, before, path, i, begin):
    """Add to the path (rows, N_PATH: position, roll, pitch, yaw, less the filter's corrections) the step to row i."""
    roll, pitch, yaw = euler_angles(x)
    for n in range(3):
        path[i, n] = path[i - 1, n] + x[X_POS + n] - before[n]
    path[i, 3] = path[i - 1, 3] + wrap_angle(roll - before[3])
    path[i, 4] = path[i - 1, 4] + wrap_angle(pitch - before[4])
    path[i, 5] = path[i - 1, 5] + wrap_angle(yaw - before[5])


@kernel
def pose_of(x, before):
    """Position and Euler angles of x, into before (N_PATH)."""
    for n in range(3):
        before[n] = x[X_POS + n]
    before[3], before[4], before[5] = euler_angles(x)


@kernel
def read_now(F, x, since, y):
    """What is read at x, `since` s into the run, into y (N_Y); motion capture of now."""
    read(F, x, y)
    link = link_of(F)
    if link > ef.ACTUATOR_LINKS:
        y[link - ef.ACTUATOR_LINKS - 1] += correction(F, x, since, 0.0)


@kernel
def read_row(F, x, t, stamps, path, i, begin, y):
    """What is read at row i, into y (N_Y); motion capture at its own time, along the path flown.

    stamps (rows): the times that the poses which stand in the rows were stamped with, s.
    """
    read_now(F, x, t[i] - t[begin], y)
    at = stamps[i] - mocap_lateness(F, x[ef.X_LATE], stamps[i] - t[begin])
    if everywhere(at == t[i]) or i == begin:
        return
    for number in range(lanes(at)):
        wanted = lane(at, number)
        if wanted == t[i]:
            continue
        j = i
        while j > begin + 1 and t[j - 1] > wanted:
            j -= 1
        share = (t[j] - wanted) / (t[j] - t[j - 1])
        for n in range(6):
            here, a, b = lane(path[i, n], number), lane(path[j, n], number), lane(path[j - 1, n], number)
            now = lane(y[ef.Y_MOCAP_X + n], number)
            y[ef.Y_MOCAP_X + n] = with_lane(y[ef.Y_MOCAP_X + n], number, now - (here - a + share * (a - b)))


@kernel
def innovation(z, y, d):
    """z - y into d (N_Y), angles wrapped; NaN where nothing was measured."""
    for j in range(N_Y):
        d[j] = z[j] - y[j]
        if (j <= ef.Y_YAW or j >= ef.Y_MOCAP_ROLL) and not math.isnan(z[j]):
            d[j] = wrap_angle(d[j])
