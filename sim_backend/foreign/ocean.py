"""A foreign ocean glider for blind tests: it shares physics with the observer of ocean gliders, and no equation.

Velocity through the water is a state on three axes (docs/explanation/blind-tests.md, Missions of ocean gliders);
the forces
follow the angle of attack as it is, not that of a steady glide. Body axes ahead, starboard, down; depth down
positive.
"""

import math

import numpy as np

from glider.firmware.core.jit import kernel
from glider.sim_backend.core.noise import gaussian

# --- vehicle, V ------------------------------------------------------------------------------------------------------
MASS, VOLUME, COMPRESSION, STIFFENING, EXPANSION = 0, 1, 2, 3, 4  # kg, m3, 1/Pa, 1/Pa, 1/K
AREA, DRAG, INDUCED, DRAG_POWER, LIFT, LIFT_BEND, SIDE = 5, 6, 7, 8, 9, 10, 11  # m2; of AREA; 1/rad
CLIMB_DRAG = 12  # share by which climbing drags more than diving
ADDED_AHEAD, ADDED_SIDE, ADDED_DOWN = 13, 14, 15  # kg
OIL_SCALE, GRAVITY = 16, 17
PITCH_SCALE, PITCH_OFFSET, ROLL_TRIM = 18, 19, 20  # reads so many times the truth; rad; rad
PITCH_TIME, PITCH_WANDER, ROLL_WANDER, YAW_WANDER = 21, 22, 23, 24  # s, rad, rad, rad
PUMP_RATE, VALVE_RATE, PUMP_DROOP = 25, 26, 27  # m3/s, m3/s, share lost a metre
WATER_LAG = 28  # s, of the CTD
DENSITY_BIAS = 29  # kg/m3
ROW_SHALLOW, ROW_DEEP, DEEP = 30, 31, 32  # s, s, m
THRUST, THRUST_DEPTH = 33, 34  # N along the hull, ahead; m, down to which
PULL = 35  # N a metre of depth, against the way through the water
CAMBER, WING_DRAG = 36, 37  # of AREA: lift at no angle of attack; drag that goes with the speed, at STANDARD_SPEED
MUD = 38  # kg, from apogee on; it is washed out
N_V = 39

# --- dive, D ---------------------------------------------------------------------------------------------------------
DEPTH, PITCH_DOWN, PITCH_UP, PITCH_APOGEE = 0, 1, 2, 3  # m; rad, as read
OIL_SURFACE, OIL_DOWN, OIL_UP = 4, 5, 6  # m3, as reported
HEADING = 7  # rad
N_D = 8

# --- sea, S ----------------------------------------------------------------------------------------------------------
MIXED_LAYER_TEMPERATURE, THERMOCLINE_TEMPERATURE, DEEP_TEMPERATURE = (
    0,
    1,
    2,
)  # degC: mixed layer; below the thermocline; far down
THERMOCLINE, THICKNESS, DECAY = 3, 4, 5  # m
SALT, SALT_STEP = 6, 7  # g/kg: far down; of the upper layer less
FINE, FINE_LENGTH, FINE_PHASE = 8, 9, 10  # K, m, rad
WATER, WATER_TIME = 11, 12  # m/s, s: of the water's vertical motion
N_S = 13

# --- what a row holds ------------------------------------------------------------------------------------------------
R_TIME, R_DEPTH, R_PITCH, R_ROLL, R_YAW, R_OIL, R_DENSITY, R_TEMPERATURE, R_PUMP = 0, 1, 2, 3, 4, 5, 6, 7, 8
R_SPEED, R_HORIZONTAL, R_WATER = 9, 10, 11  # m/s through the water: all, horizontal; of the water, down
N_R = 12

STEPS = 5  # of a second
WATER_SLOPE_S = 15.0  # s, over which vertical water has a slope
PITCH_REMEMBERS, ROLL_REMEMBERS, YAW_REMEMBERS = 90.0, 60.0, 900.0  # s
FASTEST_PITCH = 0.025  # rad/s
STANDARD_SPEED = 0.25  # m/s, at which parasitic drag is DRAG
MUD_TIME = 1200.0  # s, in which mud is washed out
STEADY_PULL = 0.05  # m/s, from which on the pull is whole
CALM_SURFACE, CALM_DEPTH = 0.6, 30.0  # share by which vertical water is less at the surface; m
MAX_DIVE_S = 60000.0  # s of a dive


