"""The foreign plant: nominal equations, effects in other forms than the catalogue's, Heun's method.

It flies blind tests of the diagnosis. Each effect keeps its label's meaning (docs/reference/gap.md, Words) and takes a
form that
the catalogue has not: hysteresis by Bouc and Wen instead of play, second-order or load-dependent actuators, saturating
depth laws, powers of the speed beside the square. With F = 0 the flight is the nominal one. A vehicle of another form
has the water's forces of lifting_body instead of equation (4): its P has no coefficients.
"""

import math

from glider.firmware.core.jit import kernel
from glider.firmware.core.maths.rotations import euler_from_quaternion, quaternion_rate, rotation_nb, wrap_angle
from glider.firmware.core.maths.steps import MIDPOINT
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.actuators import actuator_rate, actuator_table
from glider.firmware.core.vehicle.layout import N_P, N_X
from glider.firmware.core.vehicle.motion import accelerations
from glider.firmware.core.vehicle.time_constants import nominal_parts
from glider.firmware.core.vehicle.water import flow_angles, flow_to_body
from glider.sim_backend.core.noise import gaussian, uniform
from glider.sim_backend.foreign import foreign_layout as fo
from glider.sim_backend.foreign.lifting_body import body_wrench

REFERENCE_SPEED = 0.35  # m/s, where powers of the speed other than the square agree with it
TANGLE_BLOCK = 7.0  # s
TANGLE_ARM = 0.12  # m to starboard of the tail
LOOSE_SLOPE = 0.25  # sine of the pitch at which a loose mass has gone most of its way


@kernel
def bouc_wen_rate(v, z, play):
    """dz/dt of the part z of a motion that the play swallows: |z| <= play (half of it), smooth where it is taken up."""
    share = (z / play) * (z / play)
    return v * (1.0 - share) if v * z > 0.0 else v


@kernel
def soft_limit(F, angle):
    """Servo angle (rad) that a soft stop lets through, and its slope."""
    if F[fo.FS_SERVO_LIMIT] == 0.0:
        return angle, 1.0
    share = (angle * F[fo.FS_SERVO_LIMIT]) ** 6
    below = (1.0 + share) ** (-1.0 / 6.0)
    return angle * below, below / (1.0 + share)


@kernel
def servo_motion(P, F, x, command, out):
    """Angle and speed of the servo's masses; the motor's own motion into out."""
    low, high, rate, tau = actuator_table(P, layout.SERVO_MIN)
    slow = F[fo.FS_SERVO_SLOW]
    if slow == 0.0:
        speed = actuator_rate(x[13], command, low, high, rate, tau)
    else:  # a motor with inertia: its speed follows the nominal law only after a while
        speed = x[fo.X_SERVO_V]
        wanted = actuator_rate(x[13], command, low, high, rate / (1.0 + 4.0 * slow), tau * (1.0 + 3.0 * slow))
        out[fo.X_SERVO_V] = (wanted - speed) / (0.05 + 0.1 * slow)
    out[13] = speed
    angle, slope = soft_limit(F, x[13])
    speed *= slope
    if F[fo.FS_SERVO_BACKLASH] > 0.0:
        swallowed = bouc_wen_rate(speed, x[fo.X_SERVO_Z], F[fo.FS_SERVO_BACKLASH])
        out[fo.X_SERVO_Z] = swallowed
        angle -= x[fo.X_SERVO_Z]
        speed -= swallowed
    return angle + F[fo.FS_SERVO_OFFSET] * (1.0 - 0.15 * abs(x[13])), speed


@kernel
def slider_motion(P, F, x, command, kx, out):
    """Position and speed of the sliding mass; the motor's own motion into out. kx: gravity's share along body x."""
    speed = actuator_rate(x[14], command, *actuator_table(P, layout.SLIDER_MIN))
    if F[fo.FS_SLIDER_SLOW] > 0.0:  # a weak motor: slower still when it lifts the mass
        uphill = -kx if speed > 0.0 else kx
        speed /= 1.0 + 3.0 * F[fo.FS_SLIDER_SLOW] * (1.0 + 0.5 * uphill)
    out[14] = speed
    position = x[14]
    if F[fo.FS_SLIDER_BACKLASH] > 0.0:
        swallowed = bouc_wen_rate(speed, x[fo.X_SLIDER_Z], F[fo.FS_SLIDER_BACKLASH])
        out[fo.X_SLIDER_Z] = swallowed
        position -= x[fo.X_SLIDER_Z]
        speed -= swallowed
    return position, speed


