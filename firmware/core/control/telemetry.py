"""The tick's record for the recorder, filled from the autopilot's vectors without allocation."""

import math

from glider.firmware.core.jit import kernel
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.hal.ports import BEACON, FRAME_SIZE

# Places in the record; firmware/telemetry.py gives them their names.
REC_T, REC_CMD, REC_SLIDER, REC_BALLAST, REC_ATTITUDE, REC_RATES, REC_DEPTH = 0, 1, 4, 5, 6, 9, 12
REC_DEPTH_EST, REC_DEPTH_RATE, REC_REFERENCES, REC_INTEGRATORS = 13, 14, 15, 21
REC_MODE, REC_LEG, REC_REASON, REC_LATENESS, REC_DURATION = 23, 24, 25, 26, 27
REC_DENSITY, REC_PRESSURE, REC_TEMPERATURE, REC_SAMPLE_TIMES = 28, 29, 30, 31
REC_ESTIMATE, REC_SPREADS = 35, 48
REC_LYAPUNOV = 52
REC_REACTION, REC_FAULT_ROW = 56, 57
# The inputs of a replay, beside t, lateness and the commands that the actuators took. The runtime itself copies
# REC_ASKED, the commands before the actuators take them, and REC_FRAME, the frame before it is screened.
REC_ASKED, REC_FRAME = 58, 61
REC_RECORDER, REC_GROWTH, REC_STOP = REC_FRAME + FRAME_SIZE, REC_FRAME + FRAME_SIZE + 1, REC_FRAME + FRAME_SIZE + 2
N_RECORD = REC_FRAME + FRAME_SIZE + 3


@kernel
def fresh(value, time, seen):
    """The value if its sample is newer than the one recorded last (NaN: none yet), else NaN: once is enough."""
    return value if time >= 0.0 and not time <= seen else math.nan


@kernel
def fill_record(frame, est, ap, G, cmd, t, lateness, duration, out):
    """Write one tick into out (N_RECORD,), but for REC_ASKED and REC_FRAME; the sample times that out holds from the
    tick before tell what is new."""
    out[REC_T] = t
    out[REC_CMD], out[REC_CMD + 1], out[REC_CMD + 2] = cmd[0], cmd[1], cmd[2]
    imu, beacon = est[ctl.EST_IMU_TIME], est[ctl.EST_BEACON_TIME]
    slider, plunger = est[ctl.EST_SLIDER_TIME], est[ctl.EST_PLUNGER_TIME]
    out[REC_SLIDER] = fresh(est[ctl.NEW_SLIDER], slider, out[REC_SAMPLE_TIMES + 2])
    out[REC_BALLAST] = fresh(est[ctl.NEW_BALLAST], plunger, out[REC_SAMPLE_TIMES + 3])
    seen = out[REC_SAMPLE_TIMES]
    out[REC_ATTITUDE] = fresh(est[ctl.NEW_ROLL], imu, seen)
    out[REC_ATTITUDE + 1] = fresh(est[ctl.NEW_PITCH], imu, seen)
    out[REC_ATTITUDE + 2] = fresh(est[ctl.NEW_YAW], imu, seen)
    out[REC_RATES] = fresh(est[ctl.NEW_P], imu, seen)
    out[REC_RATES + 1] = fresh(est[ctl.NEW_Q], imu, seen)
    out[REC_RATES + 2] = fresh(est[ctl.NEW_R], imu, seen)
    seen = out[REC_SAMPLE_TIMES + 1]
    out[REC_DEPTH] = fresh(est[ctl.NEW_DEPTH], beacon, seen)
    out[REC_PRESSURE] = fresh(frame[BEACON + 2], beacon, seen)
    out[REC_TEMPERATURE] = fresh(frame[BEACON + 3], beacon, seen)
    out[REC_DEPTH_EST], out[REC_DEPTH_RATE] = est[ctl.EST_DEPTH], est[ctl.EST_DEPTH_RATE]
    out[REC_REFERENCES], out[REC_REFERENCES + 1] = ap[ctl.REF_DEPTH], ap[ctl.REF_DEPTH_RATE]
    out[REC_REFERENCES + 2], out[REC_REFERENCES + 3] = ap[ctl.REF_PITCH], ap[ctl.REF_PITCH_RATE]
    out[REC_REFERENCES + 4], out[REC_REFERENCES + 5] = ap[ctl.REF_ROLL], ap[ctl.REF_ROLL_RATE]
    out[REC_INTEGRATORS], out[REC_INTEGRATORS + 1] = ap[ctl.INT_PITCH], ap[ctl.INT_DEPTH]
    out[REC_MODE], out[REC_LEG], out[REC_REASON] = ap[ctl.MODE], ap[ctl.LEG], ap[ctl.REASON]
    out[REC_LATENESS], out[REC_DURATION] = lateness, duration
    out[REC_DENSITY] = est[ctl.EST_DENSITY]
    out[REC_SAMPLE_TIMES], out[REC_SAMPLE_TIMES + 1] = imu, beacon
    out[REC_SAMPLE_TIMES + 2], out[REC_SAMPLE_TIMES + 3] = slider, plunger
    for i in range(3):
        out[REC_ESTIMATE + i] = est[ctl.EST_ROLL + i]
        out[REC_ESTIMATE + 3 + i] = est[ctl.EST_U + i]
    out[REC_ESTIMATE + 6], out[REC_ESTIMATE + 7], out[REC_ESTIMATE + 8] = (
        est[ctl.EST_SERVO],
        est[ctl.EST_SLIDER],
        est[ctl.EST_BALLAST],
    )
    for i in range(4):
        out[REC_ESTIMATE + 9 + i] = est[ctl.EST_X + i]
        out[REC_SPREADS + i] = est[ctl.SD_DEPTH_RATE + i]
        out[REC_LYAPUNOV + i] = ap[ctl.K2_NEED_PITCH + i]
    out[REC_REACTION], out[REC_FAULT_ROW] = ap[ctl.AP_REACTION], ap[ctl.AP_FAULT_ROW]
    out[REC_RECORDER], out[REC_GROWTH], out[REC_STOP] = G[sup.RECORDER], G[sup.GROWTH], ap[ctl.STOP_TAKEN]
