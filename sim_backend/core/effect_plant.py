"""The plant with any number of effects, one step at a time: what simulation, prediction and diagnosis fly.

A flight is (P, F): `fold` makes of them the parameters that hold throughout; what depends on the state is added in
`effect_derivative`; play and lags, which are memories and not derivatives, move in `remember`; `read` is what the
sensors make of it all.
"""

import math

from firmware.core.jit import kernel
from firmware.core.maths.rotations import euler_from_quaternion, quaternion_rate, rotation_nb
from firmware.core.vehicle.actuators import actuator_rate, clip
from firmware.core.vehicle.flight import normalise_attitude
from firmware.core.vehicle.layout import (
    A_Y,
    A_Z,
    BALLAST_MAX,
    BALLAST_MIN,
    BALLAST_RATE,
    BALLAST_TAU,
    J_YY,
    J_ZZ,
    K_BETA,
    K_D,
    K_D0,
    K_L,
    K_L0,
    K_M0,
    K_MY,
    K_Q,
    K_R,
    LIFT_PRINTED,
    N_P,
    N_X,
    SERVO_MAX,
    SERVO_MIN,
    SERVO_RATE,
    SERVO_TAU,
    SLIDER_MAX,
    SLIDER_MIN,
    SLIDER_RATE,
    SLIDER_TAU,
)
from firmware.core.vehicle.layout import CG_X as P_CG_X
from firmware.core.vehicle.layout import CG_Y as P_CG_Y
from firmware.core.vehicle.layout import CG_Z as P_CG_Z
from firmware.core.vehicle.layout import NET_MASS as P_NET_MASS
from firmware.core.vehicle.motion import accelerations
from firmware.core.vehicle.water import flow_angles, flow_to_body
from sim_backend.core import effect_layout as ef

SERVO_DRIVEN, SLIDER_DRIVEN, BALLAST_DRIVEN = 1, 2, 4  # mode: this actuator's input is a speed, not a command


@kernel
def fold(P, F, out):
    """The parameters (N_P) that hold throughout a flight of P with effects F (N_F), into out."""
    for i in range(N_P):
        out[i] = P[i]
    out[SERVO_RATE] *= math.exp(-F[ef.SERVO_RATE_LOG])
    out[SERVO_TAU] *= math.exp(F[ef.SERVO_LAG_LOG])
    middle = 0.5 * (P[SERVO_MIN] + P[SERVO_MAX])
    out[SERVO_MIN] = min(P[SERVO_MIN] + F[ef.SERVO_LIMIT], middle)  # a loss of more than there is leaves one place
    out[SERVO_MAX] = max(P[SERVO_MAX] - F[ef.SERVO_LIMIT], middle)
    out[SLIDER_RATE] *= math.exp(-F[ef.SLIDER_RATE_LOG])
    out[SLIDER_TAU] *= math.exp(F[ef.SLIDER_LAG_LOG])
    out[BALLAST_RATE] *= math.exp(-F[ef.PUMP_RATE_LOG])
    out[BALLAST_TAU] *= math.exp(F[ef.PUMP_LAG_LOG])
    out[K_D0] *= 1.0 + F[ef.DRAG_0]
    out[K_D] *= 1.0 + F[ef.DRAG_ALPHA]
    out[K_L] *= 1.0 + F[ef.LIFT]
    out[K_L0] *= 1.0 + F[ef.LIFT]
    out[A_Y] *= 1.0 + F[ef.ADDED_Y]
    out[A_Z] *= 1.0 + F[ef.ADDED_Z]
    out[K_BETA] *= 1.0 + F[ef.SIDE]
    out[K_M0] += F[ef.PITCH_TRIM]
    out[K_Q] *= 1.0 + F[ef.PITCH_DAMPING]
    out[K_MY] *= 1.0 + F[ef.WEATHERCOCK]
    out[K_R] *= 1.0 + F[ef.YAW_DAMPING]
    out[P_NET_MASS] += F[ef.NET_MASS_OFFSET]
    out[P_CG_X] += F[ef.CG_OFFSET_X]
    out[P_CG_Y] += F[ef.CG_OFFSET_Y]
    out[P_CG_Z] += F[ef.CG_OFFSET_Z]
    out[J_YY] *= 1.0 + F[ef.INERTIA_Y]
    out[J_ZZ] *= 1.0 + F[ef.INERTIA_Z]


