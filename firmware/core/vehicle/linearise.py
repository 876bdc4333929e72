"""The nominal flight, linearised about a state: what the estimator's covariance is carried forward with.

Only rows that are not trivial stand in the matrix A (N_MOVING, N_COUPLED): position, attitude and nu against those and
the actuators. The estimator's other errors act on one of these each, with a factor of one (estimator_layout).
"""

from glider.firmware.core.jit import kernel
from glider.firmware.core.maths.wide import anywhere
from glider.firmware.core.vehicle.layout import N_P, X_NU
from glider.firmware.core.vehicle.motion import accelerations
from glider.firmware.core.vehicle.state import rotation, velocities

_STEP = 1e-5  # of the differences, in SI: truncation and rounding are both below 1e-6 of what is differentiated
Y_BY_DOWN = 12  # in y: d(nu_dot)/dk, six numbers for each of k's three
N_POINT = 30  # of y


@kernel
def acceleration_at(P, y, servo_rate, slider_rate, ballast_rate):
    """nu_dot at y = [k (3, down in body axes), nu (6), servo, slider, ballast], in still water."""
    return accelerations(
        P, y[0], y[1], y[2], y[3], y[4], y[5], y[6], y[7], y[8], y[9], y[10], y[11],
        servo_rate, slider_rate, ballast_rate, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    )  # fmt: skip


@kernel
def linearise_motion(x, y, A):
    """Position's and attitude's rows of A at x, and how attitude errors turn gravity; y as linearise left it."""
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation(x)
    u, v, w, p, q, r = velocities(x)
    # position: R v, and d(R v) = -R [v x] dtheta
    A[0, 6], A[0, 7], A[0, 8] = r11, r12, r13
    A[1, 6], A[1, 7], A[1, 8] = r21, r22, r23
    A[2, 6], A[2, 7], A[2, 8] = r31, r32, r33
    for i in range(3):
        a, b, c = A[i, 6], A[i, 7], A[i, 8]
        A[i, 3], A[i, 4], A[i, 5] = c * v - b * w, a * w - c * u, b * u - a * v
    # attitude: dOmega - Omega x dtheta
    A[3, 3], A[3, 4], A[3, 5] = 0.0, r, -q
    A[4, 3], A[4, 4], A[4, 5] = -r, 0.0, p
    A[5, 3], A[5, 4], A[5, 5] = q, -p, 0.0
    A[3, 9], A[4, 10], A[5, 11] = 1.0, 1.0, 1.0
    # d/dtheta from d/dk by dk = k x dtheta
    for i in range(6):
        g0, g1, g2 = y[Y_BY_DOWN + i], y[Y_BY_DOWN + 6 + i], y[Y_BY_DOWN + 12 + i]
        A[6 + i, 3], A[6 + i, 4], A[6 + i, 5] = g1 * r33 - g2 * r32, g2 * r31 - g0 * r33, g0 * r32 - g1 * r31


@kernel
def linearise(P, x, servo_rate, slider_rate, ballast_rate, A, y):
    """d(rate of the error state)/d(error state) into A (N_MOVING, N_COUPLED), at x; y (N_POINT) stays for model_error.

    Attitude errors turn gravity (k + k x dtheta) and the way through the water; the accelerations' derivatives are
    forward differences of equation (1), the actuators' speeds held.
    """
    _, _, _, _, _, _, y[0], y[1], y[2] = rotation(x)
    for i in range(9):
        y[3 + i] = x[X_NU + i]
    a0, a1, a2, a3, a4, a5 = acceleration_at(P, y, servo_rate, slider_rate, ballast_rate)
    for j in range(12):
        # equation (1) is linear in k: any step is exact
        h = 1.0 if j < 3 else _STEP
        kept = y[j]
        y[j] = kept + h
        b0, b1, b2, b3, b4, b5 = acceleration_at(P, y, servo_rate, slider_rate, ballast_rate)
        y[j] = kept
        h = 1.0 / h
        if j < 3:
            to = Y_BY_DOWN + 6 * j
            y[to], y[to + 1], y[to + 2] = b0 - a0, b1 - a1, b2 - a2
            y[to + 3], y[to + 4], y[to + 5] = b3 - a3, b4 - a4, b5 - a5
        else:
            A[6, 3 + j], A[7, 3 + j], A[8, 3 + j] = (b0 - a0) * h, (b1 - a1) * h, (b2 - a2) * h
            A[9, 3 + j], A[10, 3 + j], A[11, 3 + j] = (b3 - a3) * h, (b4 - a4) * h, (b5 - a5) * h
    linearise_motion(x, y, A)


@kernel
def model_error(P, sigma, servo_rate, slider_rate, ballast_rate, y, C, Pt, g):
    """Covariance C (6, 6) of the accelerations' error that parameter errors of 1 sigma (N_P, absolute) leave.

    y as linearise left it. A sigma acts through a difference of equation (1). Pt (N_P) and g (6) are scratch.
    """
    for i in range(6):
        for j in range(6):
            C[i, j] = 0.0
    for j in range(N_P):
        Pt[j] = P[j]
    a0, a1, a2, a3, a4, a5 = acceleration_at(P, y, servo_rate, slider_rate, ballast_rate)
    for n in range(N_P):
        if not anywhere(sigma[n] != 0.0):
            continue
        # a full sigma as the step: the accelerations are linear in nearly all parameters
        Pt[n] = P[n] + sigma[n]
        b0, b1, b2, b3, b4, b5 = acceleration_at(Pt, y, servo_rate, slider_rate, ballast_rate)
        Pt[n] = P[n]
        g[0], g[1], g[2] = b0 - a0, b1 - a1, b2 - a2
        g[3], g[4], g[5] = b3 - a3, b4 - a4, b5 - a5
        for i in range(6):
            for j in range(i + 1):
                C[i, j] += g[i] * g[j]
    for i in range(6):
        for j in range(i):
            C[j, i] = C[i, j]
