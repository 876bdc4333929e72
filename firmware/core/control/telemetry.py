"""The tick's record for the recorder, filled from the autopilot's vectors without allocation."""

import math

from firmware.core.control import control_layout as at
from firmware.core.jit import kernel
from hal.ports import BEACON

# Places in the record; firmware/telemetry.py gives them their names.
T, CMD, SLIDER, BALLAST, ATTITUDE, RATES, DEPTH = 0, 1, 4, 5, 6, 9, 12
DEPTH_EST, DEPTH_RATE, REFERENCES, INTEGRATORS = 13, 14, 15, 21
MODE_, LEG_, REASON_, LATENESS, DURATION = 23, 24, 25, 26, 27
DENSITY, PRESSURE, TEMPERATURE, SAMPLE_TIMES = 28, 29, 30, 31
ESTIMATE, SPREADS = 35, 48
COVERAGE = 52
REACTION, FAULT_ROW = 56, 57
N_RECORD = 58


@kernel
def fresh(value, time, seen):
    """The value if its sample is newer than the one recorded last (NaN: none yet), else NaN: once is enough."""
    return value if time >= 0.0 and not time <= seen else math.nan


@kernel
def fill_record(frame, est, ap, cmd, t, lateness, duration, out):
    """Write one tick into out (N_RECORD,); the sample times that out holds from the tick before tell what is new."""
    out[T] = t
    out[CMD], out[CMD + 1], out[CMD + 2] = cmd[0], cmd[1], cmd[2]
    imu, beacon = est[at.EST_IMU_TIME], est[at.EST_BEACON_TIME]
    slider, plunger = est[at.EST_SLIDER_TIME], est[at.EST_PLUNGER_TIME]
    out[SLIDER] = fresh(est[at.NEW_SLIDER], slider, out[SAMPLE_TIMES + 2])
    out[BALLAST] = fresh(est[at.NEW_BALLAST], plunger, out[SAMPLE_TIMES + 3])
    seen = out[SAMPLE_TIMES]
    out[ATTITUDE] = fresh(est[at.NEW_ROLL], imu, seen)
    out[ATTITUDE + 1] = fresh(est[at.NEW_PITCH], imu, seen)
    out[ATTITUDE + 2] = fresh(est[at.NEW_YAW], imu, seen)
    out[RATES] = fresh(est[at.NEW_P], imu, seen)
    out[RATES + 1] = fresh(est[at.NEW_Q], imu, seen)
    out[RATES + 2] = fresh(est[at.NEW_R], imu, seen)
    seen = out[SAMPLE_TIMES + 1]
    out[DEPTH] = fresh(est[at.NEW_DEPTH], beacon, seen)
    out[PRESSURE] = fresh(frame[BEACON + 2], beacon, seen)
    out[TEMPERATURE] = fresh(frame[BEACON + 3], beacon, seen)
    out[DEPTH_EST], out[DEPTH_RATE] = est[at.EST_DEPTH], est[at.EST_DEPTH_RATE]
    out[REFERENCES], out[REFERENCES + 1] = ap[at.REF_DEPTH], ap[at.REF_DEPTH_RATE]
    out[REFERENCES + 2], out[REFERENCES + 3] = ap[at.REF_PITCH], ap[at.REF_PITCH_RATE]
    out[REFERENCES + 4], out[REFERENCES + 5] = ap[at.REF_ROLL], ap[at.REF_ROLL_RATE]
    out[INTEGRATORS], out[INTEGRATORS + 1] = ap[at.INT_PITCH], ap[at.INT_DEPTH]
    out[MODE_], out[LEG_], out[REASON_] = ap[at.MODE], ap[at.LEG], ap[at.REASON]
    out[LATENESS], out[DURATION] = lateness, duration
    out[DENSITY] = est[at.EST_DENSITY]
    out[SAMPLE_TIMES], out[SAMPLE_TIMES + 1] = imu, beacon
    out[SAMPLE_TIMES + 2], out[SAMPLE_TIMES + 3] = slider, plunger
    for i in range(3):
        out[ESTIMATE + i] = est[at.EST_ROLL + i]
        out[ESTIMATE + 3 + i] = est[at.EST_U + i]
    out[ESTIMATE + 6], out[ESTIMATE + 7], out[ESTIMATE + 8] = est[at.EST_SERVO], est[at.EST_SLIDER], est[at.EST_BALLAST]
    for i in range(4):
        out[ESTIMATE + 9 + i] = est[at.EST_X + i]
        out[SPREADS + i] = est[at.SD_DEPTH_RATE + i]
        out[COVERAGE + i] = ap[at.K2_NEED_PITCH + i]
    out[REACTION], out[FAULT_ROW] = ap[at.REACTION], ap[at.FAULT_ROW]