@kernel
def pump_motion(P, F, x, command, out):
    """Speed of the ballast, kg/s; the pump's own motion into out."""
    low, high, rate, tau = actuator_table(P, layout.BALLAST_MIN)
    droop, slow = F[fo.FS_PUMP_DROOP], F[fo.FS_PUMP_SLOW]
    if droop > 0.0 and command < x[15]:  # expelling against depth: power over pressure, by a root
        rate /= math.sqrt(1.0 + droop * max(x[2], 0.0))
    if slow == 0.0:
        speed = actuator_rate(x[15], command, low, high, rate, tau)
    else:
        speed = x[fo.X_PUMP_V]
        wanted = actuator_rate(x[15], command, low, high, rate / (1.0 + 2.0 * slow), tau * (1.0 + slow))
        out[fo.X_PUMP_V] = (wanted - speed) / (0.1 + 0.3 * slow)
    out[15] = speed
    return speed


@kernel
def steady_share(F, t):
    """How far what is called constant wanders: 0.9 to 1.1 within a run."""
    return 1.0 + 0.1 * math.sin(2.0 * math.pi * t / F[fo.FS_DRIFT_TIME] + F[fo.FS_DRIFT_PHASE])


@kernel
def depth_mass(F, down):
    """Mass (kg, at the origin) that depends on depth: compressed hull or trapped air heavier, denser water lighter."""
    mass, z = 0.0, max(down, 0.0)
    if F[fo.FS_COMPRESSIBILITY] != 0.0:
        if F[fo.FS_TRAPPED_AIR] > 0.5:
            mass += F[fo.FS_COMPRESSIBILITY] * z / (10.3 + z)
        else:
            mass += F[fo.FS_COMPRESSIBILITY] * (1.0 - math.exp(-z / F[fo.FS_DEPTH_SCALE_M]))
    if F[fo.FS_STRATIFICATION] != 0.0:
        middle, width = F[fo.FS_LAYER_DEPTH], F[fo.FS_LAYER_WIDTH]
        mass -= 0.5 * F[fo.FS_STRATIFICATION] * (math.tanh((z - middle) / width) + math.tanh(middle / width))
    return mass


@kernel
def loose_place(kx):
    """Where a loose mass comes to lie, -1 (aft) to 1 (forward), from gravity's share along body x."""
    return math.tanh(kx / LOOSE_SLOPE)


@kernel
def mass_effects(P, F, servo, slider, ballast, down, t, loose, Pw):
    """P with the effects on masses, into Pw (N_P). loose: where a loose mass lies, -1 to 1."""
    for i in range(N_P):
        Pw[i] = P[i]
    tank = F[fo.FS_BALLAST_SCALE] * ballast * (1.0 + 3.0 * ballast * ballast / 0.04)
    if F[fo.FS_BALLAST_LEAK] != 0.0 and t > F[fo.FS_LEAK_START]:
        tank += F[fo.FS_BALLAST_LEAK] * (1.0 - math.exp(-(t - F[fo.FS_LEAK_START]) / F[fo.FS_LEAK_TIME]))
    steady = steady_share(F, t)
    Pw[layout.NET_MASS] += tank + depth_mass(F, down) + F[fo.FS_NET_BUOYANCY] * steady
    moved = F[fo.FS_SLIDER_SCALE] * P[layout.M_S] * slider * (0.8 + 0.4 * slider * slider / 0.0036)
    Pw[layout.CG_X] += (tank * P[layout.X_B] + moved) / P[layout.M_T] + F[fo.FS_CG_LONGITUDINAL]
    Pw[layout.CG_Y] += F[fo.FS_CG_LATERAL]
    # a weight that sits off the middle is not at the middle's height either
    Pw[layout.CG_Z] += F[fo.FS_CG_VERTICAL] + 0.06 * abs(F[fo.FS_CG_LATERAL]) - 0.06 * abs(F[fo.FS_CG_LONGITUDINAL])
    if F[fo.FS_SHELL] != 0.0:  # water in the starboard wing, running out
        left = F[fo.FS_SHELL] * math.exp(-t / F[fo.FS_SHELL_TIME])
        wing = fo.FB_SURFACES + fo.SURFACE_STARBOARD * fo.N_FBS
        Pw[layout.NET_MASS] += left
        Pw[layout.CG_X] += left * F[wing + fo.FBS_X] / P[layout.M_T]
        Pw[layout.CG_Y] += left * F[wing + fo.FBS_Y] / P[layout.M_T]
    Pw[layout.CG_X] += F[fo.FS_LOOSE] * loose / P[layout.M_T]
    Pw[layout.J_YY] += F[fo.FS_INERTIA]
    Pw[layout.J_ZZ] += 1.15 * F[fo.FS_INERTIA]
    Pw[layout.A_Z] *= 1.0 + F[fo.FS_ADDED_MASS]
    Pw[layout.A_Y] *= 1.0 + 0.15 * F[fo.FS_ADDED_MASS]


