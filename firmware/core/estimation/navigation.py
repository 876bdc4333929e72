"""The onboard estimator: the Kalman filter stepped once a tick with whatever samples are new.

A sample is older than the tick by its delay; it is carried forward by the filter's own rates before it is compared, so
that a slow beacon does not drag the depth behind. What is missing, late or refused is simply not there this tick.

A filter whose state or variances are not finite is restarted in the same tick from the newest measured values, and the
restart is counted: the supervisor reports it (row FAULT_ESTIMATE of the fault table).
"""

import math

from glider.firmware.core.estimation.estimator import estimator_start, estimator_step
from glider.firmware.core.jit import kernel
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import estimator_layout as kf
from glider.firmware.core.maths.rotations import euler_rates, quaternion_from_euler
from glider.firmware.core.maths.wide import anywhere, where
from glider.firmware.core.vehicle.layout import N_P, N_X, X_BALLAST, X_DOWN, X_EAST, X_NORTH, X_NU, X_QUAT, X_SLIDER
from glider.firmware.core.vehicle.state import actuators, euler_angles, rotation

NOISE_SCALE_TIME = 0.7  # s, in which the noise scale follows scores that are twice (or half) what they should be
LARGEST_NOISE_SCALE = 300.0  # times the vehicle file's disturbance
EULER_LIMIT = 1.4  # rad; beyond it Euler rates mean nothing and samples are taken as they are


@kernel
def is_new(est, nav, sensor):
    """Whether this sensor's newest sample has not been used; from now on it has."""
    newest, used = est[ctl.EST_IMU_TIME + sensor], nav[ctl.NAV_USED + sensor]
    new = newest > used
    nav[ctl.NAV_USED + sensor] = where(new, newest, used)
    return new


@kernel
def new_samples(est, x, nav, t):
    """The measurements of this tick into nav's z, NaN where nothing is new, each carried forward over its age."""
    z = nav[ctl.NAV_Z : ctl.NAV_Z + kf.N_Z]
    for i in range(kf.N_Z):
        z[i] = math.nan
    new = is_new(est, nav, 0)
    if anywhere(new):
        age = t - est[ctl.EST_IMU_TIME]
        phi, theta, _ = euler_angles(x)
        phi_rate, theta_rate, psi_rate = euler_rates(phi, theta, x[X_NU + 3], x[X_NU + 4], x[X_NU + 5])
        age = where(abs(theta) < EULER_LIMIT, age, 0.0)
        z[kf.Z_ROLL] = where(new, est[ctl.NEW_ROLL] + phi_rate * age, math.nan)
        z[kf.Z_PITCH] = where(new, est[ctl.NEW_PITCH] + theta_rate * age, math.nan)
        z[kf.Z_YAW] = where(new, est[ctl.NEW_YAW] + psi_rate * age, math.nan)
        for i in range(3):
            z[kf.Z_P + i] = where(new, est[ctl.NEW_P + i], math.nan)
    carried = est[ctl.NEW_DEPTH] + est[ctl.EST_DEPTH_RATE] * (t - est[ctl.EST_BEACON_TIME])
    z[kf.Z_DEPTH] = where(is_new(est, nav, 1), carried, math.nan)
    z[kf.Z_SLIDER] = where(is_new(est, nav, 2), est[ctl.NEW_SLIDER], math.nan)
    z[kf.Z_BALLAST] = where(is_new(est, nav, 3), est[ctl.NEW_BALLAST], math.nan)


@kernel
def start_filter(P, nav, est, t):
    """The first state: at rest, attitude and depth as first measured, actuators where the draw-wires say."""
    x = nav[ctl.NAV_X : ctl.NAV_X + kf.N_XE]
    cov = nav[ctl.NAV_COV : ctl.NAV_COV + kf.N_E * kf.N_E].reshape(kf.N_E, kf.N_E)
    work = nav[ctl.NAV_WORK : ctl.NAV_WORK + kf.N_WORK_ROWS * kf.N_W].reshape(kf.N_WORK_ROWS, kf.N_W)
    for i in range(kf.N_XE):
        x[i] = 0.0
    x[X_DOWN] = est[ctl.NEW_DEPTH]
    x[X_QUAT], x[X_QUAT + 1], x[X_QUAT + 2], x[X_QUAT + 3] = quaternion_from_euler(
        est[ctl.NEW_ROLL], est[ctl.NEW_PITCH], est[ctl.NEW_YAW]
    )
    x[X_SLIDER], x[X_BALLAST] = est[ctl.NEW_SLIDER], est[ctl.NEW_BALLAST]
    nav[ctl.NAV_INFLATION], nav[ctl.NAV_INFLATION + 1] = 1.0, 1.0
    for i in range(kf.N_Z):
        nav[ctl.NAV_REJECTED + i] = 0.0
    for i in range(4):
        nav[ctl.NAV_USED + i] = -1.0
    spread = nav[ctl.NAV_SPREAD : ctl.NAV_SPREAD + kf.N_E]
    settings, sigma = nav[ctl.NAV_SETTINGS : ctl.NAV_SETTINGS + kf.N_S], nav[ctl.NAV_SIGMA : ctl.NAV_SIGMA + N_P]
    estimator_start(P, settings, sigma, x, cov, spread, work)
    nav[ctl.NAV_RUNNING], nav[ctl.NAV_TIME] = 1.0, t
    nav[ctl.NAV_NOISE_SCALE] = 1.0
    nav[ctl.NAV_CALM] = nav[ctl.NAV_SETTINGS + kf.S_LINEAR]
    nav[ctl.NAV_CALM + 1] = nav[ctl.NAV_SETTINGS + kf.S_ANGULAR]