@kernel
def sea_temperature(S, z):
    """Temperature, degC, at a depth, m."""
    upper = (
        0.5
        * (S[MIXED_LAYER_TEMPERATURE] - S[THERMOCLINE_TEMPERATURE])
        * (1.0 - math.tanh((z - S[THERMOCLINE]) / S[THICKNESS]))
    )
    deep = S[DEEP_TEMPERATURE] + (S[THERMOCLINE_TEMPERATURE] - S[DEEP_TEMPERATURE]) * math.exp(-max(z, 0.0) / S[DECAY])
    return upper + deep + S[FINE] * math.sin(z / S[FINE_LENGTH] + S[FINE_PHASE]) * math.exp(-max(z, 0.0) / 300.0)


@kernel
def potential_density(S, z):
    """Density without what pressure adds, kg/m3: a quadratic equation of state about 10 degC and 35 g/kg."""
    warm = sea_temperature(S, z) - 10.0
    salt = S[SALT] - 0.5 * S[SALT_STEP] * (1.0 - math.tanh((z - S[THERMOCLINE]) / S[THICKNESS])) - 35.0
    return 1026.95 - 0.165 * warm - 0.0046 * warm * warm + 0.775 * salt


@kernel
def squeezed_density(z):
    """What pressure adds to the density at a depth, kg/m3."""
    return 4.45e-3 * z - 3e-8 * z * z


@kernel
def net_weight(V, S, z, oil):
    """Weight less buoyancy, N, down positive."""
    depth = max(z, 0.0)
    pressure = 10060.0 * depth * (1.0 + 2.2e-6 * depth)
    strain = -V[COMPRESSION] * pressure * (1.0 - V[STIFFENING] * pressure)
    strain += V[EXPANSION] * (sea_temperature(S, depth) - 10.0)
    volume = V[VOLUME] * math.exp(strain) + V[OIL_SCALE] * oil
    return V[GRAVITY] * (V[MASS] - (potential_density(S, depth) + squeezed_density(depth)) * volume)


@kernel
def rates(V, weight, density, theta, turn, phi, u, v, w, thrust=0.0, pull=0.0):
    """Accelerations of u, v, w, m/s2, and depth rate through the water, m/s.

    turn: pitch rate, rad/s; thrust, pull: N. Lift a sin(alpha) cos(alpha) (1 + b sin2(alpha)) and that of the camber,
    drag c0 (U / U0)^p + c1 (sin2 alpha + sin2 beta) and the wings' that goes with U, all turned into body axes.
    """
    speed = math.sqrt(u * u + v * v + w * w) + 1e-9
    alpha = math.atan2(w, u)
    sine, cosine, side = math.sin(alpha), math.cos(alpha), v / speed
    pressure = 0.5 * density * speed * speed * V[AREA]
    parasitic = V[DRAG] * (max(speed, 0.03) / STANDARD_SPEED) ** V[DRAG_POWER]
    parasitic *= 1.0 + 0.5 * V[CLIMB_DRAG] * (1.0 if theta > 0.0 else -1.0)
    drag = pressure * (parasitic + V[INDUCED] * (sine * sine + side * side))
    drag += pressure * V[WING_DRAG] * STANDARD_SPEED / max(speed, 0.03) + pull * min(speed / STEADY_PULL, 1.0)
    lift = pressure * (V[LIFT] * sine * cosine * (1.0 + V[LIFT_BEND] * sine * sine) + V[CAMBER])
    ahead = thrust + lift * sine - drag * cosine
    down = -lift * cosine - drag * sine
    across = -(pressure * V[SIDE] + drag) * side
    mass_u, mass_v, mass_w = V[MASS] + V[ADDED_AHEAD], V[MASS] + V[ADDED_SIDE], V[MASS] + V[ADDED_DOWN]
    st, ct, sp, cp = math.sin(theta), math.cos(theta), math.sin(phi), math.cos(phi)
    du = (ahead - weight * st - mass_w * w * turn) / mass_u
    dv = (across + weight * ct * sp) / mass_v
    dw = (down + weight * ct * cp + mass_u * u * turn) / mass_w
    return du, dv, dw, -u * st + (v * sp + w * cp) * ct


@kernel
def remembered(value, size, time, seed, stream, second):
    """A process that decorrelates in `time` s and has `size` for its standard deviation, one second on."""
    keep = math.exp(-1.0 / time)
    return keep * value + size * math.sqrt(1.0 - keep * keep) * gaussian(seed, stream, second)


@kernel
def engine_rate(V, oil, wanted, depth):
    """Rate of the buoyancy engine, m3/s: a pump that loses with depth, a valve that does not."""
    missing = wanted - oil
    if missing > 0.0:
        return min(V[PUMP_RATE] * max(1.0 - V[PUMP_DROOP] * depth, 0.2), missing)
    return max(-V[VALVE_RATE], missing)


