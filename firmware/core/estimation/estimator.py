"""The estimator: an extended Kalman filter over the nominal flight, its error in attitude taken as a small rotation.

State x, covariance `cov` (N_E, N_E) of the error state and everything else stand in the caller's arrays as
firmware/core/layouts/estimator_layout has them; a step allocates nothing.

Prediction: equation (1) with the model's error added, in sub-steps of at most MAX_STEP, and of less where the
vehicle's time constants ask for it (firmware/core/vehicle/time_constants). The model's error is a first
order Gauss-Markov process whose variance follows, state by state, from the vehicle file's [uncertainty]: errors of
parameters stay, so their accelerations change as slowly as the flight does; that is S_ERROR_TIME. The disturbance held
0.1 s enters as white noise of the same spectral density. The covariance is carried by the flight linearised about
the state. What equation (1) gives to that serves for HOLD seconds, and the model error's covariance C for HOLD_ERROR,
or until speeds have changed (MOVED_SHARE, MOVED_RATE). FRESH in `mode` works both out anew at every step.

Measurements z (N_Z), NaN where there is none, one after the other; what they take off the covariance waits in `work`
and comes off in one go. What does not fit:
- An innovation beyond GATE sigma is left out: a spike moves nothing.
- While attitude, gyro, depth or position are beyond it, the variance of the model's error grows by the factors
  `inflation` (2: linear, angular), up to ERROR_LINEAR and ERROR_ANGULAR: a vehicle that is not the one in the file is
  followed by its sensors.
- A sensor rejected for REJECTED_AT_MOST seconds has jumped, or the filter has: the covariance is widened in what it
  measures, and the filter follows. Not so the gyro, since attitude tells the rates too.
- A gyro that is seen to be biased has a bias that moves (GYRO_WANDER): one of wrong scale is followed like that.

`cov` says how sure the filter is of what its sensors show: constant biases of attitude, depth and draw-wires, which
nothing it sees can tell from the truth, are not in it.

Valid for |pitch| < 84 deg in roll and yaw (beyond it both are skipped: Euler angles say little there) and for speeds
up to SPEED_LIMIT, where the update holds the estimate. Tested in tests/unit/estimator.
"""

import math

from glider.firmware.core.estimation.estimator_update import estimator_update
from glider.firmware.core.jit import kernel
from glider.firmware.core.layouts import estimator_layout as kf
from glider.firmware.core.maths.steps import MIDPOINT, end_stage
from glider.firmware.core.maths.wide import anywhere, everywhere, where
from glider.firmware.core.vehicle.actuators import actuator_rates
from glider.firmware.core.vehicle.flight import add_accelerations, state_derivative
from glider.firmware.core.vehicle.layout import N_X, SERVO_TAU, X_NU, X_QUAT
from glider.firmware.core.vehicle.linearise import N_POINT, linearise, linearise_motion, model_error
from glider.firmware.core.vehicle.state import actuators, normalise_attitude, quaternion
from glider.firmware.core.vehicle.time_constants import nominal_parts

T0, R0 = kf.W_T * kf.N_W, kf.W_TURNED * kf.N_W  # in the flat work: T = F cov, and A's columns


@kernel
def actuator_speeds(P, x, mode, c_servo, c_slider, c_ballast):
    """Speeds of servo, slider, ballast: c_ is each one's command or, where mode says driven, its speed itself."""
    servo, slider, ballast = actuators(x)
    ds, dl, db = actuator_rates(P, servo, slider, ballast, c_servo, c_slider, c_ballast)
    if mode & kf.SERVO_DRIVEN:
        ds = c_servo
    if mode & kf.SLIDER_DRIVEN:
        dl = c_slider
    if mode & kf.BALLAST_DRIVEN:
        db = c_ballast
    return ds, dl, db


@kernel
def flight_derivative(P, x, mode, c_servo, c_slider, c_ballast, out):
    """dx/dt into out[0:16], the model's error added to the accelerations, the water carrying the position."""
    ds, dl, db = actuator_speeds(P, x, mode, c_servo, c_slider, c_ballast)
    state_derivative(P, x, ds, dl, db, 0.0, x[kf.X_WATER], x[kf.X_WATER + 1], 0.0, out)
    add_accelerations(x, kf.X_ERR, out)