@kernel
def water_effects(P, F, u, v, w, p, q, r, tilt, down, down_rate, pump, x, t, seed):
    """Wrench (N, N m, body axes) that the effects add to the water's, and dx/dt of the lift's lagging angle.

    tilt: share of gravity along body y, sin(phi) cos(theta); pump: kg/s.
    """
    alpha, beta, v2 = flow_angles(u, v, w)
    speed = math.sqrt(v2)
    # in place of V^2
    power = v2
    if F[fo.FS_EXPONENT] != 2.0 and speed > 1e-4:
        power *= (speed / REFERENCE_SPEED) ** (F[fo.FS_EXPONENT] - 2.0)
    D, SF, L, T1, T2, T3 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if F[fo.FS_DRAG] != 0.0:
        D += F[fo.FS_DRAG] * (P[layout.K_D0] + P[layout.K_D] * (alpha - 0.01) * (alpha - 0.01)) * power
    if F[fo.FS_LINEAR_DRAG] != 0.0:
        D += F[fo.FS_LINEAR_DRAG] * speed * (speed / REFERENCE_SPEED) ** 0.15
    if F[fo.FS_ASYMMETRY] != 0.0:
        D += F[fo.FS_ASYMMETRY] * (P[layout.K_D0] + P[layout.K_D] * alpha * alpha) * math.tanh(down_rate / 0.04) * power
    if F[fo.FS_SIDE_FORCE] != 0.0:
        SF += F[fo.FS_SIDE_FORCE] * P[layout.K_BETA] * 0.5 * math.sin(2.0 * beta) * power
    if F[fo.FS_LIFT] != 0.0:
        L += F[fo.FS_LIFT] * P[layout.K_L] * 0.5 * math.sin(2.0 * alpha) * power
    if F[fo.FS_STALL] > 0.0:
        bent = min(abs(alpha) * F[fo.FS_STALL], 0.5 * math.pi)
        L += P[layout.K_L] * (math.copysign(math.sin(bent) / F[fo.FS_STALL], alpha) - alpha) * v2
    T1 += F[fo.FS_ROLL_TRIM] * (1.0 + 0.3 * alpha) * power
    T2 += F[fo.FS_PITCH_TRIM] * (1.0 - 0.3 * alpha) * power
    T2 += F[fo.FS_PITCH_DAMPING] * P[layout.K_Q] * (0.7 * v2 + 0.8 * abs(q)) * q
    T3 += F[fo.FS_YAW_TRIM] * (1.0 + 0.3 * alpha) * power
    if F[fo.FS_WEATHERCOCK] != 0.0:
        T3 += F[fo.FS_WEATHERCOCK] * P[layout.K_MY] * 0.5 * math.sin(2.0 * beta) * power
    T3 += F[fo.FS_YAW_DAMPING] * P[layout.K_R] * (0.7 * v2 + 0.4 * abs(r)) * r
    # outside the catalogue
    if F[fo.FS_FOULING] != 0.0:
        grown = F[fo.FS_FOULING] / (1.0 + math.exp(-(t - F[fo.FS_FOUL_TIME]) / 0.5))
        D += grown * P[layout.K_D0] * v2
        L -= 0.3 * grown * P[layout.K_L] * alpha * v2
    followed = 0.0
    if F[fo.FS_LIFT_LAG] != 0.0:
        followed = (alpha - x[fo.X_ALPHA]) / F[fo.FS_LIFT_TIME]
        L += F[fo.FS_LIFT_LAG] * P[layout.K_L] * (x[fo.X_ALPHA] - alpha) * v2
    T2 += F[fo.FS_ROLL_PITCH] * tilt * v2 + F[fo.FS_FLAP] * x[fo.X_FLAP_V]
    X, Y, Z = flow_to_body(u, v, w, -D, SF, -L)
    K, M, N = flow_to_body(u, v, w, T1, T2, T3)
    X += F[fo.FS_PUMP_JET] * abs(pump) / P[layout.BALLAST_RATE]
    # pulled at the tail, against the way that the tail itself goes
    line = 3.0 * F[fo.FS_TETHER] * math.sqrt(1.0 + max(down, 0.0))
    if F[fo.FS_TANGLE] != 0.0 and uniform(seed, fo.STREAM_TANGLE, int(t / TANGLE_BLOCK)) < 0.45:
        caught = F[fo.FS_TANGLE] * math.sin(math.pi * (t / TANGLE_BLOCK - math.floor(t / TANGLE_BLOCK))) ** 2
        X -= caught * v2
        N += TANGLE_ARM * caught * v2
    if line != 0.0:
        vt, wt = v + fo.FOREIGN_TAIL * r, w - fo.FOREIGN_TAIL * q
        pull = line * math.sqrt(u * u + vt * vt + wt * wt)
        X -= pull * u
        Y -= pull * vt
        Z -= pull * wt
        M += fo.FOREIGN_TAIL * pull * wt
        N -= fo.FOREIGN_TAIL * pull * vt
    return X, Y, Z, K, M, N, followed


