"""The plant with any number of effects, one step at a time: what simulation, prediction and diagnosis fly.

A flight is (P, F): `effective_parameters` makes of them what holds throughout; what depends on the state is added in
`effect_derivative`; backlash and lags, which are memories and not derivatives, move in `update_effect_states`. The
physics stand in sim_backend/core/effects, a file for each stage. Where no effect is set, nothing of this runs: a
nominal vehicle flies the plain plant.
"""

from glider.firmware.core.jit import kernel
from glider.firmware.core.maths.steps import NODE, RK4, end_stage
from glider.firmware.core.maths.wide import anywhere, where
from glider.firmware.core.vehicle.flight import add_accelerations, body_derivative
from glider.firmware.core.vehicle.layout import N_P, N_X, X_BALLAST, X_DOWN, X_EAST, X_NORTH, X_SERVO, X_SLIDER
from glider.firmware.core.vehicle.state import normalise_attitude, rotation, velocities
from glider.firmware.core.vehicle.time_constants import damping_rate, lag_rate, parts_of
from glider.sim_backend.core import layout as wl
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.actuation import effective_actuators, geared, motor_speeds, update_gears
from glider.sim_backend.core.effects.correction import correction, link_of
from glider.sim_backend.core.effects.hydrodynamics import current, effective_coefficients, extra_rate, extra_wrench
from glider.sim_backend.core.effects.mass import effective_masses, net_mass_of_depth, slider_mass, tank_mass
from glider.sim_backend.core.effects.sensing import before_lags, update_lags
from glider.sim_backend.core.effects.timing import delayed_commands
from glider.sim_backend.core.environment import boundary_force, water_velocity


@kernel
def effective_parameters(P, F, out):
    """The parameters (N_P) that hold throughout a flight of P with effects F (N_F), into out."""
    for i in range(N_P):
        out[i] = P[i]
    effective_actuators(P, F, out)
    effective_coefficients(F, out)
    effective_masses(F, out)


@kernel
def set_effects(P, F, effective):
    """Whether any entry of F is set; if so, `effective` (N_P) becomes what holds throughout the flight."""
    for i in range(ef.N_F):
        if F[i] != 0.0:
            effective_parameters(P, F, effective)
            return True
    return False


@kernel
def effect_derivative(P, F, x, mode, c_servo, c_slider, c_ballast, since, acc, force, water, out):
    """dx/dt into out[0:N_X] of effective parameters P with effects F.

    x (N_XF); c_... commands, or speeds where `mode` says so; since (s) from the run's start; acc (6) accelerations
    added to nu_dot; force (N) downward at the origin; water (3) m/s NED beside the current of F.
    """
    _, _, _, _, _, _, kx, _, _ = rotation(x)
    u, v, w, p, q, r = velocities(x)
    depth = x[X_DOWN]
    ds, dl, db = motor_speeds(P, F, x, mode, c_servo, c_slider, c_ballast)
    servo, slider, servo_rate, slider_rate = geared(F, x, ds, dl)
    slider, slider_rate = slider_mass(F, slider, slider_rate)
    tank, tank_rate = tank_mass(F, x[X_BALLAST], db, since)
    X, Y, Z, K, M, N = extra_wrench(P, F, kx, depth, u, v, w, p, q, r)
    link = link_of(F)
    if 0 < link <= ef.ACTUATOR_LINKS:
        more = correction(F, x, since, db)
        X += more if link == 1 else 0.0
        Y += more if link == 2 else 0.0
        Z += more if link == 3 else 0.0
        K += more if link == 4 else 0.0
        M += more if link == 5 else 0.0
        N += more if link == 6 else 0.0
        servo += more if link == 7 else 0.0
        slider += more if link == 8 else 0.0
        tank += more if link == 9 else 0.0
    north, east = current(F, depth)
    body_derivative(
        P, x, servo, slider, tank, servo_rate, slider_rate, tank_rate, net_mass_of_depth(F, depth), X, Y, Z, K, M, N,
        force, north + water[0], east + water[1], water[2], out,
    )  # fmt: skip
    add_accelerations(acc, 0, out)
    out[X_SERVO], out[X_SLIDER], out[X_BALLAST] = ds, dl, db


@kernel
def update_effect_states(F, x, before, dt):
    """What effects remember after a step of dt: gears behind their backlash, and how far lagging readings are behind.

    before: as sensing.before_lags left it at the step's start.
    """
    update_gears(F, x)
    update_lags(F, x, before, dt)


@kernel
def effect_parts(method, P, F, x, mode, dt):
    """Return the number of parts that a step of dt (s) of (P effective, F) from x on needs (time_constants)."""
    return parts_of(method, dt * max(damping_rate(P, x) + extra_rate(P, F, x), lag_rate(P, mode)))


@kernel
def effect_step(method, P, F, x, mode, c_servo, c_slider, c_ballast, since, acc, force, water, dt, parts, work):
    """One step of (P effective, F) by a method of firmware/core/maths/steps, in place, in `parts` equal parts.

    x (N_XF); work (4, N_XF) of scratch, or more; the others as in effect_derivative. What the effects remember moves
    once a step.
    """
    k, total, y, before = work[0], work[1], work[2], work[3]
    before_lags(F, x, before)
    h, part = dt / parts, 0
    while anywhere(part < parts):
        ahead = where(part < parts, h, 0.0)  # a lane that is there stays where it is
        for i in range(ef.N_XF):
            y[i] = x[i]
        for stage in range(len(method)):
            now = since + part * h + method[stage][NODE] * ahead
            effect_derivative(P, F, y, mode, c_servo, c_slider, c_ballast, now, acc, force, water, k)
            end_stage(method, stage, ahead, x, k, total, y, N_X)
        part += 1
    normalise_attitude(x)
    update_effect_states(F, x, before, dt)


@kernel
def commands_in_force(F, cmd, step, dt, queue, wanted):
    """The commands that a step flies by into wanted (3,): cmd (3,), or what it was a delay ago."""
    if F[ef.COMMAND_DELAY] > 0.0:
        delayed_commands(queue, cmd, step, F[ef.COMMAND_DELAY], dt, wanted)
    else:
        wanted[0], wanted[1], wanted[2] = cmd[0], cmd[1], cmd[2]


@kernel
def effect_sea_step(P, F, E, waves, x, wanted, t, dt, acc, work):
    """One step of effective parameters P with effects F in this environment from time t on, in place.

    wanted (3,): commands in force. The environment's water is that of the middle of the step, the force of surface and
    floor that of its start.
    """
    water = work[wl.W_WATER, 0:3]
    water[0], water[1], water[2] = water_velocity(E, waves, x[X_NORTH], x[X_EAST], x[X_DOWN], t + 0.5 * dt)
    force = boundary_force(P, E, x, water[2])
    parts = effect_parts(RK4, P, F, x, 0, dt)
    effect_step(RK4, P, F, x, 0, wanted[0], wanted[1], wanted[2], t, acc, force, water, dt, parts, work)


@kernel
def effect_world_step(P, F, E, waves, x, cmd, step, dt, acc, queue, work):
    """One step (number `step`) of effective parameters P with effects F in this environment, in place.

    work is (N_WORK, WORK_WIDTH) of scratch.
    """
    wanted = work[wl.W_WATER, 3:6]
    commands_in_force(F, cmd, step, dt, queue, wanted)
    effect_sea_step(P, F, E, waves, x, wanted, step * dt, dt, acc, work)
