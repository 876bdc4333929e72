"""Equation (1) as it is linear in the twelve coefficients: momentum, its known rate of change, and the K's columns.

The terms are those that the plant flies with (firmware/core); nothing of equation (1) is written twice.
"""

import math

import numpy as np

from glider.firmware.core.jit import allocating_kernel, kernel
from glider.firmware.core.maths.matrices import copy
from glider.firmware.core.maths.rotations import rotation_nb_euler
from glider.firmware.core.vehicle.actuators import clip
from glider.firmware.core.vehicle.layout import K_D0, K_R, N_P
from glider.firmware.core.vehicle.mass import first_moment, inertia, translational_mass
from glider.firmware.core.vehicle.motion import momentum, momentum_rate
from glider.firmware.core.vehicle.water import water_wrench

N_K = K_R - K_D0 + 1


@allocating_kernel
def momentum_rows(P, attitude, nu, actuators, M, N, K):
    """Rows of d(M nu)/dt = N + K k: M (rows, 6), N (rows, 6), K (rows, 6, 12), k the coefficients of equation (4).

    attitude (rows, 3) roll, pitch, yaw; nu (rows, 6); actuators (rows, 3) servo, slider, ballast. -M_dot nu stands on
    the left here, as part of the momentum's change.
    """
    unit = np.empty(N_P)
    for i in range(len(nu)):
        u, v, w, p, q, r = nu[i, 0], nu[i, 1], nu[i, 2], nu[i, 3], nu[i, 4], nu[i, 5]
        servo, slider, ballast = actuators[i, 0], actuators[i, 1], actuators[i, 2]
        R = rotation_nb_euler(attitude[i, 0], attitude[i, 1], attitude[i, 2])
        m1, m2, m3 = translational_mass(P, ballast)
        S1, S2, S3 = first_moment(P, servo, slider, ballast)
        I1, I2, I3, I12, I13, I23 = inertia(P, servo, slider, ballast)
        M[i, 0], M[i, 1], M[i, 2], M[i, 3], M[i, 4], M[i, 5] = momentum(
            m1, m2, m3, S1, S2, S3, I1, I2, I3, I12, I13, I23, u, v, w, p, q, r
        )
        N[i, 0], N[i, 1], N[i, 2], N[i, 3], N[i, 4], N[i, 5] = momentum_rate(
            P, R[6], R[7], R[8], u, v, w, p, q, r, servo, slider, ballast, 0.0, 0.0, 0.0
        )
        for k in range(N_K):
            copy(P, unit)
            unit[K_D0 : K_R + 1] = 0.0
            unit[K_D0 + k] = 1.0
            F = water_wrench(unit, u, v, w, p, q, r)
            K[i, 0, k], K[i, 1, k], K[i, 2, k], K[i, 3, k], K[i, 4, k], K[i, 5, k] = F


@kernel
def flown_servo(t, commands, low, high, rate, time_constant, out):
    """The nominal servo under its commands from 0 on, out (rows,), rad: it has no sensor.

    See docs/explanation/model.md, Actuators.

    Exact for commands held from row to row: at its full rate as long as it is far off, then by its lag.
    """
    out[:1] = 0.0
    for i in range(1, len(t)):
        wanted, dt = clip(commands[i - 1], low, high), t[i] - t[i - 1]
        off = wanted - out[i - 1]
        full = clip(abs(off) / rate - time_constant, 0.0, dt)  # s at full rate
        out[i] = wanted - (off - math.copysign(rate * full, off)) * math.exp((full - dt) / time_constant)