@kernel
def foreign_water(F, waves, north, east, down, t):
    """Velocity of the water, m/s NED: a current that slowly turns, a logarithmic shear, a narrow sea of waves."""
    vn, ve, vd, z = 0.0, 0.0, 0.0, max(down, 0.0)
    if F[fo.FS_CURRENT_N] != 0.0 or F[fo.FS_CURRENT_E] != 0.0:
        bend = 0.15 * math.sin(2.0 * math.pi * t / (2.0 * F[fo.FS_DRIFT_TIME]) + F[fo.FS_DRIFT_PHASE])
        vn += F[fo.FS_CURRENT_N] - bend * F[fo.FS_CURRENT_E]
        ve += F[fo.FS_CURRENT_E] + bend * F[fo.FS_CURRENT_N]
    if F[fo.FS_SHEAR_N] != 0.0 or F[fo.FS_SHEAR_E] != 0.0:
        grown = math.log(1.0 + z / 1.5)
        vn += F[fo.FS_SHEAR_N] * grown
        ve += F[fo.FS_SHEAR_E] * grown
    if F[fo.FS_WAVES] != 0.0:
        for i in range(waves.shape[0]):
            kn, ke, omega = waves[i, fo.FW_NORTH], waves[i, fo.FW_EAST], waves[i, fo.FW_OMEGA]
            k = math.sqrt(kn * kn + ke * ke)
            phase = kn * north + ke * east - omega * t + waves[i, fo.FW_PHASE]
            orbit = F[fo.FS_WAVES] * waves[i, fo.FW_AMPLITUDE] * omega * math.exp(-k * z)
            vn += orbit * math.cos(phase) * kn / k
            ve += orbit * math.cos(phase) * ke / k
            vd -= orbit * math.sin(phase)
    return vn, ve, vd


@kernel
def lagging(F, x, out):
    """dx/dt of the sensors' two-stage lags."""
    if F[fo.FS_ATTITUDE_LAG] > 0.0:
        phi, theta, psi = euler_from_quaternion(x[3], x[4], x[5], x[6])
        stage = 0.5 * F[fo.FS_ATTITUDE_LAG]
        one, two = fo.X_ATT_1, fo.X_ATT_2
        out[one] = wrap_angle(phi - x[one]) / stage
        out[one + 1] = (theta - x[one + 1]) / stage
        out[one + 2] = wrap_angle(psi - x[one + 2]) / stage
        for i in range(3):
            out[two + i] = wrap_angle(x[one + i] - x[two + i]) / stage
    if F[fo.FS_DEPTH_LAG] > 0.0:
        stage = 0.5 * F[fo.FS_DEPTH_LAG]
        out[fo.X_DEPTH_1] = (x[2] - x[fo.X_DEPTH_1]) / stage
        out[fo.X_DEPTH_2] = (x[fo.X_DEPTH_1] - x[fo.X_DEPTH_2]) / stage


