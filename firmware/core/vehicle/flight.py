"""How the vehicle moves: the state's derivative, and the nominal flight in uniformly moving water.

State x (N_X = 16): position north, east, down (m), attitude quaternion, nu = u v w p q r (u, v, w relative to the
water), servo (rad), slider (m), ballast (kg).
"""

from glider.firmware.core.jit import inlined_kernel, kernel
from glider.firmware.core.maths.rotations import quaternion_rate, rotation_nb
from glider.firmware.core.maths.steps import RK4, end_stage
from glider.firmware.core.maths.wide import anywhere, where
from glider.firmware.core.vehicle.actuators import actuator_rates
from glider.firmware.core.vehicle.layout import N_X, X_BALLAST, X_DOWN, X_EAST, X_NORTH, X_NU, X_QUAT, X_SERVO, X_SLIDER
from glider.firmware.core.vehicle.motion import accelerations
from glider.firmware.core.vehicle.state import actuators, normalise_attitude, quaternion, velocities
from glider.firmware.core.vehicle.time_constants import nominal_parts


@inlined_kernel
def body_derivative(
    P, x, servo, slider, ballast, servo_rate, slider_rate, ballast_rate, net, X, Y, Z, K, M, N,
    force, water_n, water_e, water_d, out,
):  # fmt: skip
    """Rates of position, attitude and nu into out[0:13], with the masses where they are said to be, not where x has
    the actuators.

    net: mass at the origin (kg) beside P's own. X .. N: a wrench in body axes (N, N m) beside the water's; force (N):
    downward at the origin; water_n ..: velocity of the water (m/s, NED).
    """
    q0, q1, q2, q3 = quaternion(x)
    u, v, w, p, q, r = velocities(x)
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = rotation_nb(q0, q1, q2, q3)
    ud, vd, wd, pd, qd, rd = accelerations(
        P, r31, r32, r33, u, v, w, p, q, r, servo, slider, ballast, servo_rate, slider_rate, ballast_rate,
        X + force * r31, Y + force * r32, Z + force * r33, K, M, N, net,
    )  # fmt: skip
    out[X_NORTH] = r11 * u + r12 * v + r13 * w + water_n
    out[X_EAST] = r21 * u + r22 * v + r23 * w + water_e
    out[X_DOWN] = r31 * u + r32 * v + r33 * w + water_d
    out[X_QUAT], out[X_QUAT + 1], out[X_QUAT + 2], out[X_QUAT + 3] = quaternion_rate(q0, q1, q2, q3, p, q, r)
    out[X_NU], out[X_NU + 1], out[X_NU + 2] = ud, vd, wd
    out[X_NU + 3], out[X_NU + 4], out[X_NU + 5] = pd, qd, rd


@inlined_kernel
def state_derivative(P, x, servo_rate, slider_rate, ballast_rate, force, water_n, water_e, water_d, out):
    """dx/dt of the vehicle into out[0:16], its actuators at these speeds; force and water as in body_derivative."""
    servo, slider, ballast = actuators(x)
    body_derivative(
        P, x, servo, slider, ballast, servo_rate, slider_rate, ballast_rate, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        force, water_n, water_e, water_d, out,
    )  # fmt: skip
    out[X_SERVO], out[X_SLIDER], out[X_BALLAST] = servo_rate, slider_rate, ballast_rate


@inlined_kernel
def add_accelerations(acc, at, out):
    """Add six accelerations, those from acc[at] on, to the rates of nu in out."""
    for i in range(6):
        out[X_NU + i] += acc[at + i]


@kernel
def nominal_derivative(P, x, cmd_servo, cmd_slider, cmd_ballast, water_n, water_e, water_d, out):
    """dx/dt of the nominal vehicle, into out[0:16], in water moving uniformly at water_n.. (m/s, NED)."""
    servo, slider, ballast = actuators(x)
    ds, dl, db = actuator_rates(P, servo, slider, ballast, cmd_servo, cmd_slider, cmd_ballast)
    state_derivative(P, x, ds, dl, db, 0.0, water_n, water_e, water_d, out)


@kernel
def nominal_step(P, x, cmd_servo, cmd_slider, cmd_ballast, water_n, water_e, water_d, dt, work):
    """One Runge-Kutta step, in place, in as many parts as its time constants ask for (time_constants).

    work is (3, N_X) of scratch, or more.
    """
    k, total, y = work[0], work[1], work[2]
    parts, part = nominal_parts(RK4, P, x, 0, dt), 0
    h = dt / parts
    while anywhere(part < parts):
        ahead = where(part < parts, h, 0.0)  # a lane that is there stays where it is
        for i in range(N_X):
            y[i] = x[i]
        for stage in range(len(RK4)):
            nominal_derivative(P, y, cmd_servo, cmd_slider, cmd_ballast, water_n, water_e, water_d, k)
            end_stage(RK4, stage, ahead, x, k, total, y, N_X)
        part += 1
    normalise_attitude(x)


@kernel
def nominal_run(P, x, cmd_servo, cmd_slider, cmd_ballast, water_n, water_e, water_d, dt, steps, work):
    """`steps` Runge-Kutta steps under held commands, in place."""
    for _ in range(steps):
        nominal_step(P, x, cmd_servo, cmd_slider, cmd_ballast, water_n, water_e, water_d, dt, work)
