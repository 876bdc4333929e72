"""The environment: water in motion (current, shear, surface waves), and where it ends, the surface and the floor."""

import math

from glider.firmware.core.jit import kernel
from glider.firmware.core.maths.wide import anywhere, where
from glider.firmware.core.vehicle.layout import GRAVITY, M_T, X_DOWN
from glider.firmware.core.vehicle.state import rotation, velocities
from glider.sim_backend.core import layout as wl


@kernel
def wave_row(amplitude, omega, direction, phase):
    """A row of the world's waves: amplitude (m), omega (rad/s), direction it runs to, phase (rad); k = omega^2 / g."""
    k = omega * omega / GRAVITY
    return amplitude, omega, k * math.cos(direction), k * math.sin(direction), phase


@kernel
def water_velocity(E, waves, north, east, down, t):
    """Velocity of the water at a place and time, m/s NED: current, shear, and surface waves dying out with depth.

    Waves by linear theory in deep water: amplitude a, k = omega^2 / g, orbital speed a omega exp(-k Z).
    """
    vn = E[wl.ENV_CURRENT_N] + E[wl.ENV_SHEAR_N] * down
    ve = E[wl.ENV_CURRENT_E] + E[wl.ENV_SHEAR_E] * down
    vd = 0.0
    for i in range(waves.shape[0]):
        omega, kn, ke = waves[i, wl.WAVE_OMEGA], waves[i, wl.WAVE_K_N], waves[i, wl.WAVE_K_E]
        k = math.sqrt(kn * kn + ke * ke)
        phase = kn * north + ke * east - omega * t + waves[i, wl.WAVE_PHASE]
        speed = waves[i, wl.WAVE_AMPLITUDE] * omega * math.exp(-k * max(down, 0.0))
        vn += speed * math.cos(phase) * kn / k
        ve += speed * math.cos(phase) * ke / k
        vd -= speed * math.sin(phase)
    return vn, ve, vd


@kernel
def boundary_force(P, E, x, water_d):
    """Downward force (N) at the surface, where buoyancy is lost, and on the floor, a stiff damped spring.

    water_d: speed of the water downward, m/s.
    """
    down, force = x[X_DOWN], 0.0
    out = (E[wl.ENV_SURFACE_HEIGHT] > 0.0) & (down < 0.0)
    if anywhere(out):
        lost = P[M_T] * GRAVITY * min(1.0, -down / E[wl.ENV_SURFACE_HEIGHT])
        force += where(out, lost, 0.0)
    below = (E[wl.ENV_FLOOR_DEPTH] > 0.0) & (down > E[wl.ENV_FLOOR_DEPTH])
    if anywhere(below):
        _, _, _, _, _, _, r31, r32, r33 = rotation(x)
        u, v, w, _, _, _ = velocities(x)
        down_rate = r31 * u + r32 * v + r33 * w + water_d
        held = max(0.0, wl.FLOOR_STIFFNESS * (down - E[wl.ENV_FLOOR_DEPTH]) + wl.FLOOR_DAMPING * down_rate)
        force -= where(below, held, 0.0)
    return force