@kernel
def fly_dive(V, D, S, seed, out):
    """A dive from the surface to the surface into out (rows, N_R); how many rows it took, readings without noise.

    Pitch follows what the attitude sensor is wanted to read. Down to DEPTH, then apogee: the engine runs at
    PITCH_APOGEE until it has moved half of its way; then up.
    """
    dt = 1.0 / STEPS
    u, v, w, z = 0.05, 0.0, 0.02, 0.6
    theta, oil, phase = -0.15, D[OIL_SURFACE], 0
    water = S[WATER] * gaussian(seed, 1, 0)
    smooth, pitch_off, roll_off, yaw_off = water, 0.0, 0.0, V[YAW_WANDER] * gaussian(seed, 4, 0)
    temperature, potential = sea_temperature(S, z), potential_density(S, z)
    row, due, second, engine, mud = 0, 0.0, 0, 0.0, 0.0
    while second < MAX_DIVE_S and row < out.shape[0]:
        water = remembered(water, S[WATER], S[WATER_TIME], seed, 1, second + 1)
        smooth += (water - smooth) / WATER_SLOPE_S
        pitch_off = remembered(pitch_off, V[PITCH_WANDER], PITCH_REMEMBERS, seed, 2, second + 1)
        roll_off = remembered(roll_off, V[ROLL_WANDER], ROLL_REMEMBERS, seed, 3, second + 1)
        yaw_off = remembered(yaw_off, V[YAW_WANDER], YAW_REMEMBERS, seed, 4, second + 1)
        vertical = smooth * (1.0 - CALM_SURFACE * math.exp(-max(z, 0.0) / CALM_DEPTH))
        phi = V[ROLL_TRIM] + roll_off
        if second >= due:
            along = u * math.cos(theta) + (v * math.sin(phi) + w * math.cos(phi)) * math.sin(theta)
            across = v * math.cos(phi) - w * math.sin(phi)
            out[row, R_TIME], out[row, R_DEPTH] = second, z
            out[row, R_PITCH] = V[PITCH_SCALE] * theta + V[PITCH_OFFSET]
            out[row, R_ROLL], out[row, R_YAW], out[row, R_OIL] = phi, D[HEADING] + yaw_off, oil
            out[row, R_DENSITY] = potential + squeezed_density(z) + V[DENSITY_BIAS]
            out[row, R_TEMPERATURE], out[row, R_PUMP] = temperature, 1.0 if abs(engine) > 1e-8 else 0.0
            out[row, R_SPEED], out[row, R_HORIZONTAL] = math.sqrt(u * u + v * v + w * w), math.hypot(along, across)
            out[row, R_WATER] = vertical
            row += 1
            due = second + (V[ROW_DEEP] if z > V[DEEP] else V[ROW_SHALLOW])
        if phase == 0 and z > D[DEPTH]:
            phase, mud = 1, V[MUD]
        elif phase == 1 and oil > 0.5 * (D[OIL_DOWN] + D[OIL_UP]):
            phase = 2
        elif phase == 2 and z < 1.0:
            break
        asked = D[PITCH_DOWN] if phase == 0 else (D[PITCH_APOGEE] if phase == 1 else D[PITCH_UP])
        wanted = (asked - V[PITCH_OFFSET]) / V[PITCH_SCALE] + pitch_off
        engine = engine_rate(V, oil, D[OIL_DOWN] if phase == 0 else D[OIL_UP], z)
        for _ in range(STEPS):
            turn = min(max((wanted - theta) / V[PITCH_TIME], -FASTEST_PITCH), FASTEST_PITCH)
            weight = net_weight(V, S, z, oil) + V[GRAVITY] * mud
            density = potential_density(S, z) + squeezed_density(z)
            thrust, pull = V[THRUST] if z < V[THRUST_DEPTH] else 0.0, V[PULL] * max(z, 0.0)
            du, dv, dw, dz = rates(V, weight, density, theta, turn, phi, u, v, w, thrust, pull)
            du2, dv2, dw2, dz2 = rates(
                V, weight, density, theta + turn * dt, turn, phi, u + dt * du, v + dt * dv, w + dt * dw, thrust, pull
            )
            u, v, w = u + 0.5 * dt * (du + du2), v + 0.5 * dt * (dv + dv2), w + 0.5 * dt * (dw + dw2)
            z += dt * (0.5 * (dz + dz2) + vertical)
            theta += dt * turn
            oil += dt * engine
            if z < 0.3:  # afloat
                z, u, v, w = 0.3, 0.9 * u, 0.9 * v, 0.9 * w
        temperature += (sea_temperature(S, z) - temperature) / V[WATER_LAG]
        potential += (potential_density(S, z) - potential) / V[WATER_LAG]
        mud *= 1.0 - 1.0 / MUD_TIME
        second += 1
    return row


def room() -> np.ndarray:
    """An empty table that any dive fits into, (rows, N_R)."""
    return np.zeros((int(MAX_DIVE_S) // 4, N_R))
