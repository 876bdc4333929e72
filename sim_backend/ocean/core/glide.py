"""Kernels: how an ocean glider moves through the water, its attitude given (docs/explanation/ocean.md, Model)."""

import math

from glider.firmware.core.jit import kernel
from glider.sim_backend.ocean.core.layout import (
    ADDED_MASS,
    AREA,
    COMPRESSIBILITY,
    DRAG_0,
    DRAG_ALPHA,
    DRAG_EXPONENT,
    DRAG_PRESSURE,
    F_ATTITUDE_LAG,
    F_CLIMB_DIVE,
    F_COMPRESSIBILITY,
    F_DENSITY,
    F_DRAG,
    F_EXPANSION,
    F_INDUCED,
    F_LEAK,
    F_LIFT,
    F_NET_MASS,
    F_OIL_SCALE,
    F_PITCH_BIAS,
    F_PITCH_SCALE,
    GRAVITY,
    LEAST_FLOW_SPEED,
    LIFT_SLOPE,
    MASS,
    OIL_SCALE,
    PASCALS_A_METRE,
    PITCH_OFFSET,
    PITCH_SCALE,
    STEEPEST_ANGLE,
    TEMPERATURE,
    THERMAL_EXPANSION,
    VOLUME,
)

NEWTON_STEPS = 6


@kernel
def net_buoyancy(P, F, depth, density, temperature, oil, since):
    """Buoyancy less weight, N, up positive; depth m, in-situ density kg/m3, degC, reported oil volume m3.

    since: s from the run's begin, for what leaks in. Linear compression and expansion of the hull (Merckelbach and
    others 2010, eq. 3).
    """
    squeezed = (P[COMPRESSIBILITY] + F[F_COMPRESSIBILITY]) * PASCALS_A_METRE * max(depth, 0.0)
    warmed = (P[THERMAL_EXPANSION] + F[F_EXPANSION]) * (temperature - P[TEMPERATURE])
    volume = P[VOLUME] * (1.0 - squeezed + warmed) + (P[OIL_SCALE] + F[F_OIL_SCALE]) * oil
    mass = P[MASS] + F[F_NET_MASS] + F[F_LEAK] * since
    return P[GRAVITY] * ((density - F[F_DENSITY]) * volume - mass)


@kernel
def true_pitch(P, F, pitch, pitch_rate):
    """Pitch, rad, of what the attitude sensor reads, and its rate: offset, scale and lag taken off."""
    read = pitch + F[F_ATTITUDE_LAG] * pitch_rate
    return (read - P[PITCH_OFFSET] - F[F_PITCH_BIAS]) / (P[PITCH_SCALE] + F[F_PITCH_SCALE])


@kernel
def drag_coefficients(P, F, speed, density, climbing):
    """Parasitic and induced drag coefficient at a speed, m/s."""
    parasitic = P[DRAG_0] * (1.0 + F[F_DRAG])
    if P[DRAG_EXPONENT] != 0.0:
        q = 0.5 * density * max(speed, 0.05) ** 2
        parasitic *= (q / DRAG_PRESSURE) ** P[DRAG_EXPONENT]
    share = 1.0 + F[F_CLIMB_DIVE] if climbing else 1.0 - F[F_CLIMB_DIVE]
    return parasitic * share, P[DRAG_ALPHA] * (1.0 + F[F_INDUCED]) * share


@kernel
def angle_of_attack(pitch, parasitic, induced, slope):
    """Angle between pitch and path, rad: its size, path steeper than pitch, of a steady glide.

    slope a tan(|pitch| + a) = parasitic + induced a^2 (Merckelbach and others 2010, eq. 6, by Newton's method). Where
    the pitch is too small for any, the largest looked for.
    """
    steep = abs(pitch)
    a = min(parasitic / (slope * max(math.tan(steep), 0.05)), STEEPEST_ANGLE)
    for _ in range(NEWTON_STEPS):
        tangent = math.tan(steep + a)
        value = slope * a * tangent - parasitic - induced * a * a
        bend = slope * (tangent + a * (1.0 + tangent * tangent)) - 2.0 * induced * a
        if bend <= 1e-6:
            return STEEPEST_ANGLE
        a = min(max(a - value / bend, 0.0), STEEPEST_ANGLE)
    return a


@kernel
def glide(P, F, speed, pitch, density):
    """Angle of the path, rad, up positive, and the drag over the square of the speed, kg/m, of a pitch and a speed."""
    parasitic, induced = drag_coefficients(P, F, speed, density, pitch > 0.0)
    a = angle_of_attack(pitch, parasitic, induced, P[LIFT_SLOPE] * (1.0 + F[F_LIFT]))
    path = pitch + a if pitch > 0.0 else pitch - a
    return path, 0.5 * density * P[AREA] * (parasitic + induced * a * a)


@kernel
def next_speed(P, speed, dt, force, drag):
    """Speed along the path after dt s and its derivative by the speed before: force N along the path, drag kg/m.

    (m + added) U' = force - drag U^2, one implicit step, stable however long.
    """
    mass = P[MASS] + P[ADDED_MASS]
    c = dt * drag / mass
    ahead = speed + dt * force / mass
    if ahead <= LEAST_FLOW_SPEED:
        return LEAST_FLOW_SPEED, 0.0
    root = math.sqrt(1.0 + 4.0 * c * ahead)
    return 2.0 * ahead / (1.0 + root), 1.0 / root


@kernel
def steady_speed(P, F, pitch, density, buoyancy):
    """Speed along the path, m/s, and its angle, rad, of a steady glide: true pitch rad, net buoyancy N up."""
    speed, path = 0.25, pitch
    for _ in range(8):
        path, drag = glide(P, F, speed, pitch, density)
        force = buoyancy * math.sin(path)
        speed = math.sqrt(force / drag) if force > 0.0 else LEAST_FLOW_SPEED
    return max(speed, LEAST_FLOW_SPEED), path
