"""Missions flown by the shipped autopilot in the foreign plant, one tick a row."""

import numpy as np

from glider.firmware.core.control.autopilot import reset, tick
from glider.firmware.core.jit import allocating_kernel, kernel
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.vehicle.layout import GRAVITY, N_P, PLUNGER_AREA
from glider.hal.ports import BEACON, FRAME_SIZE, IMU, PLUNGER_WIRE, SLIDER_WIRE
from glider.sim_backend.core.noise import gaussian
from glider.sim_backend.foreign import foreign_layout as fo
from glider.sim_backend.foreign.foreign_flight import move_row, read_sensors, start_memory

FRESH, TEMPERATURE_C = 998.0, 18.0  # kg/m3, deg C


@kernel
def fill_frame(P, surface_pressure, t, y, frame):
    """Readings y (N_FR,) as samples of time t in the autopilot's frame."""
    for i in range(3):
        frame[IMU + 2 + i], frame[IMU + 5 + i] = y[fo.FR_ROLL + i], y[fo.FR_P + i]
    frame[BEACON + 2] = surface_pressure + FRESH * GRAVITY * y[fo.FR_DEPTH]
    frame[BEACON + 3] = TEMPERATURE_C
    frame[SLIDER_WIRE + 2] = y[fo.FR_SLIDER]
    frame[PLUNGER_WIRE + 2] = y[fo.FR_BALLAST] / (FRESH * P[PLUNGER_AREA])
    for slot in (IMU, BEACON, SLIDER_WIRE, PLUNGER_WIRE):
        frame[slot], frame[slot + 1] = t, 1.0


@allocating_kernel
def fly_mission(P, F, waves, errors, linear, angular, seed, x, P_pilot, C, legs, nav, commands, X, Y):
    """Fly a mission (legs, N_LEG) from x (N_FX, in place); other arguments as fly_foreign.

    P_pilot (N_P,), C (N_C,), nav (N_NAV,): the autopilot's model, configuration and filter, as Autopilot makes them;
    none is changed. After the mission's end the autopilot brings the vehicle to the surface. Returns the autopilot's
    mode in the last row, and the row in which the mission ended (-1: it did not).
    """
    acc, Pw, work = np.zeros(6), np.empty(N_P), np.empty((3, fo.N_FX))
    frame, cmd, memory = np.zeros(FRAME_SIZE), np.zeros(3), nav.copy()
    est, ap = np.zeros(ctl.N_EST), np.zeros(ctl.N_AP)
    reset(est, ap, memory)
    start_memory(F, x)
    ended = -1
    for row in range(X.shape[0]):
        t = row * fo.ROW_S
        for i in range(fo.N_FX):
            X[row, i] = x[i]
        read_sensors(F, x, t, Y[row])
        for i in range(fo.N_FR):
            Y[row, i] += errors[0, i] + errors[1, i] * gaussian(seed, fo.STREAM_NOISE + i, row)
        fill_frame(P_pilot, C[ctl.SURFACE_PRESSURE], t, Y[row], frame)
        tick(P_pilot, C, legs, frame, est, ap, memory, cmd, t)
        if ended < 0 and ap[ctl.MODE] >= ctl.COMPLETED:
            ended = row
        for i in range(3):
            commands[row, i] = cmd[i]
        for i in range(6):
            acc[i] = (linear if i < 3 else angular) * gaussian(seed, fo.STREAM_PUSH + i, row)
        move_row(P, F, waves, seed, x, commands, row, acc, linear, angular, True, Pw, work)
    return ap[ctl.MODE], ended