@kernel
def play(follower, leader, width):
    """Where a follower stands behind a play of this width (whole, SI); at 0 it stands with its leader."""
    if width <= 0.0:
        return leader
    return clip(follower, leader - 0.5 * width, leader + 0.5 * width)


@kernel
def extra_wrench(P, F, kz, u, v, w):
    """Forces (N) and moments (N m) in body axes that equation (4) has not: X, Y, Z, K, M, N.

    kz is the third component of the unit vector down's first body axis, -sin(theta): positive in a dive.
    """
    X, Y, Z, K, M, N = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    alpha, _, v_squared = flow_angles(u, v, w)
    drag, lift = 0.0, 0.0
    if F[ef.CLIMB_DIVE] != 0.0:
        drag += F[ef.CLIMB_DIVE] * math.tanh(-kz / ef.REST_PITCH) * (P[K_D0] + P[K_D] * alpha * alpha) * v_squared
    if F[ef.STALL] > 0.0:
        held = clip(alpha, -1.0 / F[ef.STALL], 1.0 / F[ef.STALL])
        lost = held * held - alpha * alpha if P[LIFT_PRINTED] != 0.0 else held - alpha
        lift += P[K_L] * lost * v_squared
    if drag != 0.0 or lift != 0.0:
        X, Y, Z = flow_to_body(u, v, w, -drag, 0.0, -lift)
    if F[ef.LINEAR_DRAG] != 0.0:
        X -= F[ef.LINEAR_DRAG] * u
        Y -= F[ef.LINEAR_DRAG] * v
        Z -= F[ef.LINEAR_DRAG] * w
    if F[ef.ROLL_TRIM] != 0.0 or F[ef.YAW_TRIM] != 0.0:
        K1, M1, N1 = flow_to_body(u, v, w, F[ef.ROLL_TRIM] * v_squared, 0.0, F[ef.YAW_TRIM] * v_squared)
        K += K1
        M += M1
        N += N1
    return X, Y, Z, K, M, N


@kernel
def line_wrench(F, depth, u, v, w, q, r):
    """Forces (N) and moments (N m) in body axes of a line at the tail: X, Y, Z, M, N.

    Drag with the square of the tail's own speed, of a line as long as the dive is deep; across the hull it may be less.
    """
    vt, wt = v + ef.TAIL * r, w - ef.TAIL * q
    pull = (F[ef.TETHER] + F[ef.TETHER_GROWTH] * max(depth, 0.0)) * math.sqrt(u * u + vt * vt + wt * wt)
    X, Y, Z = -pull * u, -pull * F[ef.TETHER_ACROSS] * vt, -pull * F[ef.TETHER_ACROSS] * wt
    return X, Y, Z, -ef.TAIL * Z - ef.TAIL_TOP * X, ef.TAIL * Y


@kernel
def correction(F, x, since, pump):
    """What a data-driven correction adds at its link: SHAPE's coefficients times shapes of about 1 in a glide.

    x (N_XF); since (s) from the run's start; pump (kg/s), positive when taking in water.
    """
    u, v, w = x[7], x[8], x[9]
    squared = u * u + v * v + w * w
    speed = max(math.sqrt(squared), 0.05)
    dive = 2.0 * (x[6] * x[4] - x[3] * x[5])
    value = F[ef.SHAPE] + F[ef.SHAPE + 1] * squared / 0.09 + F[ef.SHAPE + 2] * x[2] / 5.0
    value += F[ef.SHAPE + 3] * 10.0 * w / speed + F[ef.SHAPE + 4] * 10.0 * v / speed
    for i in range(3):
        value += F[ef.SHAPE + 5 + i] * 10.0 * x[10 + i]
    value += F[ef.SHAPE + 8] * pump / 0.03 + F[ef.SHAPE + 9] * since / 60.0
    return value + F[ef.SHAPE + 10] * math.tanh(dive / ef.REST_PITCH)


