"""A world moved in time: plant steps, sensors sampled at their own rates and delivered after their own delays.

A world is a handful of arrays (sim_backend/world.py makes them); the same kernels move one world under the real runtime
and thousands in a campaign.
"""

from firmware.core.jit import kernel
from firmware.core.layouts import supervisor_layout as sup
from firmware.core.vehicle.layout import GRAVITY, PLUNGER_AREA, X_NU, X_POS
from firmware.core.vehicle.state import euler_angles
from hal.ports import BEACON, IMU, PLUNGER_WIRE, SLIDER_WIRE
from sim_backend.core import layout as wl
from sim_backend.core.effect_plant import effect_world_step, set_effects
from sim_backend.core.effects import effect_layout as ef
from sim_backend.core.effects.sensing import read, read_state
from sim_backend.core.noise import gaussian
from sim_backend.core.plant import hold_disturbance, plant_step


@kernel
def measured(errors, seed, value, index, count):
    """A true value as its sensor reads it: bias plus white noise number `count`."""
    noise = errors[1, index]
    if noise > 0.0:
        value += noise * gaussian(seed, wl.STREAM_SENSORS + index, count)
    return value + errors[0, index]


@kernel
def write_imu(errors, seed, roll, pitch, yaw, p, q, r, count, slot):
    """Sample number `count` of the IMU behind slot's two times."""
    slot[2] = measured(errors, seed, roll, wl.E_ROLL, count)
    slot[3] = measured(errors, seed, pitch, wl.E_PITCH, count)
    slot[4] = measured(errors, seed, yaw, wl.E_YAW, count)
    slot[5] = measured(errors, seed, p, wl.E_P, count)
    slot[6] = measured(errors, seed, q, wl.E_Q, count)
    slot[7] = measured(errors, seed, r, wl.E_R, count)


@kernel
def write_beacon(E, errors, seed, depth, count, slot):
    """The same of the beacon: pressure and temperature."""
    depth = measured(errors, seed, depth, wl.E_DEPTH, count)
    slot[2] = E[wl.ENV_SURFACE_PRESSURE] + E[wl.ENV_WATER_DENSITY] * GRAVITY * depth
    slot[3] = E[wl.ENV_TEMPERATURE_C]


@kernel
def write_plunger(P, E, errors, seed, ballast, count, slot):
    """The same of the plunger's draw-wire, which sees the ballast's mass as a length."""
    slot[2] = measured(errors, seed, ballast, wl.E_BALLAST, count) / (E[wl.ENV_WATER_DENSITY] * P[PLUNGER_AREA])


@kernel
def is_due(sensors, sensor, t, counters):
    """Whether it is time for a sensor's next sample."""
    return t >= counters[wl.C_SAMPLES + sensor] * sensors[sensor, wl.SENSOR_PERIOD] - 1e-9


@kernel
def due_slot(sensors, sensor, t, counters, ring):
    """Number of the sample that a sensor has to take now, its slot stamped; -1: it is not time."""
    if not is_due(sensors, sensor, t, counters):
        return -1
    count = counters[wl.C_SAMPLES + sensor]
    counters[wl.C_SAMPLES + sensor] = count + 1
    slot = count % wl.DELAY_SLOTS
    ring[sensor, slot, 0] = t + sensors[sensor, wl.SENSOR_DELAY]
    ring[sensor, slot, 1] = t
    return count


@kernel
def sample_reading(P, E, sensors, errors, seed, y, t, counters, ring):
    """Sample every sensor whose time has come into its delay line: y (N_Y) is what they read without noise."""
    for sensor in range(wl.N_SAMPLED):
        count = due_slot(sensors, sensor, t, counters, ring)
        if count < 0:
            continue
        slot = ring[sensor, count % wl.DELAY_SLOTS]
        if sensor == sup.SENSOR_IMU:
            write_imu(
                errors, seed, y[ef.Y_ROLL], y[ef.Y_PITCH], y[ef.Y_YAW], y[ef.Y_P], y[ef.Y_Q], y[ef.Y_R], count, slot
            )
        elif sensor == sup.SENSOR_BEACON:
            write_beacon(E, errors, seed, y[ef.Y_DEPTH], count, slot)
        elif sensor == sup.SENSOR_SLIDER:
            slot[2] = measured(errors, seed, y[ef.Y_SLIDER], wl.E_SLIDER, count)
        elif sensor == sup.SENSOR_PLUNGER:
            write_plunger(P, E, errors, seed, y[ef.Y_BALLAST], count, slot)


@kernel
def read_world(F, effects, x, y):
    """What the sensors read at x without noise into y (at least N_Y); effects: whether any of F is set."""
    if effects:
        read(F, x, y)
    else:
        read_state(x, y)