@kernel
def predict_state(P, x, mode, c_servo, c_slider, c_ballast, d, dt, k, total, y):
    """One midpoint step of x in place; the model's error shrinks by d[3:9]. k, total, y are scratch of N_XE.

    A lane whose dt is 0 stays as it is, to the bit.
    """
    turned = quaternion(x)
    for i in range(kf.N_XE):
        y[i] = x[i]
    for stage in range(len(MIDPOINT)):
        flight_derivative(P, y, mode, c_servo, c_slider, c_ballast, k)
        end_stage(MIDPOINT, stage, dt, x, k, total, y, N_X)
    for i in range(6):
        x[kf.X_ERR + i] *= d[3 + i]
    normalise_attitude(x)
    for i in range(4):
        x[X_QUAT + i] = where(dt > 0.0, x[X_QUAT + i], turned[i])


@kernel
def decays(P, settings, mode, dt, d):
    """Factors by which the errors from E_ACT on shrink over dt, into d (N_E - E_ACT)."""
    for i in range(3):
        d[i] = 1.0 if mode & (1 << i) else math.exp(-dt / P[SERVO_TAU + 4 * i])
    error = math.exp(-dt / settings[kf.S_ERROR_TIME])
    for i in range(kf.E_ERR - kf.E_ACT, kf.E_GYRO - kf.E_ACT):
        d[i] = error
    for i in range(kf.E_GYRO - kf.E_ACT, kf.N_E - kf.E_ACT):
        d[i] = 1.0


@kernel
def carry_rows(p, A, dt, m):
    """The rows of F cov that are not trivial, into m from T0 on; p is cov, m work, both flat. F = I + A dt."""
    for i in range(kf.E_ATT):
        a3, a4, a5 = dt * A[i, 3], dt * A[i, 4], dt * A[i, 5]
        a6, a7, a8 = dt * A[i, 6], dt * A[i, 7], dt * A[i, 8]
        to, row, water = T0 + i * kf.N_W, i * kf.N_E, (kf.E_WATER + min(i, 1)) * kf.N_E
        carried = dt if i < 2 else 0.0
        for j in range(kf.N_E):
            m[to + j] = (
                p[row + j] + carried * p[water + j]
                + a3 * p[3 * kf.N_E + j] + a4 * p[4 * kf.N_E + j] + a5 * p[5 * kf.N_E + j]
                + a6 * p[6 * kf.N_E + j] + a7 * p[7 * kf.N_E + j] + a8 * p[8 * kf.N_E + j]
            )  # fmt: skip
    for i in range(kf.E_ATT, kf.E_NU):
        a3, a4, a5 = dt * A[i, 3], dt * A[i, 4], dt * A[i, 5]
        to, row = T0 + i * kf.N_W, i * kf.N_E
        for j in range(kf.N_E):
            m[to + j] = (
                p[row + j] + dt * p[row + (kf.E_NU + 3 - kf.E_ATT) * kf.N_E + j]
                + a3 * p[3 * kf.N_E + j] + a4 * p[4 * kf.N_E + j] + a5 * p[5 * kf.N_E + j]
            )  # fmt: skip
    for i in range(kf.E_NU, kf.N_MOVING):
        a3, a4, a5, a6, a7, a8 = dt * A[i, 3], dt * A[i, 4], dt * A[i, 5], dt * A[i, 6], dt * A[i, 7], dt * A[i, 8]
        a9, aa, ab, ac, ad, ae = dt * A[i, 9], dt * A[i, 10], dt * A[i, 11], dt * A[i, 12], dt * A[i, 13], dt * A[i, 14]
        to, row = T0 + i * kf.N_W, i * kf.N_E
        for j in range(kf.N_E):
            m[to + j] = (
                p[row + j] + dt * p[row + (kf.E_ERR - kf.E_NU) * kf.N_E + j]
                + a3 * p[3 * kf.N_E + j] + a4 * p[4 * kf.N_E + j] + a5 * p[5 * kf.N_E + j]
                + a6 * p[6 * kf.N_E + j] + a7 * p[7 * kf.N_E + j] + a8 * p[8 * kf.N_E + j]
                + a9 * p[9 * kf.N_E + j] + aa * p[10 * kf.N_E + j] + ab * p[11 * kf.N_E + j]
                + ac * p[12 * kf.N_E + j] + ad * p[13 * kf.N_E + j] + ae * p[14 * kf.N_E + j]
            )  # fmt: skip


