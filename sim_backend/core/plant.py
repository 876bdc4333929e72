"""The simulated vehicle in its environment: the nominal one in moving water, with surface, floor and disturbance."""

import math

from firmware.core.estimation.estimator_layout import DISTURBANCE_HOLD
from firmware.core.jit import kernel
from firmware.core.maths.steps import NODE, RK4, end_stage
from firmware.core.vehicle.actuators import actuator_rates
from firmware.core.vehicle.flight import add_accelerations, state_derivative
from firmware.core.vehicle.layout import GRAVITY, M_T, N_X, X_DOWN, X_EAST, X_NORTH
from firmware.core.vehicle.state import actuators, normalise_attitude, rotation, velocities
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
def boundary_force(P, E, x, water_d):
    """Downward force (N) at the surface, where buoyancy is lost, and on the floor, a stiff damped spring.

    water_d: speed of the water downward, m/s.
    """
    down, force = x[X_DOWN], 0.0
    if E[wl.ENV_SURFACE_HEIGHT] > 0.0 and down < 0.0:
        force += P[M_T] * GRAVITY * min(1.0, -down / E[wl.ENV_SURFACE_HEIGHT])
    if E[wl.ENV_FLOOR_DEPTH] > 0.0 and down > E[wl.ENV_FLOOR_DEPTH]:
        _, _, _, _, _, _, r31, r32, r33 = rotation(x)
        u, v, w, _, _, _ = velocities(x)
        down_rate = r31 * u + r32 * v + r33 * w + water_d
        force -= max(0.0, wl.FLOOR_STIFFNESS * (down - E[wl.ENV_FLOOR_DEPTH]) + wl.FLOOR_DAMPING * down_rate)
    return force


@kernel
def derivative(P, E, waves, x, cmd, t, acc, out):
    """dx/dt into out[0:N_X]; cmd (3,) commands in force, acc (6,) disturbance acceleration, t seconds."""
    servo, slider, ballast = actuators(x)
    vn, ve, vd = water_velocity(E, waves, x[X_NORTH], x[X_EAST], x[X_DOWN], t)
    force = boundary_force(P, E, x, vd)
    ds, dl, db = actuator_rates(P, servo, slider, ballast, cmd[0], cmd[1], cmd[2])
    state_derivative(P, x, ds, dl, db, force, vn, ve, vd, out)
    add_accelerations(acc, 0, out)


@kernel
def plant_step(P, E, waves, x, cmd, t, dt, acc, work):
    """One Runge-Kutta step of the plant, in place; work is (3, N_X) of scratch, or more."""
    k, total, y = work[0], work[1], work[2]
    for i in range(N_X):
        y[i] = x[i]
    for stage in range(len(RK4)):
        derivative(P, E, waves, y, cmd, t + RK4[stage][NODE] * dt, acc, k)
        end_stage(RK4, stage, dt, x, k, total, y, N_X)
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
