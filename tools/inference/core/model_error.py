"""What a model lacks, found by the filter beside the state: accelerations, constant errors of the gyro, moving water.

A filter that takes a wrong model at its word pays for it where nothing is measured: a yaw moment that is off for as
long as the vehicle turns ends up as a sideslip that is not there, and with it every window would start. So a filter
that finds starts has N_MODEL_ERROR states more: accelerations as large as the parameters' uncertainty makes them, which
fade over a flight's manoeuvres; gyro biases; the water's velocity. Windows fly on without.
"""

import math

import numpy as np

from glider.firmware.core.jit import allocating_kernel, kernel
from glider.firmware.core.vehicle.layout import N_P, N_X, X_NU, X_POS
from glider.firmware.core.vehicle.linearise import model_error
from glider.firmware.core.vehicle.state import rotation
from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.inference.core.error_layout import E_POS, N_ERR

L_GYRO, L_WATER = 6, 9  # of the model error, behind m/s2 and rad/s2 (body): rad/s, m/s north and east
N_MODEL_ERROR = 11
D_TIME, D_GYRO, D_WATER = 0, 1, 2  # drift: s over which accelerations fade; walks, (rad/s)2/s and (m/s)2/s
N_DRIFT = 3
# 1 sigma before the first measurement; of the accelerations it is the parameters'
MODEL_ERROR_SD = (*6 * (0.0,), *3 * (0.003,), *2 * (0.05,))  # rad/s, m/s


@kernel
def step_model_error(drift, x, error_states, dt):
    """A step of dt of the model error (N_MODEL_ERROR), in place, and of the position that the water carries."""
    fade = math.exp(-dt / drift[D_TIME])
    for j in range(L_GYRO):
        error_states[j] *= fade
    for j in range(2):
        x[X_POS + j] += dt * error_states[L_WATER + j]


@kernel
def model_error_columns(drift, dt, Gam, Phi):
    """The model error's columns of Phi; Gam (N_ERR, 6) is the step's derivative by accelerations."""
    fade = math.exp(-dt / drift[D_TIME])
    for j in range(L_GYRO):
        for a in range(N_ERR):
            Phi[a, N_ERR + j] = Gam[a, j]
        Phi[N_ERR + j, N_ERR + j] = fade
    for j in range(L_GYRO, N_MODEL_ERROR):
        Phi[N_ERR + j, N_ERR + j] = 1.0
    for j in range(2):
        Phi[E_POS + j, N_ERR + L_WATER + j] = dt


@allocating_kernel
def add_model_error(P, sigma, x, share, work, cov):
    """A share of the accelerations' covariance that parameters of 1 sigma (N_P) leave at x, to the model error's in
    cov.
    """
    point, C, Pt, g = work[0], np.empty((6, 6)), np.empty(N_P), work[1]
    _, _, _, _, _, _, point[0], point[1], point[2] = rotation(x)
    for n in range(N_X - X_NU):
        point[3 + n] = x[X_NU + n]
    model_error(P, sigma, 0.0, 0.0, 0.0, point, C, Pt, g)
    for i in range(6):
        for j in range(6):
            cov[N_ERR + i, N_ERR + j] += share * C[i, j]


@kernel
def add_drift(P, sigma, drift, x, dt, work, cov):
    """What dt adds to the model error's covariance: as much of the model's error as keeps it where it is, and walks."""
    add_model_error(P, sigma, x, 1.0 - math.exp(-2.0 * dt / drift[D_TIME]), work, cov)
    for j in range(3):
        cov[N_ERR + L_GYRO + j, N_ERR + L_GYRO + j] += drift[D_GYRO] * dt
    for j in range(2):
        cov[N_ERR + L_WATER + j, N_ERR + L_WATER + j] += drift[D_WATER] * dt


@kernel
def take_gyro_bias(error_states, d):
    """Take the gyro's errors out of innovations d (N_Y)."""
    for j in range(3):
        d[ef.Y_P + j] -= error_states[L_GYRO + j]
