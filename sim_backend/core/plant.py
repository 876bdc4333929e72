"""The simulated vehicle in its environment: equation (1) in moving water, with surface, floor and disturbance.

One derivative for everything: the nominal flight is the case in which the environment's terms are zero.
"""

import math

from firmware.core.estimation.estimator_layout import DISTURBANCE_HOLD
from firmware.core.jit import kernel
from firmware.core.maths.rotations import quaternion_rate, rotation_nb
from firmware.core.vehicle.actuators import actuator_rates
from firmware.core.vehicle.flight import normalise_attitude
from firmware.core.vehicle.layout import GRAVITY, M_T, N_X
from firmware.core.vehicle.motion import accelerations
from sim_backend.core import layout as wl
from sim_backend.core.noise import gaussian


@kernel
def water_velocity(E, waves, north, east, down, t):
    """Velocity of the water at a place and time, m/s NED: current, shear, and surface waves dying out with depth.

    Waves by linear theory in deep water: amplitude a, k = omega^2 / g, orbital speed a omega exp(-k Z).
    """
    vn = E[wl.ENV_CURRENT_N] + E[wl.ENV_SHEAR_N] * down
    ve = E[wl.ENV_CURRENT_E] + E[wl.ENV_SHEAR_E] * down
    vd = 0.0
    for i in range(waves.shape[0]):
        omega, kn, ke = waves[i, wl.WAVE_OMEGA], waves[i, wl.WAVE_K_N], waves[i, wl.WAVE_K_E]
        k = math.sqrt(kn * kn + ke * ke)
        phase = kn * north + ke * east - omega * t + waves[i, wl.WAVE_PHASE]
        speed = waves[i, wl.WAVE_AMPLITUDE] * omega * math.exp(-k * max(down, 0.0))
        vn += speed * math.cos(phase) * kn / k
        ve += speed * math.cos(phase) * ke / k
        vd -= speed * math.sin(phase)
    return vn, ve, vd


@kernel
def boundary_force(P, E, down, down_rate):
    """Downward force (N) at the surface, where buoyancy is lost, and on the floor, a stiff damped spring."""
    force = 0.0
    if E[wl.ENV_SURFACE_HEIGHT] > 0.0 and down < 0.0:
        force += P[M_T] * GRAVITY * min(1.0, -down / E[wl.ENV_SURFACE_HEIGHT])
    if E[wl.ENV_FLOOR_DEPTH] > 0.0 and down > E[wl.ENV_FLOOR_DEPTH]:
        force -= max(0.0, wl.FLOOR_STIFFNESS * (down - E[wl.ENV_FLOOR_DEPTH]) + wl.FLOOR_DAMPING * down_rate)
    return force


@kernel
def derivative(P, E, waves, x, cmd, t, acc, out):
    """dx/dt into out[0:N_X]; cmd (3,) commands in force, acc (6,) disturbance acceleration, t seconds."""
    q0, q1, q2, q3 = x[3], x[4], x[5], x[6]
    u, v, w, p, q, r = x[7], x[8], x[9], x[10], x[11], x[12]
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation_nb(q0, q1, q2, q3)
    vn, ve, vd = water_velocity(E, waves, x[0], x[1], x[2], t)
    down_rate = r31 * u + r32 * v + r33 * w + vd
    pressed = boundary_force(P, E, x[2], down_rate)
    ds, dl, db = actuator_rates(P, x[13], x[14], x[15], cmd[0], cmd[1], cmd[2])
    ud, wd_, wd, pd, qd, rd = accelerations(
        P, r31, r32, r33, u, v, w, p, q, r, x[13], x[14], x[15], ds, dl, db,
        pressed * r31, pressed * r32, pressed * r33, 0.0, 0.0, 0.0,
    )  # fmt: skip
    out[0] = r11 * u + r12 * v + r13 * w + vn
    out[1] = r21 * u + r22 * v + r23 * w + ve
    out[2] = down_rate
    out[3], out[4], out[5], out[6] = quaternion_rate(q0, q1, q2, q3, p, q, r)
    out[7], out[8], out[9] = ud + acc[0], wd_ + acc[1], wd + acc[2]
    out[10], out[11], out[12] = pd + acc[3], qd + acc[4], rd + acc[5]
    out[13], out[14], out[15] = ds, dl, db


@kernel
def rk4_step(P, E, waves, x, cmd, t, dt, acc, work):
    """One classical Runge-Kutta step of the plant, in place; work is (5, N_X) of scratch."""
    k1, k2, k3, k4, y = work[0], work[1], work[2], work[3], work[4]
    half = 0.5 * dt
    derivative(P, E, waves, x, cmd, t, acc, k1)
    for i in range(N_X):
        y[i] = x[i] + half * k1[i]
    derivative(P, E, waves, y, cmd, t + half, acc, k2)
    for i in range(N_X):
        y[i] = x[i] + half * k2[i]
    derivative(P, E, waves, y, cmd, t + half, acc, k3)
    for i in range(N_X):
        y[i] = x[i] + dt * k3[i]
    derivative(P, E, waves, y, cmd, t + dt, acc, k4)
    for i in range(N_X):
        x[i] += dt / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
    normalise_attitude(x)


@kernel
def hold_disturbance(E, seed, counters, t, acc):
    """Refresh the disturbance acceleration when its 0.1 s are over; the same t always gives the same numbers."""
    hold = int(t / DISTURBANCE_HOLD + 1e-9)
    if hold == counters[wl.C_HOLD]:
        return
    counters[wl.C_HOLD] = hold
    for i in range(6):
        strength = E[wl.ENV_ACC_LINEAR] if i < 3 else E[wl.ENV_ACC_ANGULAR]
        acc[i] = strength * gaussian(seed, wl.STREAM_DISTURBANCE + i, hold) if strength > 0.0 else 0.0