@kernel
def stop_filter(nav):
    """Stop a filter that runs, and give the process noise the disturbance of the vehicle file back."""
    if nav[ctl.NAV_RUNNING] == 1.0:
        nav[ctl.NAV_SETTINGS + kf.S_LINEAR] = nav[ctl.NAV_CALM]
        nav[ctl.NAV_SETTINGS + kf.S_ANGULAR] = nav[ctl.NAV_CALM + 1]
    nav[ctl.NAV_RUNNING] = 0.0


@kernel
def is_finite(nav):
    """Return whether every number of the filter's state, and every variance, is finite."""
    finite = True
    for i in range(kf.N_XE):
        finite = finite and math.isfinite(nav[ctl.NAV_X + i])
    for i in range(kf.N_E):
        finite = finite and math.isfinite(nav[ctl.NAV_COV + i * (kf.N_E + 1)])
    return finite


@kernel
def restart_filter(P, nav, est, north, east, t):
    """Start the filter anew at time t (s) from the newest measured values; north, east (m): the last position known."""
    stop_filter(nav)
    start_filter(P, nav, est, t)
    nav[ctl.NAV_X + X_NORTH], nav[ctl.NAV_X + X_EAST] = north, east
    for i in range(3):
        nav[ctl.NAV_X + X_NU + 3 + i] = est[ctl.NEW_P + i]


@kernel
def write_state(x, est):
    """A state (N_X or longer) as the rest of the autopilot reads it."""
    est[ctl.EST_X], est[ctl.EST_Y], est[ctl.EST_DEPTH] = x[X_NORTH], x[X_EAST], x[X_DOWN]
    est[ctl.EST_ROLL], est[ctl.EST_PITCH], est[ctl.EST_YAW] = euler_angles(x)
    _, _, _, _, _, _, r31, r32, r33 = rotation(x)
    u, v, w = x[X_NU], x[X_NU + 1], x[X_NU + 2]
    est[ctl.EST_U], est[ctl.EST_V], est[ctl.EST_W] = u, v, w
    est[ctl.EST_DEPTH_RATE] = r31 * u + r32 * v + r33 * w
    for i in range(3):
        est[ctl.EST_P + i] = x[X_NU + 3 + i]
    est[ctl.EST_SERVO], est[ctl.EST_SLIDER], est[ctl.EST_BALLAST] = actuators(x)


@kernel
def write_errors(x, cov, est):
    """What the filter knows beside the state: current, model error, and how sure it is."""
    _, _, _, _, _, _, r31, _, r33 = rotation(x)
    est[ctl.EST_WATER_N], est[ctl.EST_WATER_E] = x[kf.X_WATER], x[kf.X_WATER + 1]
    for i in range(6):
        est[ctl.MODEL_ERROR + i] = x[kf.X_ERR + i]
    est[ctl.SD_DEPTH_RATE] = math.sqrt(
        r31 * r31 * cov[kf.E_NU, kf.E_NU]
        + r33 * r33 * cov[kf.E_NU + 2, kf.E_NU + 2]
        + 2.0 * r31 * r33 * cov[kf.E_NU, kf.E_NU + 2]
    )
    est[ctl.SD_PITCH] = math.sqrt(cov[kf.E_ATT + 1, kf.E_ATT + 1])
    est[ctl.SD_U] = math.sqrt(cov[kf.E_NU, kf.E_NU])


