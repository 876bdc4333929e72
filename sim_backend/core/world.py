"""A world moved in time: plant steps, sensors sampled at their own rates and delivered after their own delays.

A world is a handful of arrays (sim_backend/world.py makes them); the same kernels move one world under the real runtime
and thousands in a campaign.
"""

from firmware.core.jit import kernel
from firmware.core.layout import PLUNGER_AREA, G
from firmware.core.rotations import euler_from_quaternion
from hal.ports import BEACON, IMU, PLUNGER_WIRE, SLIDER_WIRE
from sim_backend.core import layout as at
from sim_backend.core.noise import gaussian
from sim_backend.core.plant import hold_disturbance, rk4_step


@kernel
def measured(errors, seed, value, index, count):
    """A true value as its sensor reads it: bias plus white noise number `count`."""
    noise = errors[1, index]
    if noise > 0.0:
        value += noise * gaussian(seed, at.STREAM_SENSORS + index, count)
    return value + errors[0, index]


@kernel
def take_sample(P, E, errors, seed, x, t, sensor, count, slot):
    """Write the values of sample number `count` of a sensor behind slot's two times."""
    if sensor == at.S_IMU:
        phi, theta, psi = euler_from_quaternion(x[3], x[4], x[5], x[6])
        slot[2] = measured(errors, seed, phi, 0, count)
        slot[3] = measured(errors, seed, theta, 1, count)
        slot[4] = measured(errors, seed, psi, 2, count)
        for i in range(3):
            slot[5 + i] = measured(errors, seed, x[10 + i], 3 + i, count)
    elif sensor == at.S_BEACON:
        depth = measured(errors, seed, x[2], at.E_DEPTH, count)
        slot[2] = E[at.SURFACE_PRESSURE] + E[at.WATER_DENSITY] * G * depth
        slot[3] = E[at.TEMPERATURE_C]
    elif sensor == at.S_SLIDER:
        slot[2] = measured(errors, seed, x[14], at.E_SLIDER, count)
    elif sensor == at.S_PLUNGER:
        slot[2] = measured(errors, seed, x[15], at.E_BALLAST, count) / (E[at.WATER_DENSITY] * P[PLUNGER_AREA])


@kernel
def sample_sensors(P, E, sensors, errors, seed, x, t, counters, ring):
    """Sample every sensor whose time has come into its delay line."""
    for sensor in range(at.N_SENSORS):
        count = counters[at.C_SAMPLES + sensor]
        if t < count * sensors[sensor, at.SENSOR_PERIOD] - 1e-9:
            continue
        counters[at.C_SAMPLES + sensor] = count + 1
        slot = ring[sensor, count % at.RING]
        slot[0] = t + sensors[sensor, at.SENSOR_DELAY]
        slot[1] = t
        take_sample(P, E, errors, seed, x, t, sensor, count, slot)


@kernel
def deliver(sensors, t, counters, ring, frame):
    """Write the newest sample that has arrived by time t of every sensor into the frame."""
    for sensor in range(at.N_SENSORS):
        start, width = IMU, 6
        if sensor == at.S_BEACON:
            start, width = BEACON, 2
        elif sensor == at.S_SLIDER:
            start, width = SLIDER_WIRE, 1
        elif sensor == at.S_PLUNGER:
            start, width = PLUNGER_WIRE, 1
        taken = counters[at.C_TAKEN + sensor]
        newest = -1
        while taken < counters[at.C_SAMPLES + sensor] and ring[sensor, taken % at.RING, 0] <= t + 1e-9:
            newest = taken
            taken += 1
        counters[at.C_TAKEN + sensor] = taken
        if newest >= 0:
            slot = ring[sensor, newest % at.RING]
            frame[start] = slot[1]
            frame[start + 1] = 1.0
            for i in range(width):
                frame[start + 2 + i] = slot[2 + i]


@kernel
def write_truth(t, x, out):
    """Time, position, Euler angles, nu and actuators of the plant, into out (16,)."""
    out[0] = t
    for i in range(3):
        out[1 + i] = x[i]
    out[4], out[5], out[6] = euler_from_quaternion(x[3], x[4], x[5], x[6])
    for i in range(9):
        out[7 + i] = x[7 + i]


@kernel
def advance(P, E, waves, sensors, errors, seed, x, cmd, acc, counters, ring, frame, work, dt, t_end):
    """Move the world to t_end in steps of dt, sampling on the way, then deliver what has arrived. Returns its time."""
    t = counters[at.C_STEP] * dt
    while t < t_end - 0.5 * dt:
        hold_disturbance(E, seed, counters, t, acc)
        rk4_step(P, E, waves, x, cmd, t, dt, acc, work)
        counters[at.C_STEP] += 1
        t = counters[at.C_STEP] * dt
        sample_sensors(P, E, sensors, errors, seed, x, t, counters, ring)
    deliver(sensors, t, counters, ring, frame)
    return t
