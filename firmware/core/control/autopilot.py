"""One tick of the autopilot: samples to estimate, mission to targets, targets to commands, limits last.

`tick` is what the runtime calls 50 times a second and what a campaign calls from compiled code: the same function.
"""

import math

from glider.firmware.core.control.controllers import steer
from glider.firmware.core.control.guidance import follow, sequence
from glider.firmware.core.control.lyapunov_monitor import forget_lyapunov, monitor
from glider.firmware.core.estimation.navigation import navigate, stop_filter
from glider.firmware.core.estimation.sensing import sense, take_as_measured
from glider.firmware.core.jit import kernel
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.actuators import actuator_table, limited


@kernel
def score(legs, est, ap):
    """Add this tick's tracking errors up; depth only where the depth loop commands the ballast."""
    if math.isnan(legs[int(ap[ctl.LEG]), ctl.LEG_BALLAST]):
        ap[ctl.SUM_DEPTH] += (est[ctl.EST_DEPTH] - ap[ctl.REF_DEPTH]) ** 2
        ap[ctl.COUNT_DEPTH] += 1.0
    ap[ctl.SUM_PITCH] += (est[ctl.EST_PITCH] - ap[ctl.REF_PITCH]) ** 2
    ap[ctl.SUM_ROLL] += (est[ctl.EST_ROLL] - ap[ctl.REF_ROLL]) ** 2
    ap[ctl.COUNT_ATTITUDE] += 1.0


@kernel
def limit_commands(P, ap, servo, slider, ballast, dt, cmd):
    """Limits last: into cmd (3,) what may be sent, and into the memory what was."""
    wanted = (servo, slider, ballast)
    for i in range(3):
        low, high, rate, _ = actuator_table(P, layout.ACTUATORS[i])
        cmd[i] = ap[ctl.SENT_SERVO + i] = limited(wanted[i], ap[ctl.SENT_SERVO + i], low, high, rate, dt)


@kernel
def tick(P, C, legs, frame, est, ap, nav, cmd, t):
    """One tick at time t (s): frame (FRAME_SIZE,) in, cmd (3,) servo rad, slider m, ballast kg out.

    est (N_EST,), ap (N_AP,) and nav (N_NAV,) are the autopilot's memory. Waiting: actuators stay where they are.
    Completed or aborted: ballast to its light end, mass aft for nose up, servo centred, so that the vehicle surfaces.
    """
    sense(P, C, frame, est, t)
    if C[ctl.ESTIMATOR] == ctl.MEASURED:
        take_as_measured(est)
    else:
        navigate(P, C, nav, est, ap, t)
    decide(P, C, legs, est, ap, nav, cmd, t)


@kernel
def decide(P, C, legs, est, ap, nav, cmd, t):
    """The part of a tick behind the estimate: legs, targets, controller, limits; cmd (3,) out."""
    sequence(C, legs, est, ap, t)
    if ap[ctl.MODE] == ctl.FLYING:
        follow(C, legs, est, ap)
        servo, slider, ballast = steer(P, C, legs, est, ap, t)
        score(legs, est, ap)
    elif ap[ctl.MODE] == ctl.WAITING:
        servo, slider, ballast = ap[ctl.SENT_SERVO], ap[ctl.SENT_SLIDER], ap[ctl.SENT_BALLAST]
    else:
        servo, slider, ballast = 0.0, P[layout.SLIDER_MIN], P[layout.BALLAST_MIN]
    monitor(P, C, legs, nav, est, ap, t)
    ap[ctl.WANTED_SERVO], ap[ctl.WANTED_SLIDER], ap[ctl.WANTED_BALLAST] = servo, slider, ballast
    limit_commands(P, ap, servo, slider, ballast, C[ctl.DT], cmd)


@kernel
def reset(est, ap, nav):
    """Forget everything: no sample seen, nothing commanded, the filter not started, waiting for the first samples."""
    stop_filter(nav)
    est[:] = 0.0
    est[ctl.EST_IMU_TIME : ctl.EST_BEACON_TIME + 3] = -1.0
    ap[:] = 0.0
    ap[ctl.MODE] = ctl.WAITING
    ap[ctl.REACHED] = -1.0
    ap[ctl.ACTIVE_SINCE] = -math.inf
    forget_lyapunov(ap)