@kernel
def predict_covariance(cov, A, d, dt, work):
    """cov = F cov F' over dt: F = I + A dt for what moves, d on the diagonal below it.

    Loops run along rows, over flat arrays and numbers known beforehand, so that they compile to vector code.
    """
    p, m = cov.reshape(kf.N_E * kf.N_E), work.reshape(kf.N_WORK_ROWS * kf.N_W)
    carry_rows(p, A, dt, m)
    for i in range(kf.N_MOVING):
        to, row = T0 + i * kf.N_W, i * kf.N_E
        t3, t4, t5, t6, t7, t8 = m[to + 3], m[to + 4], m[to + 5], m[to + 6], m[to + 7], m[to + 8]
        t9, ta, tb, tc, td, te = m[to + 9], m[to + 10], m[to + 11], m[to + 12], m[to + 13], m[to + 14]
        for j in range(i + 1):  # what is beyond the diagonal comes from the other side of it
            p[row + j] = m[to + j] + dt * (
                t3 * m[R0 + j] + t4 * m[R0 + kf.N_W + j] + t5 * m[R0 + 2 * kf.N_W + j]
                + t6 * m[R0 + 3 * kf.N_W + j] + t7 * m[R0 + 4 * kf.N_W + j] + t8 * m[R0 + 5 * kf.N_W + j]
                + t9 * m[R0 + 6 * kf.N_W + j] + ta * m[R0 + 7 * kf.N_W + j] + tb * m[R0 + 8 * kf.N_W + j]
                + tc * m[R0 + 9 * kf.N_W + j] + td * m[R0 + 10 * kf.N_W + j] + te * m[R0 + 11 * kf.N_W + j]
            )  # fmt: skip
        p[row] += dt * m[to + kf.E_WATER]
        p[row + 1] += dt * m[to + kf.E_WATER + 1]
        for j in range(6):
            p[row + kf.E_NU + j] += dt * m[to + kf.E_ERR + j]
        for j in range(i):
            p[j * kf.N_E + i] = p[row + j]
        for j in range(kf.E_ACT, kf.N_E):
            p[row + j] = m[to + j] * d[j - kf.E_ACT]
            p[j * kf.N_E + i] = p[row + j]
    for i in range(kf.E_ACT, kf.N_E):
        for j in range(kf.E_ACT, kf.N_E):
            p[i * kf.N_E + j] *= d[i - kf.E_ACT] * d[j - kf.E_ACT]


@kernel
def add_process_noise(settings, x, cov, C, d, ds, dl, db, dt):
    """What dt adds: disturbance on nu, what actuators do beside their model, and the drive of the model's error."""
    for i in range(3):
        cov[kf.E_NU + i, kf.E_NU + i] += settings[kf.S_LINEAR] * dt
        cov[kf.E_NU + 3 + i, kf.E_NU + 3 + i] += settings[kf.S_ANGULAR] * dt
    wrong = settings[kf.S_SPEED_ERROR]
    cov[kf.E_ACT, kf.E_ACT] += (settings[kf.S_SERVO] + wrong * ds * ds) * dt
    cov[kf.E_ACT + 1, kf.E_ACT + 1] += (settings[kf.S_SLIDER] + wrong * dl * dl) * dt
    cov[kf.E_ACT + 2, kf.E_ACT + 2] += (settings[kf.S_BALLAST] + wrong * db * db) * dt
    for i in range(kf.N_E - kf.E_GYRO):
        cov[kf.E_GYRO + i, kf.E_GYRO + i] += settings[kf.S_WALK + i] * dt
    for i in range(3):
        cov[kf.E_GYRO + i, kf.E_GYRO + i] += kf.GYRO_WANDER * x[kf.X_GYRO + i] * x[kf.X_GYRO + i] * dt
    share = 1.0 - d[3] * d[3]  # keeps the variance at C where C stays
    for i in range(6):
        for j in range(6):
            cov[kf.E_ERR + i, kf.E_ERR + j] += share * C[i, j]


