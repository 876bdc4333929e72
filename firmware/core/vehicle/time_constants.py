"""How fast a vehicle's own motion dies away, and into how many parts a step is divided so that its integration is
stable.

An explicit method is stable while the step times the largest rate of decay (1/s) stays below the method's limit
(`stable_product`, firmware/core/maths/steps). The rates follow from equation (4) at the present state; the bound below
holds for every direction of the flow and needs no eigenvalues.

Rotation. The damping moments are V^2 R_bf diag(K_p, K_q, K_r) Omega, so the rates are eigenvalues of
A = V^2 I^-1 R_bf diag(K), with I the inertia. T A T^-1 with T = diag(sqrt(|K_i| I_i)) has the entries
V^2 sqrt(a_i) R_ij sqrt(a_j), up to signs, with a_i = |K_i| / I_i. R_bf is orthogonal, therefore no eigenvalue is larger
than V^2 max(a_i). Damping that is linear in the rate (D_p, D_q, D_r) is diagonal and adds max(|D_i| / I_i) at most. The
inertia is what is left of it while the other motions are free (Schur complement), bounded from below.

Translation. In flow axes the derivative of the force by the velocity, divided by V, is

    [ -2 D    L cos(beta) - D'           -SF         ]
    [ -2 L   -D cos(beta) - SF' - L'      0          ]       D' = dD/dalpha, SF' = SF sin(beta)
    [ 2 SF   -L sin(beta)                 K_beta - D ]       L' = dL/dalpha

(order: along the flow, across it in the plane of symmetry, sideways; D, L, SF for V = 1). Its norm is at most
max(2 D, D + |L'|, D + |K_beta|) + max(2 |L|, |L| + |D'|) + 2 |SF|, and a rate at most V times that, divided by the
smallest of the three masses. Within a few degrees of a flow from abeam, alpha has a jump and no derivative: the bound
is for the flow of either side.

Oscillations (pendulum, weathercock) are slower than these rates by far at any step used here, and lie within the
margin. Rates of growth need no parts: an unstable vehicle diverges in any integration.
"""

import math

from glider.firmware.core.jit import inlined_kernel, kernel
from glider.firmware.core.maths.steps import stable_product
from glider.firmware.core.maths.wide import anywhere, spread, where
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.layout import X_BALLAST, X_SLIDER
from glider.firmware.core.vehicle.mass import roll_pendulum_moment, translational_mass
from glider.firmware.core.vehicle.state import velocities

MOST_PARTS = 64  # of a step: enough for 0.1 s of K_p = -80 kg s/rad at 1 m/s; what is faster has left every vehicle
STABLE_SHARE = 0.9  # of a method's limit: the state changes in the course of a step


@kernel
def least_inertia(P, x):
    """The smallest mass on an axis (kg), and lower bounds of the inertia about x, y and z (kg m2)."""
    m1, m2, m3 = translational_mass(P, x[X_BALLAST])
    smallest = min(m1, min(m2, m3))
    m_r, m_s, x_r, x_s = P[layout.M_R], P[layout.M_S], P[layout.X_R], P[layout.R_SX0] + x[X_SLIDER]
    across = abs(roll_pendulum_moment(P)) + P[layout.M_T] * (abs(P[layout.CG_Y]) + abs(P[layout.CG_Z]))
    along = m_s * x[X_SLIDER] + x[X_BALLAST] * P[layout.X_B] + P[layout.M_T] * P[layout.CG_X]
    tank = x[X_BALLAST] * P[layout.X_B] * P[layout.X_B]
    masses_along = m_r * x_r * x_r + m_s * x_s * x_s + tank
    lost = (across * across + along * along) / smallest
    I2 = P[layout.J_YY] + P[layout.B_Y] + masses_along - lost
    I3 = P[layout.J_ZZ] + P[layout.B_Z] + masses_along - lost
    product = m_r * x_r * P[layout.R_R] + m_s * x_s * P[layout.R_S]
    I1 = P[layout.J_XX] + P[layout.B_X] + m_r * P[layout.R_R] * P[layout.R_R] + m_s * P[layout.R_S] * P[layout.R_S]
    I1 -= across * across / min(m2, m3) + product * product / min(I2, I3)
    return smallest, I1, I2, I3


@kernel
def attack_bound(u, w):
    """Return an upper bound of the size of the angle of attack, rad: |w| / u up to pi/2; pi in a flow from astern."""
    ahead = u > 0.0
    return where(ahead, min(abs(w) / where(ahead, u, 1.0), 0.5 * math.pi), math.pi)


@kernel
def damping_rate(P, x):
    """Return the upper bound of the rates at which the water's forces and moments damp the motion at x, 1/s."""
    u, v, w, _, _, _ = velocities(x)
    mass, I1, I2, I3 = least_inertia(P, x)
    squared = u * u + v * v + w * w
    speed, alpha = math.sqrt(squared), attack_bound(u, w)
    turning = squared * max(abs(P[layout.K_P]) / I1, max(abs(P[layout.K_Q]) / I2, abs(P[layout.K_R]) / I3))
    turning += max(abs(P[layout.D_P]) / I1, max(abs(P[layout.D_Q]) / I2, abs(P[layout.D_R]) / I3))
    drag = abs(P[layout.K_D0]) + abs(P[layout.K_D]) * alpha * alpha
    printed = P[layout.LIFT_PRINTED] != 0.0
    lift = abs(P[layout.K_L0]) + abs(P[layout.K_L]) * where(printed, alpha * alpha, alpha)
    slope = abs(P[layout.K_L]) * where(printed, 2.0 * alpha, 1.0)
    side = abs(P[layout.K_BETA])
    through = speed * (
        max(2.0 * drag, drag + max(slope, side)) + max(2.0 * lift, lift + 2.0 * abs(P[layout.K_D]) * alpha)
    )
    through += math.pi * side * abs(v)  # 2 |SF| V, |beta| V <= pi/2 |v|
    return max(turning, through / mass)


@kernel
def lag_rate(P, mode):
    """Return the fastest lag of the actuators that follow a command, 1/s; mode as in estimator_layout."""
    fastest = spread(0.0, P[layout.SERVO_TAU])
    for n in range(3):
        if not mode & (1 << n):
            fastest = max(fastest, 1.0 / P[layout.SERVO_TAU + 4 * n])
    return fastest


@inlined_kernel
def parts_of(method, product):
    """Return the number of parts (a float, at least 1) of a step whose product with the fastest rate is `product`.

    Of wide numbers a number for each lane. A method of firmware/core/maths/steps.
    """
    wanted = product / (STABLE_SHARE * stable_product(method))
    parts = spread(1.0, wanted)
    more = (wanted > parts) & (parts < MOST_PARTS)
    while anywhere(more):
        parts = where(more, parts + 1.0, parts)
        more = (wanted > parts) & (parts < MOST_PARTS)
    return parts


@kernel
def nominal_parts(method, P, x, mode, dt):
    """Return the number of parts of a step of dt (s) of the nominal vehicle from x on."""
    return parts_of(method, dt * max(damping_rate(P, x), lag_rate(P, mode)))