@kernel
def foreign_derivative(P, F, waves, seed, x, servo_cmd, slider_cmd, ballast_cmd, t, acc, Pw, out):
    """dx/dt into out (N_FX); acc (6,) disturbance acceleration, Pw (N_P) scratch."""
    for i in range(N_X, fo.N_FX):
        out[i] = 0.0
    q0, q1, q2, q3 = x[3], x[4], x[5], x[6]
    u, v, w, p, q, r = x[7], x[8], x[9], x[10], x[11], x[12]
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation_nb(q0, q1, q2, q3)
    vn, ve, vd = foreign_water(F, waves, x[0], x[1], x[2], t)
    down_rate = r31 * u + r32 * v + r33 * w + vd
    gamma, dgamma = servo_motion(P, F, x, servo_cmd, out)
    position, dposition = slider_motion(P, F, x, slider_cmd, r31, out)
    pump = pump_motion(P, F, x, ballast_cmd, out)
    mass_effects(P, F, gamma, position, x[15], x[2], t, x[fo.X_LOOSE], Pw)
    X, Y, Z, K, M, N, followed = water_effects(P, F, u, v, w, p, q, r, r32, x[2], down_rate, pump, x, t, seed)
    if F[fo.FB_ON] > 0.5:
        B1, B2, B3, B4, B5, B6 = body_wrench(F, u, v, w, p, q, r)
        X, Y, Z, K, M, N = X + B1, Y + B2, Z + B3, K + B4, M + B5, N + B6
    a1, a2, a3, a4, a5, a6 = accelerations(
        Pw, r31, r32, r33, u, v, w, p, q, r, gamma, position, x[15], dgamma, dposition, pump, X, Y, Z, K, M, N
    )
    out[0] = r11 * u + r12 * v + r13 * w + vn
    out[1] = r21 * u + r22 * v + r23 * w + ve
    out[2] = down_rate
    out[3], out[4], out[5], out[6] = quaternion_rate(q0, q1, q2, q3, p, q, r)
    out[7], out[8], out[9] = a1 + acc[0] + x[28], a2 + acc[1] + x[29], a3 + acc[2] + x[30]
    out[10], out[11], out[12] = a4 + acc[3] + x[31], a5 + acc[4] + x[32], a6 + acc[5] + x[33]
    if F[fo.FS_FLAP] != 0.0:
        out[fo.X_FLAP] = x[fo.X_FLAP_V]
        omega = F[fo.FS_FLAP_OMEGA]
        out[fo.X_FLAP_V] = -omega * (omega * x[fo.X_FLAP] + 2.0 * F[fo.FS_FLAP_ZETA] * x[fo.X_FLAP_V] + 2.0 * q)
    out[fo.X_ALPHA] = followed
    if F[fo.FS_LOOSE] != 0.0:
        out[fo.X_LOOSE] = (loose_place(r31) - x[fo.X_LOOSE]) / F[fo.FS_LOOSE_TIME]
    lagging(F, x, out)


@kernel
def foreign_step(P, F, waves, seed, x, servo_cmd, slider_cmd, ballast_cmd, t, dt, acc, Pw, work):
    """One step of Heun's method (second order; as stable as the midpoint's), in place; work (3, N_FX).

    In as many parts as equation (4) and the actuators ask for. Bodies of another form (up to 60 a second at 1 m/s) and
    effects ask for none at the foreign flight's 0.01 s.
    """
    k1, k2, y = work[0], work[1], work[2]
    parts = nominal_parts(MIDPOINT, P, x, 0, dt)
    h = dt / parts
    for part in range(int(parts)):
        now = t + part * h
        foreign_derivative(P, F, waves, seed, x, servo_cmd, slider_cmd, ballast_cmd, now, acc, Pw, k1)
        for i in range(fo.N_FX):
            y[i] = x[i] + h * k1[i]
        foreign_derivative(P, F, waves, seed, y, servo_cmd, slider_cmd, ballast_cmd, now + h, acc, Pw, k2)
        for i in range(fo.N_FX):
            x[i] += 0.5 * h * (k1[i] + k2[i])
    scale = 1.0 / math.sqrt(x[3] * x[3] + x[4] * x[4] + x[5] * x[5] + x[6] * x[6])
    for i in range(3, 7):
        x[i] *= scale


@kernel
def gusts(F, linear, angular, seed, count, dt, x):
    """Turbulence moved on by dt: an Ornstein-Uhlenbeck process on each axis, in x."""
    if F[fo.FS_TURBULENCE] == 0.0:
        return
    keep = math.exp(-dt / F[fo.FS_GUST_TIME])
    for i in range(6):
        strength = F[fo.FS_TURBULENCE] * (linear if i < 3 else angular)
        x[fo.X_GUST + i] = keep * x[fo.X_GUST + i] + strength * math.sqrt(1.0 - keep * keep) * gaussian(
            seed, fo.STREAM_GUST + i, count
        )
