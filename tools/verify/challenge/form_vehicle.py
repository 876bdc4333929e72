"""Vehicles of another form, drawn: hull, wings and fins about ROUGHIE's size, masses near its file, no coefficients."""

from math import pi, sqrt

import numpy as np

from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.layout import N_P
from glider.firmware.model.vehicle import Vehicle
from glider.sim_backend.foreign import foreign_layout as fo
from glider.sim_backend.foreign.lifting_body import DENSITY
from glider.tools.verify.challenge.forms import blank, draw_shapes

COEFFICIENTS = slice(layout.K_D0, layout.K_R + 1)  # of equation (4): a vehicle of another form has none
TRIM_KG, TRIM_M, ANGLE = 0.002, 0.0001, 0.003  # 1 sigma: net mass; centre of gravity; a surface set askew, rad


def spheroid(fineness: float) -> tuple[float, float, float]:
    """Apparent masses k1 (along), k2 (across) and inertia k' of a prolate spheroid, by Lamb (1932, section 114)."""
    e2 = 1.0 - 1.0 / (fineness * fineness)
    e = sqrt(e2)
    logarithm = np.log((1.0 + e) / (1.0 - e))
    alpha = 2.0 * (1.0 - e2) / e**3 * (0.5 * logarithm - e)
    beta = 1.0 / e2 - (1.0 - e2) / (2.0 * e**3) * logarithm
    turning = e2 * e2 * (beta - alpha) / ((2.0 - e2) * (2.0 * e2 - (2.0 - e2) * (beta - alpha)))
    return float(alpha / (2.0 - alpha)), float(beta / (2.0 - beta)), float(turning)


def draw_body(rng: np.random.Generator, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """Parameters P (N_P,) without coefficients and the body's entries of F, (N_FS,) else without an effect."""
    P, F = vehicle.vector(), blank()
    displaced = P[layout.M_T]
    length, prismatic = rng.uniform(1.1, 1.3), rng.uniform(0.76, 0.86)
    diameter = sqrt(4.0 * displaced / DENSITY / (pi * length * prismatic))
    fineness = length / diameter
    k1, k2, turning = spheroid(fineness)
    F[fo.FB_ON] = 1.0
    F[fo.FB_LENGTH], F[fo.FB_DIAMETER] = length, diameter
    F[fo.FB_WETTED] = pi * diameter * length * rng.uniform(0.84, 0.94)
    F[fo.FB_FORM_FACTOR] = 1.0 + 1.5 * fineness**-1.5 + 7.0 * fineness**-3
    F[fo.FB_BASE_AREA] = rng.uniform(0.2, 0.5) * 0.25 * pi * diameter * diameter
    F[fo.FB_BASE_X], F[fo.FB_APPARENT] = -rng.uniform(0.40, 0.47) * length, k2 - k1
    F[fo.FB_CROSS_ALONG], F[fo.FB_CROSS_ACROSS] = rng.uniform(0.3, 0.6), rng.uniform(0.8, 1.2)
    F[fo.FB_ROLL_DRAG] = rng.uniform(0.01, 0.04)
    F[fo.FB_MAST_AREA] = rng.uniform(0.0006, 0.0020)
    F[fo.FB_MAST_X], F[fo.FB_MAST_Z] = -rng.uniform(0.30, 0.45) * length, -rng.uniform(0.5, 0.9) * diameter
    F[fo.FB_DOWNWASH] = rng.uniform(0.4, 0.9)
    span, chord, wing_x = rng.uniform(0.55, 0.80), rng.uniform(0.055, 0.075), rng.uniform(-0.02, 0.04)
    dihedral, half = rng.uniform(0.0, 0.08), 0.5 * span
    stall, profile, oswald = rng.uniform(0.17, 0.26), rng.uniform(1.4, 2.2), rng.uniform(0.75, 0.95)
    for number, side in ((fo.SURFACE_STARBOARD, 1.0), (fo.SURFACE_PORT, -1.0)):
        _surface(
            F, number, half * chord, span / chord, chord, wing_x, side * (0.5 * diameter + 0.45 * half), 0.0,
            -side * dihedral, ANGLE * rng.standard_normal(), stall, profile, oswald,
        )  # fmt: skip
    for number, low, high, aspect, tilt, z in (
        (fo.SURFACE_TAIL, 0.003, 0.007, rng.uniform(2.5, 4.0), 0.0, 0.0),
        (fo.SURFACE_FIN, 0.045, 0.070, rng.uniform(1.5, 2.5), 0.5 * pi, rng.uniform(-0.05, 0.0)),
    ):
        area = rng.uniform(low, high)
        _surface(
            F, number, area, aspect, sqrt(area / aspect), -rng.uniform(0.40, 0.48) * length, 0.0, z, tilt,
            ANGLE * rng.standard_normal(), rng.uniform(0.22, 0.32), rng.uniform(1.4, 2.2), rng.uniform(0.7, 0.9),
        )  # fmt: skip
    P[COEFFICIENTS] = 0.0
    plates = 0.25 * pi * DENSITY * chord * chord * span
    P[layout.A_X] = k1 * displaced
    P[layout.A_Y] = k2 * displaced * rng.uniform(0.75, 1.0)
    P[layout.A_Z] = P[layout.A_Y] + plates
    hull = displaced * (length * length + diameter * diameter) / 20.0
    P[layout.B_X] = plates * span * span / 12.0 * rng.uniform(0.8, 1.5)
    P[layout.B_Y], P[layout.B_Z] = turning * hull * rng.uniform(1.0, 1.2, 2)
    P[layout.J_XX : layout.J_ZZ + 1] *= 1.0 + 0.05 * rng.standard_normal(3)
    P[layout.NET_MASS] = TRIM_KG * rng.standard_normal()
    P[layout.CG_X : layout.CG_Z + 1] = TRIM_M * rng.standard_normal(3)
    assert len(P) == N_P
    return P, F


def _surface(F: np.ndarray, number: int, *values: float) -> None:
    at = fo.FB_SURFACES + number * fo.N_FBS
    F[at : at + fo.N_FBS] = values


def draw_form_shapes(
    rng: np.random.Generator, body: np.ndarray, seconds: float, depths: tuple[float, float]
) -> np.ndarray:
    """F of a body's vehicle without an effect, with the shapes that effects of this case would have."""
    F = draw_shapes(rng, seconds, depths)
    F[fo.FB_ON :] = body[fo.FB_ON :]
    F[fo.FS_SHELL_TIME], F[fo.FS_LOOSE_TIME] = rng.uniform(0.4, 0.9) * seconds, rng.uniform(0.5, 2.0)
    return F
