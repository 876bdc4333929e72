"""A world moved in time: plant steps, sensors sampled at their own rates and delivered after their own delays.

A world is a handful of arrays (sim_backend/world.py makes them); the same kernels move one world under the real runtime
and thousands in a campaign.
"""

from glider.firmware.core.jit import kernel
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.core.vehicle.layout import GRAVITY, PLUNGER_AREA, X_NU, X_POS
from glider.firmware.core.vehicle.state import euler_angles
from glider.hal.ports import BEACON, IMU, PLUNGER_WIRE, SLIDER_WIRE
from glider.sim_backend.core import layout as wl
from glider.sim_backend.core.effect_plant import effect_world_step, set_effects
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.sensing import read, read_state
from glider.sim_backend.core.noise import gaussian
from glider.sim_backend.core.plant import hold_disturbance, plant_step


@kernel
def measured(errors, seed, value, index, count):
    """A true value as its sensor reads it: bias plus white noise number `count`."""
    noise = errors[1, index]
    if noise > 0.0:
        value += noise * gaussian(seed, wl.STREAM_SENSORS + index, count)
    return value + errors[0, index]


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
def sample_reading(sensors, y, t, counters, ring):
    """Sample every sensor whose time has come into its delay line: y (N_Y) is what they read without noise."""
    for sensor in range(wl.N_SAMPLED):
        count = due_slot(sensors, sensor, t, counters, ring)
        if count < 0:
            continue
        slot = ring[sensor, count % wl.DELAY_SLOTS]
        if sensor == sup.SENSOR_IMU:
            for i in range(6):
                slot[2 + i] = y[ef.Y_ROLL + i]
        elif sensor == sup.SENSOR_BEACON:
            slot[2] = y[ef.Y_DEPTH]
        elif sensor == sup.SENSOR_SLIDER:
            slot[2] = y[ef.Y_SLIDER]
        elif sensor == sup.SENSOR_PLUNGER:
            slot[2] = y[ef.Y_BALLAST]


@kernel
def read_world(F, effects, x, y):
    """What the sensors read at x without noise into y (at least N_Y); effects: whether any of F is set."""
    if effects:
        read(F, x, y)
    else:
        read_state(x, y)


@kernel
def sample_sensors(F, effects, sensors, x, t, counters, ring, y):
    """Sample every sensor whose time has come: the state x, or with effects what `read` says of it; y is scratch."""
    for sensor in range(wl.N_SAMPLED):
        if is_due(sensors, sensor, t, counters):
            read_world(F, effects, x, y)
            sample_reading(sensors, y, t, counters, ring)
            return


@kernel
def write_sample(P, E, errors, seed, sensor, slot, count, frame):
    """Sample number `count` of a sensor, which its slot has without noise, into the frame."""
    start = IMU
    if sensor == sup.SENSOR_IMU:
        for i in range(6):
            frame[IMU + 2 + i] = measured(errors, seed, slot[2 + i], wl.E_ROLL + i, count)
    elif sensor == sup.SENSOR_BEACON:
        start = BEACON
        depth = measured(errors, seed, slot[2], wl.E_DEPTH, count)
        frame[BEACON + 2] = E[wl.ENV_SURFACE_PRESSURE] + E[wl.ENV_WATER_DENSITY] * GRAVITY * depth
        frame[BEACON + 3] = E[wl.ENV_TEMPERATURE_C]
    elif sensor == sup.SENSOR_SLIDER:
        start = SLIDER_WIRE
        frame[SLIDER_WIRE + 2] = measured(errors, seed, slot[2], wl.E_SLIDER, count)
    elif sensor == sup.SENSOR_PLUNGER:
        start = PLUNGER_WIRE
        mass = measured(errors, seed, slot[2], wl.E_BALLAST, count)  # the draw-wire sees it as a length
        frame[PLUNGER_WIRE + 2] = mass / (E[wl.ENV_WATER_DENSITY] * P[PLUNGER_AREA])
    frame[start] = slot[1]
    frame[start + 1] = 1.0


@kernel
def deliver(P, E, sensors, errors, seed, t, counters, ring, frame):
    """Write the newest sample that has arrived by time t of every sensor into the frame, its noise with it.

    Noise goes by the sample's number: that of a sample which a newer one has overtaken is never worked out.
    """
    for sensor in range(wl.N_SAMPLED):
        taken = counters[wl.C_TAKEN + sensor]
        newest = -1
        while taken < counters[wl.C_SAMPLES + sensor] and ring[sensor, taken % wl.DELAY_SLOTS, 0] <= t + 1e-9:
            newest = taken
            taken += 1
        counters[wl.C_TAKEN + sensor] = taken
        if newest >= 0:
            write_sample(P, E, errors, seed, sensor, ring[sensor, newest % wl.DELAY_SLOTS], newest, frame)


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
def move(P, F, E, waves, sensors, seed, x, cmd, acc, counters, ring, work, dt, t_end):
    """Step and sample to t_end, no effect being set: kept apart, for it is what most flights are. Returns the time."""
    t = counters[wl.C_STEP] * dt
    if counters[wl.C_STEP] == 0:
        sample_sensors(F, False, sensors, x, t, counters, ring, work[wl.W_READ])
    while t < t_end - 0.5 * dt:
        hold_disturbance(E, seed, counters, t, acc)
        plant_step(P, E, waves, x, cmd, t, dt, acc, work)
        counters[wl.C_STEP] += 1
        t = counters[wl.C_STEP] * dt
        sample_sensors(F, False, sensors, x, t, counters, ring, work[wl.W_READ])
    return t


@kernel
def move_with_effects(effective, F, E, waves, sensors, seed, x, cmd, acc, counters, ring, queue, work, dt, t_end):
    """The same with effects F, effective (N_P) being what holds throughout."""
    t = counters[wl.C_STEP] * dt
    if counters[wl.C_STEP] == 0:
        sample_sensors(F, True, sensors, x, t, counters, ring, work[wl.W_READ])
    while t < t_end - 0.5 * dt:
        hold_disturbance(E, seed, counters, t, acc)
        effect_world_step(effective, F, E, waves, x, cmd, counters[wl.C_STEP], dt, acc, queue, work)
        counters[wl.C_STEP] += 1
        t = counters[wl.C_STEP] * dt
        sample_sensors(F, True, sensors, x, t, counters, ring, work[wl.W_READ])
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
            effective, F, E, waves, sensors, seed, x, cmd, acc, counters, ring, queue, work, dt, t_end
        )  # fmt: skip
    else:
        t = move(P, F, E, waves, sensors, seed, x, cmd, acc, counters, ring, work, dt, t_end)
    deliver(P, E, sensors, errors, seed, t, counters, ring, frame)
    return t
