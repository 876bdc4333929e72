"""Open-loop nominal flight: the state's derivative in uniformly moving water, a Runge-Kutta step, a whole flight.

State x (N_X = 16): position north, east, down (m), attitude quaternion, nu = u v w p q r (u, v, w relative to the
water), servo (rad), slider (m), ballast (kg).
"""

import math

from firmware.core.jit import kernel
from firmware.core.maths.rotations import quaternion_rate, rotation_nb
from firmware.core.vehicle.actuators import actuator_rates
from firmware.core.vehicle.layout import N_X
from firmware.core.vehicle.motion import accelerations


@kernel
def nominal_derivative(P, x, cmd_servo, cmd_slider, cmd_ballast, water_n, water_e, water_d, out):
    """dx/dt of the nominal vehicle, into out[0:16], in water moving uniformly at water_n.. (m/s, NED)."""
    q0, q1, q2, q3 = x[3], x[4], x[5], x[6]
    u, v, w, p, q, r = x[7], x[8], x[9], x[10], x[11], x[12]
    servo, slider, ballast = x[13], x[14], x[15]
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation_nb(q0, q1, q2, q3)
    ds, dl, db = actuator_rates(P, servo, slider, ballast, cmd_servo, cmd_slider, cmd_ballast)
    ud, vd, wd, pd, qd, rd = accelerations(
        P, r31, r32, r33, u, v, w, p, q, r, servo, slider, ballast, ds, dl, db, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    )
    out[0] = r11 * u + r12 * v + r13 * w + water_n
    out[1] = r21 * u + r22 * v + r23 * w + water_e
    out[2] = r31 * u + r32 * v + r33 * w + water_d
    out[3], out[4], out[5], out[6] = quaternion_rate(q0, q1, q2, q3, p, q, r)
    out[7], out[8], out[9] = ud, vd, wd
    out[10], out[11], out[12] = pd, qd, rd
    out[13], out[14], out[15] = ds, dl, db


@kernel
def normalise_attitude(x):
    """Scale the quaternion in x back to unit length: rounding and the integrator let it drift."""
    scale = 1.0 / math.sqrt(x[3] * x[3] + x[4] * x[4] + x[5] * x[5] + x[6] * x[6])
    for i in range(3, 7):
        x[i] *= scale


@kernel
def nominal_step(P, x, cmd_servo, cmd_slider, cmd_ballast, water_n, water_e, water_d, dt, work):
    """One step of the classical fourth-order Runge-Kutta method, in place; work is (5, N_X) of scratch."""
    k1, k2, k3, k4, y = work[0], work[1], work[2], work[3], work[4]
    nominal_derivative(P, x, cmd_servo, cmd_slider, cmd_ballast, water_n, water_e, water_d, k1)
    for i in range(N_X):
        y[i] = x[i] + 0.5 * dt * k1[i]
    nominal_derivative(P, y, cmd_servo, cmd_slider, cmd_ballast, water_n, water_e, water_d, k2)
    for i in range(N_X):
        y[i] = x[i] + 0.5 * dt * k2[i]
    nominal_derivative(P, y, cmd_servo, cmd_slider, cmd_ballast, water_n, water_e, water_d, k3)
    for i in range(N_X):
        y[i] = x[i] + dt * k3[i]
    nominal_derivative(P, y, cmd_servo, cmd_slider, cmd_ballast, water_n, water_e, water_d, k4)
    for i in range(N_X):
        x[i] += dt / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
    normalise_attitude(x)


@kernel
def nominal_run(P, x, cmd_servo, cmd_slider, cmd_ballast, water_n, water_e, water_d, dt, steps, work):
    """`steps` Runge-Kutta steps under held commands, in place."""
    for _ in range(steps):
        nominal_step(P, x, cmd_servo, cmd_slider, cmd_ballast, water_n, water_e, water_d, dt, work)