@kernel
def write_estimate(nav, est, given):
    """Write what a filter knows into est; given: the state itself is the one from outside (GIVEN)."""
    x = nav[ctl.NAV_X : ctl.NAV_X + kf.N_XE]
    write_state(nav[ctl.NAV_GIVEN : ctl.NAV_GIVEN + N_X] if given else x, est)
    write_errors(x, nav[ctl.NAV_COV : ctl.NAV_COV + kf.N_E * kf.N_E].reshape(kf.N_E, kf.N_E), est)
    est[ctl.NOISE_SCALE] = nav[ctl.NAV_NOISE_SCALE]


@kernel
def adapt_process_noise(nav, scores, dt):
    """Adapt the process noise to the water: the gyro's squared innovations over their variance average 1 where it fits.

    A filter with the noise of calm water lags behind rough water, and one with that of rough water hands the gyro's
    noise on. The noise scale multiplies the disturbance's strength, and its square the spectral densities; it moves by
    the scores' logarithm, so that one wild sample does little, and never below what the vehicle file says.
    """
    total, count = 0.0, 0.0
    for i in range(kf.Z_P, kf.Z_R + 1):
        unseen = math.isnan(scores[i])
        score = where(unseen, 0.0, scores[i])
        total += score * score
        count += where(unseen, 0.0, 1.0)
    seen = count > 0.0
    if not anywhere(seen):
        return
    step = min(total / where(seen, count, 1.0), 4.0) - 1.0
    noise_scale = nav[ctl.NAV_NOISE_SCALE] * math.exp(step * dt / NOISE_SCALE_TIME)
    noise_scale = where(seen, min(max(noise_scale, 1.0), LARGEST_NOISE_SCALE), nav[ctl.NAV_NOISE_SCALE])
    linear, angular = ctl.NAV_SETTINGS + kf.S_LINEAR, ctl.NAV_SETTINGS + kf.S_ANGULAR
    nav[ctl.NAV_NOISE_SCALE] = noise_scale
    nav[linear] = where(seen, nav[ctl.NAV_CALM] * noise_scale * noise_scale, nav[linear])
    nav[angular] = where(seen, nav[ctl.NAV_CALM + 1] * noise_scale * noise_scale, nav[angular])


@kernel
def step_filter(P, nav, est, sent, given, t):
    """One step of a filter that runs: the commands sent last, this tick's samples, the estimate into est.

    sent (3,): servo rad, slider m, ballast kg; given: whether the state is said from outside (GIVEN). With nav and est
    of wide numbers, one step of as many filters.
    """
    x = nav[ctl.NAV_X : ctl.NAV_X + kf.N_XE]
    cov = nav[ctl.NAV_COV : ctl.NAV_COV + kf.N_E * kf.N_E].reshape(kf.N_E, kf.N_E)
    work = nav[ctl.NAV_WORK : ctl.NAV_WORK + kf.N_WORK_ROWS * kf.N_W].reshape(kf.N_WORK_ROWS, kf.N_W)
    new_samples(est, x, nav, t)
    dt = t - nav[ctl.NAV_TIME]
    nav[ctl.NAV_TIME] = t
    scores = nav[ctl.NAV_SCORES : ctl.NAV_SCORES + kf.N_Z]
    estimator_step(
        P, nav[ctl.NAV_SETTINGS : ctl.NAV_SETTINGS + kf.N_S], nav[ctl.NAV_SIGMA : ctl.NAV_SIGMA + N_P], x, cov,
        nav[ctl.NAV_INFLATION : ctl.NAV_INFLATION + 2], kf.COMMANDED, sent[0], sent[1], sent[2],
        dt, nav[ctl.NAV_Z : ctl.NAV_Z + kf.N_Z], nav[ctl.NAV_REJECTED : ctl.NAV_REJECTED + kf.N_Z], scores, work,
    )  # fmt: skip
    adapt_process_noise(nav, scores, dt)
    write_estimate(nav, est, given)


@kernel
def navigate(P, C, nav, est, ap, t):
    """Step the filter at time t (s); it starts with the first samples of IMU and beacon.

    A filter that is not finite after its step is restarted: the estimate of this tick is then the measured values, and
    ap[FILTER_RESTARTS] is one more.
    """
    if est[ctl.EST_STARTED] == 0.0:
        return
    if nav[ctl.NAV_RUNNING] == 0.0:
        start_filter(P, nav, est, t)
    given = C[ctl.ESTIMATOR] == ctl.GIVEN
    north, east = est[ctl.EST_X], est[ctl.EST_Y]
    step_filter(P, nav, est, ap[ctl.SENT_SERVO : ctl.SENT_SERVO + 3], given, t)
    if not is_finite(nav):
        restart_filter(P, nav, est, north, east, t)
        write_estimate(nav, est, given)
        ap[ctl.FILTER_RESTARTS] += 1.0