@kernel
def effect_speeds(P, F, x, mode, c_servo, c_slider, c_ballast):
    """Speeds of the actuators' motors (rad/s, m/s, kg/s) under commands, or as given where `mode` drives them."""
    ds, dl, db = c_servo, c_slider, c_ballast
    if not mode & SERVO_DRIVEN:
        ds = actuator_rate(x[13], c_servo, P[SERVO_MIN], P[SERVO_MAX], P[SERVO_RATE], P[SERVO_TAU])
    if not mode & SLIDER_DRIVEN:
        dl = actuator_rate(x[14], c_slider, P[SLIDER_MIN], P[SLIDER_MAX], P[SLIDER_RATE], P[SLIDER_TAU])
    if not mode & BALLAST_DRIVEN:
        rate = P[BALLAST_RATE]
        if F[ef.PUMP_DROOP] > 0.0 and c_ballast < x[15]:
            rate *= math.exp(-F[ef.PUMP_DROOP] * max(x[2], 0.0))
        db = actuator_rate(x[15], c_ballast, P[BALLAST_MIN], P[BALLAST_MAX], rate, P[BALLAST_TAU])
    return ds, dl, db


@kernel
def effect_derivative(P, F, x, mode, c_servo, c_slider, c_ballast, since, acc, force, water, out):
    """dx/dt into out[0:N_X] of folded parameters P (entry NET_MASS is written) with effects F.

    x (N_XF); c_... commands, or speeds where `mode` says so; since (s) from the run's start; acc (6) accelerations
    added to nu_dot; force (N) downward at the origin; water (3) m/s NED beside the current of F.
    """
    q0, q1, q2, q3 = x[3], x[4], x[5], x[6]
    u, v, w, p, q, r = x[7], x[8], x[9], x[10], x[11], x[12]
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation_nb(q0, q1, q2, q3)
    ds, dl, db = effect_speeds(P, F, x, mode, c_servo, c_slider, c_ballast)
    servo, slider = x[13], x[14]
    gear_rate, screw_rate = ds, dl
    if F[ef.SERVO_PLAY] > 0.0:
        servo = play(x[ef.X_GEAR_SERVO], x[13], F[ef.SERVO_PLAY])
        if servo == x[ef.X_GEAR_SERVO]:
            gear_rate = 0.0
    if F[ef.SLIDER_PLAY] > 0.0:
        slider = play(x[ef.X_GEAR_SLIDER], x[14], F[ef.SLIDER_PLAY])
        if slider == x[ef.X_GEAR_SLIDER]:
            screw_rate = 0.0
    scale = 1.0 + F[ef.SLIDER_SCALE]
    tank = x[15] * (1.0 + F[ef.BALLAST_SCALE]) + F[ef.BALLAST_LEAK] * since
    tank_rate = db * (1.0 + F[ef.BALLAST_SCALE]) + F[ef.BALLAST_LEAK]
    X, Y, Z, K, M, N = extra_wrench(P, F, r31, u, v, w)
    if F[ef.TETHER] != 0.0 or F[ef.TETHER_GROWTH] != 0.0:
        X1, Y1, Z1, M1, N1 = line_wrench(F, x[2], u, v, w, q, r)
        X += X1
        Y += Y1
        Z += Z1
        M += M1
        N += N1
    servo += F[ef.SERVO_OFFSET]
    slider *= scale
    link = int(F[ef.LINK])
    if 0 < link <= ef.ACTUATOR_LINKS:
        more = correction(F, x, since, db)
        X += more if link == 1 else 0.0
        Y += more if link == 2 else 0.0
        Z += more if link == 3 else 0.0
        K += more if link == 4 else 0.0
        M += more if link == 5 else 0.0
        N += more if link == 6 else 0.0
        servo += more if link == 7 else 0.0
        slider += more if link == 8 else 0.0
        tank += more if link == 9 else 0.0
    net = P[P_NET_MASS]
    P[P_NET_MASS] = net + F[ef.MASS_PER_DEPTH] * x[2]
    ud, vd, wd, pd, qd, rd = accelerations(
        P, r31, r32, r33, u, v, w, p, q, r,
        servo, slider, tank, gear_rate, screw_rate * scale, tank_rate,
        X + force * r31, Y + force * r32, Z + force * r33, K, M, N,
    )  # fmt: skip
    P[P_NET_MASS] = net
    out[0] = r11 * u + r12 * v + r13 * w + F[ef.CURRENT_N] + F[ef.SHEAR_N] * x[2] + water[0]
    out[1] = r21 * u + r22 * v + r23 * w + F[ef.CURRENT_E] + F[ef.SHEAR_E] * x[2] + water[1]
    out[2] = r31 * u + r32 * v + r33 * w + water[2]
    out[3], out[4], out[5], out[6] = quaternion_rate(q0, q1, q2, q3, p, q, r)
    out[7], out[8], out[9] = ud + acc[0], vd + acc[1], wd + acc[2]
    out[10], out[11], out[12] = pd + acc[3], qd + acc[4], rd + acc[5]
    out[13], out[14], out[15] = ds, dl, db


