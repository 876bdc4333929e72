"""The simulated vehicle in its environment: the nominal one in moving water, with surface, floor and disturbance."""

from glider.firmware.core.jit import kernel
from glider.firmware.core.layouts.estimator_layout import DISTURBANCE_HOLD
from glider.firmware.core.maths.steps import NODE, RK4, end_stage
from glider.firmware.core.maths.wide import anywhere, where
from glider.firmware.core.vehicle.actuators import actuator_rates
from glider.firmware.core.vehicle.flight import add_accelerations, state_derivative
from glider.firmware.core.vehicle.layout import N_X, X_DOWN, X_EAST, X_NORTH
from glider.firmware.core.vehicle.state import actuators, normalise_attitude
from glider.firmware.core.vehicle.time_constants import nominal_parts
from glider.sim_backend.core import layout as wl
from glider.sim_backend.core.environment import boundary_force, water_velocity
from glider.sim_backend.core.noise import gaussian


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
    """One Runge-Kutta step of the plant, in place, in as many parts as its time constants ask for (time_constants).

    work is (3, N_X) of scratch, or more.
    """
    k, total, y = work[0], work[1], work[2]
    parts, part = nominal_parts(RK4, P, x, 0, dt), 0
    h = dt / parts
    while anywhere(part < parts):
        ahead = where(part < parts, h, 0.0)  # a lane that is there stays where it is
        for i in range(N_X):
            y[i] = x[i]
        for stage in range(len(RK4)):
            derivative(P, E, waves, y, cmd, t + part * h + RK4[stage][NODE] * ahead, acc, k)
            end_stage(RK4, stage, ahead, x, k, total, y, N_X)
        part += 1
    normalise_attitude(x)


@kernel
def hold_number(t):
    """Which of the disturbance's holds t (s) is in."""
    return int(t / DISTURBANCE_HOLD + 1e-9)


@kernel
def hold_disturbance(E, seed, counters, t, acc):
    """Refresh the disturbance acceleration when its 0.1 s are over; the same t always gives the same numbers."""
    hold = hold_number(t)
    if hold == counters[wl.C_HOLD]:
        return
    counters[wl.C_HOLD] = hold
    for i in range(6):
        strength = E[wl.ENV_ACC_LINEAR] if i < 3 else E[wl.ENV_ACC_ANGULAR]
        acc[i] = strength * gaussian(seed, wl.STREAM_DISTURBANCE + i, hold) if strength > 0.0 else 0.0