@kernel
def error_covariance(P, settings, sigma, ds, dl, db, C, work):
    """C (6, 6), the covariance of the model's error where A was taken, from parameters and the draw-wires' biases."""
    A, y = work[kf.W_A : kf.W_A + kf.N_MOVING], work[kf.W_POINT]
    g, Pt = work[kf.W_SCRATCH + 3], work[kf.W_SCRATCH + 4]
    model_error(P, sigma, ds, dl, db, y, C, Pt, g)
    # a biased draw-wire is a mass that is not where the filter has it
    for i in range(6):
        for j in range(6):
            C[i, j] += (
                settings[kf.S_SLIDER_BIAS] * A[kf.E_NU + i, kf.E_ACT + 1] * A[kf.E_NU + j, kf.E_ACT + 1]
                + settings[kf.S_BALLAST_BIAS] * A[kf.E_NU + i, kf.E_ACT + 2] * A[kf.E_NU + j, kf.E_ACT + 2]
            )


@kernel
def scale_error(x, inflation, C, f, dt, drive):
    """Into drive: C, where the model errs by more than its sigma, inflated; at least the error's own square."""
    fade = math.exp(-dt / kf.INFLATION_TIME)
    for n in range(2):
        inflation[n] = where(dt > 0.0, 1.0 + (inflation[n] - 1.0) * fade, inflation[n])
    for i in range(6):
        most = kf.ERROR_LINEAR if i < 3 else kf.ERROR_ANGULAR
        f[i] = math.sqrt(max(1.0, min(inflation[i // 3], most * most / max(C[i, i], 1e-12))))
    for i in range(6):
        for j in range(6):
            drive[i, j] = C[i, j] * (f[i] * f[j])
        most = kf.ERROR_LINEAR if i < 3 else kf.ERROR_ANGULAR
        error = min(abs(x[kf.X_ERR + i]), most)
        drive[i, i] = max(drive[i, i], error * error)


@kernel
def moved(x, y):
    """Have speeds changed by more than MOVED_SHARE of the speed, or rates by MOVED_RATE, since y = [k, nu, ..]?"""
    change, turn, speed = 0.0, 0.0, 0.0
    for i in range(3):
        faster, turning = x[X_NU + i] - y[3 + i], x[X_NU + 3 + i] - y[6 + i]
        change += faster * faster
        turn += turning * turning
        speed += y[3 + i] * y[3 + i]
    return (change > kf.MOVED_SHARE * kf.MOVED_SHARE * speed) | (turn > kf.MOVED_RATE * kf.MOVED_RATE)


@kernel
def take_over(due, fresh, kept):
    """The rows of `fresh` into those of `kept` where `due` says so."""
    for i in range(kept.shape[0]):
        for j in range(kf.N_COUPLED):
            kept[i, j] = where(due, fresh[i, j], kept[i, j])


@kernel
def linearise_anew(P, x, ds, dl, db, due, work):
    """A at x and the point that it is taken at, into work, where `due` says so."""
    A, y = work[kf.W_A : kf.W_A + kf.N_MOVING], work[kf.W_POINT]
    if everywhere(due):
        linearise(P, x, ds, dl, db, A, y)
        return
    fresh, point = work[kf.W_T : kf.W_T + kf.N_MOVING], work[kf.W_K]
    linearise(P, x, ds, dl, db, fresh, point)
    take_over(due, fresh[kf.E_NU :], A[kf.E_NU :])
    for i in range(N_POINT):
        y[i] = where(due, point[i], y[i])


@kernel
def error_anew(P, settings, sigma, ds, dl, db, due, work):
    """The covariance C of the model's error where A was taken, into work, where `due` says so."""
    C, fresh = work[kf.W_C : kf.W_C + 6], work[kf.W_DRIVE : kf.W_DRIVE + 6]
    if everywhere(due):
        error_covariance(P, settings, sigma, ds, dl, db, C, work)
        return
    error_covariance(P, settings, sigma, ds, dl, db, fresh, work)
    for i in range(6):
        for j in range(6):
            C[i, j] = where(due, fresh[i, j], C[i, j])


@kernel
def linearise_where_due(P, settings, sigma, x, ds, dl, db, dt, work):
    """A at x into work; equation (1) linearised anew, and C, where their time is over or speeds have changed."""
    A, turned = work[kf.W_A : kf.W_A + kf.N_MOVING], work[kf.W_TURNED : kf.W_TURNED + kf.N_COUPLED - kf.E_ATT]
    held = work[kf.W_HELD]
    gone, over = (dt > 0.0) & moved(x, work[kf.W_POINT]), (dt > 0.0) & (held[0] < 0.5 * dt)
    error_over = over & (held[1] < 0.5 * dt)
    due, error_due = gone | over, gone | error_over
    if anywhere(due):
        linearise_anew(P, x, ds, dl, db, due, work)
    if not everywhere(due):
        linearise_motion(x, work[kf.W_POINT], A)
    if anywhere(error_due):
        error_anew(P, settings, sigma, ds, dl, db, error_due, work)
    # not from where speeds have changed: filters side by side stay in step, and are linearised at once
    held[0] = where(over, kf.HOLD_LINEARISED, held[0]) - dt
    held[1] = where(error_over, kf.HOLD_ERROR, held[1]) - dt
    for k in range(kf.N_COUPLED - kf.E_ATT):
        for i in range(kf.N_MOVING):
            turned[k, i] = A[i, kf.E_ATT + k]


@kernel
def estimator_predict(P, settings, sigma, x, cov, inflation, mode, c_servo, c_slider, c_ballast, dt, work):
    """Carry x and cov over dt (s) in sub-steps of at most MAX_STEP and short enough for the vehicle's time constants.

    Actuators as in actuator_speeds. Each lane takes as many sub-steps as its own state asks for; a lane that waits for
    one with more may differ in the last place of its covariance.
    """
    A, C, drive = work[kf.W_A : kf.W_A + kf.N_MOVING], work[kf.W_C : kf.W_C + 6], work[kf.W_DRIVE : kf.W_DRIVE + 6]
    k, y, d = work[kf.W_SCRATCH], work[kf.W_SCRATCH + 1], work[kf.W_SCRATCH + 2]
    scratch = work[kf.W_SCRATCH + 3]
    steps = 1
    while anywhere(steps < dt / kf.MAX_STEP - 1e-9):
        steps += 1
    count = steps * nominal_parts(MIDPOINT, P, x, mode, dt / steps)
    step, done = dt / count, 0
    while anywhere(done < count):
        h = where(done < count, step, 0.0)  # a lane that is there waits for the others
        done += 1
        ds, dl, db = actuator_speeds(P, x, mode, c_servo, c_slider, c_ballast)
        if mode & kf.FRESH:
            work[kf.W_HELD, 0], work[kf.W_HELD, 1] = 0.0, 0.0
        linearise_where_due(P, settings, sigma, x, ds, dl, db, h, work)
        decays(P, settings, mode, h, d)
        scale_error(x, inflation, C, scratch, h, drive)
        predict_covariance(cov, A, d, h, work)
        add_process_noise(settings, x, cov, drive, d, ds, dl, db, h)
        predict_state(P, x, mode, c_servo, c_slider, c_ballast, d, h, k, scratch, y)


@kernel
def estimator_step(
    P, settings, sigma, x, cov, inflation, mode, c_servo, c_slider, c_ballast, dt, z, rejected_for_s, scores, work
):
    """One step of the filter: dt (s) under the commands in force, then the measurements z at its end."""
    estimator_predict(P, settings, sigma, x, cov, inflation, mode, c_servo, c_slider, c_ballast, dt, work)
    estimator_update(P, settings, x, cov, inflation, z, rejected_for_s, scores, dt, work)


@kernel
def estimator_start(P, settings, sigma, x, cov, spread, work):
    """The covariance before the first measurement: `spread` (N_E, 1 sigma) on the diagonal, the model's error at x."""
    A, C = work[kf.W_A : kf.W_A + kf.N_MOVING], work[kf.W_C : kf.W_C + 6]
    for i in range(kf.N_E):
        for j in range(kf.N_E):
            cov[i, j] = 0.0
    for i in range(kf.N_E):
        cov[i, i] = spread[i] * spread[i]
    linearise(P, x, 0.0, 0.0, 0.0, A, work[kf.W_POINT])
    error_covariance(P, settings, sigma, 0.0, 0.0, 0.0, C, work)
    work[kf.W_HELD, 0], work[kf.W_HELD, 1] = 0.0, 0.0
    for i in range(6):
        for j in range(6):
            cov[kf.E_ERR + i, kf.E_ERR + j] = C[i, j]