@kernel
def wrapped(angle):
    """Angle brought to [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@kernel
def remember(F, x, before, dt):
    """What effects remember after a step of dt: the gears behind their play, and how far lagging readings are behind.

    before: roll, pitch, yaw (rad) and depth (m) at the step's start. A lag of time constant T reads s - d, with
    d' = s' - d / T, exact for a signal that moves evenly over the step; the model's error does not enter it, so that a
    filter may correct the state without disturbing the sensor's memory.
    """
    x[ef.X_GEAR_SERVO] = play(x[ef.X_GEAR_SERVO], x[13], F[ef.SERVO_PLAY])
    x[ef.X_GEAR_SLIDER] = play(x[ef.X_GEAR_SLIDER], x[14], F[ef.SLIDER_PLAY])
    if F[ef.ATTITUDE_LAG] > 0.0:
        tau = F[ef.ATTITUDE_LAG]
        kept = math.exp(-dt / tau)
        taken = tau * (1.0 - kept) / dt
        roll, pitch, yaw = euler_from_quaternion(x[3], x[4], x[5], x[6])
        x[ef.X_LAG] = kept * x[ef.X_LAG] + taken * wrapped(roll - before[0])
        x[ef.X_LAG + 1] = kept * x[ef.X_LAG + 1] + taken * wrapped(pitch - before[1])
        x[ef.X_LAG + 2] = kept * x[ef.X_LAG + 2] + taken * wrapped(yaw - before[2])
    if F[ef.DEPTH_LAG] > 0.0:
        tau = F[ef.DEPTH_LAG]
        kept = math.exp(-dt / tau)
        x[ef.X_LAG + 3] = kept * x[ef.X_LAG + 3] + tau * (1.0 - kept) / dt * (x[2] - before[3])


@kernel
def begin_step(F, x, before, y):
    """What `remember` wants of a step's start, into before, and what effects remember, into y."""
    if F[ef.ATTITUDE_LAG] > 0.0:
        before[0], before[1], before[2] = euler_from_quaternion(x[3], x[4], x[5], x[6])
    before[3] = x[2]
    for i in range(N_X, ef.N_XF):
        y[i] = x[i]