@kernel
def sample_sensors(P, F, effects, E, sensors, errors, seed, x, t, counters, ring, y):
    """Sample every sensor whose time has come: the state x, or with effects what `read` says of it; y is scratch."""
    for sensor in range(wl.N_SAMPLED):
        if is_due(sensors, sensor, t, counters):
            read_world(F, effects, x, y)
            sample_reading(P, E, sensors, errors, seed, y, t, counters, ring)
            return


@kernel
def deliver(sensors, t, counters, ring, frame):
    """Write the newest sample that has arrived by time t of every sensor into the frame."""
    for sensor in range(wl.N_SAMPLED):
        start, width = IMU, 6
        if sensor == sup.SENSOR_BEACON:
            start, width = BEACON, 2
        elif sensor == sup.SENSOR_SLIDER:
            start, width = SLIDER_WIRE, 1
        elif sensor == sup.SENSOR_PLUNGER:
            start, width = PLUNGER_WIRE, 1
        taken = counters[wl.C_TAKEN + sensor]
        newest = -1
        while taken < counters[wl.C_SAMPLES + sensor] and ring[sensor, taken % wl.DELAY_SLOTS, 0] <= t + 1e-9:
            newest = taken
            taken += 1
        counters[wl.C_TAKEN + sensor] = taken
        if newest >= 0:
            slot = ring[sensor, newest % wl.DELAY_SLOTS]
            frame[start] = slot[1]
            frame[start + 1] = 1.0
            for i in range(width):
                frame[start + 2 + i] = slot[2 + i]


@kernel
def write_truth(t, x, out):
    """Time, position, Euler angles, nu and actuators of the plant, into out (16,)."""
    out[0] = t
    for i in range(3):
        out[1 + i] = x[X_POS + i]
    out[4], out[5], out[6] = euler_angles(x)
    for i in range(9):
        out[7 + i] = x[X_NU + i]


@kernel
def move(P, F, E, waves, sensors, errors, seed, x, cmd, acc, counters, ring, work, dt, t_end):
    """Step and sample to t_end, no effect being set: kept apart, for it is what most flights are. Returns the time."""
    t = counters[wl.C_STEP] * dt
    if counters[wl.C_STEP] == 0:
        sample_sensors(P, F, False, E, sensors, errors, seed, x, t, counters, ring, work[wl.W_READ])
    while t < t_end - 0.5 * dt:
        hold_disturbance(E, seed, counters, t, acc)
        plant_step(P, E, waves, x, cmd, t, dt, acc, work)
        counters[wl.C_STEP] += 1
        t = counters[wl.C_STEP] * dt
        sample_sensors(P, F, False, E, sensors, errors, seed, x, t, counters, ring, work[wl.W_READ])
    return t


@kernel
def move_with_effects(
    P, effective, F, E, waves, sensors, errors, seed, x, cmd, acc, counters, ring, queue, work, dt, t_end
):  # fmt: skip
    """The same with effects F, effective (N_P) being what holds throughout."""
    t = counters[wl.C_STEP] * dt
    if counters[wl.C_STEP] == 0:
        sample_sensors(P, F, True, E, sensors, errors, seed, x, t, counters, ring, work[wl.W_READ])
    while t < t_end - 0.5 * dt:
        hold_disturbance(E, seed, counters, t, acc)
        effect_world_step(effective, F, E, waves, x, cmd, counters[wl.C_STEP], dt, acc, queue, work)
        counters[wl.C_STEP] += 1
        t = counters[wl.C_STEP] * dt
        sample_sensors(P, F, True, E, sensors, errors, seed, x, t, counters, ring, work[wl.W_READ])
    return t


@kernel
def advance(
    P, F, E, waves, sensors, errors, seed, x, cmd, acc, counters, ring, queue, frame, effective, work, dt, t_end
):  # fmt: skip
    """Move the world to t_end in steps of dt, sampling on the way, then deliver what has arrived. Returns its time.

    x (N_XF); queue (rows, 3) commands of the past; effective (N_P) and work (N_WORK, WORK_WIDTH) scratch. Vehicle and
    effects may have been changed since the last call.
    """
    if set_effects(P, F, effective):
        t = move_with_effects(
            P, effective, F, E, waves, sensors, errors, seed, x, cmd, acc, counters, ring, queue, work, dt, t_end
        )  # fmt: skip
    else:
        t = move(P, F, E, waves, sensors, errors, seed, x, cmd, acc, counters, ring, work, dt, t_end)
    deliver(sensors, t, counters, ring, frame)
    return t