@kernel
def effect_step(P, F, x, mode, c_servo, c_slider, c_ballast, since, acc, force, water, dt, work):
    """One classical Runge-Kutta step of (P folded, F), in place; x (N_XF), work (6, N_XF) scratch."""
    k1, k2, k3, k4, y, before = work[0], work[1], work[2], work[3], work[4], work[5]
    begin_step(F, x, before, y)
    half = 0.5 * dt
    effect_derivative(P, F, x, mode, c_servo, c_slider, c_ballast, since, acc, force, water, k1)
    for i in range(N_X):
        y[i] = x[i] + half * k1[i]
    effect_derivative(P, F, y, mode, c_servo, c_slider, c_ballast, since + half, acc, force, water, k2)
    for i in range(N_X):
        y[i] = x[i] + half * k2[i]
    effect_derivative(P, F, y, mode, c_servo, c_slider, c_ballast, since + half, acc, force, water, k3)
    for i in range(N_X):
        y[i] = x[i] + dt * k3[i]
    effect_derivative(P, F, y, mode, c_servo, c_slider, c_ballast, since + dt, acc, force, water, k4)
    for i in range(N_X):
        x[i] += dt / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
    normalise_attitude(x)
    remember(F, x, before, dt)


@kernel
def effect_midpoint(P, F, x, mode, c_servo, c_slider, c_ballast, since, acc, force, water, dt, work):
    """The same by the midpoint rule, at half the price: for derivatives by the state, not for flights."""
    k1, y, before = work[0], work[4], work[5]
    begin_step(F, x, before, y)
    half = 0.5 * dt
    effect_derivative(P, F, x, mode, c_servo, c_slider, c_ballast, since, acc, force, water, k1)
    for i in range(N_X):
        y[i] = x[i] + half * k1[i]
    effect_derivative(P, F, y, mode, c_servo, c_slider, c_ballast, since + half, acc, force, water, k1)
    for i in range(N_X):
        x[i] += dt * k1[i]
    normalise_attitude(x)
    remember(F, x, before, dt)


@kernel
def read(F, x, y):
    """What the sensors read at x without noise, into y (N_Y): onboard with its errors, motion capture without."""
    roll, pitch, yaw = euler_from_quaternion(x[3], x[4], x[5], x[6])
    y[ef.Y_MOCAP_X], y[ef.Y_MOCAP_Y], y[ef.Y_MOCAP_Z] = x[0], x[1], x[2]
    y[ef.Y_MOCAP_ROLL], y[ef.Y_MOCAP_PITCH], y[ef.Y_MOCAP_YAW] = roll, pitch, yaw
    y[ef.Y_ROLL] = roll - x[ef.X_LAG] + F[ef.ROLL_BIAS]
    y[ef.Y_PITCH] = pitch - x[ef.X_LAG + 1] + F[ef.PITCH_BIAS]
    compass = F[ef.COMPASS_S1] * math.sin(yaw) + F[ef.COMPASS_C1] * math.cos(yaw)
    compass += F[ef.COMPASS_S2] * math.sin(2.0 * yaw) + F[ef.COMPASS_C2] * math.cos(2.0 * yaw)
    y[ef.Y_YAW] = yaw - x[ef.X_LAG + 2] + compass
    for i in range(3):
        y[ef.Y_P + i] = (1.0 + F[ef.GYRO_SCALE]) * x[10 + i] + F[ef.GYRO_P + i]
    lever = F[ef.DEPTH_LEVER] * math.sin(pitch)
    y[ef.Y_DEPTH] = (1.0 + F[ef.DEPTH_SCALE]) * (x[2] - lever - x[ef.X_LAG + 3]) + F[ef.DEPTH_OFFSET]
    y[ef.Y_SLIDER] = play(x[ef.X_GEAR_SLIDER], x[14], F[ef.SLIDER_PLAY])
    y[ef.Y_BALLAST] = x[15]
    for i in range(ef.Y_ONBOARD):
        y[i] += F[ef.BIAS + i]
