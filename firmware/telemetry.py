"""Names, units and meaning of what a flight records each tick. The places are those of core/telemetry."""

from glider.firmware.core.control.telemetry import N_RECORD, REC_ASKED, REC_FRAME
from glider.hal.ports import SLOTS
from glider.hal.recorder.schema import Field, RecordSpec

_FIELDS = (
    ("t_s", "s", "time since the start of the flight, onboard clock"),
    ("cmd_servo_rad", "rad", "servo command sent"),
    ("cmd_slider_m", "m", "slider command sent"),
    ("cmd_ballast_kg", "kg", "ballast command sent"),
    ("slider_m", "m", "slider draw-wire, new samples only"),
    ("ballast_kg", "kg", "net ballast mass from the plunger's draw-wire and the water's density"),
    ("roll_rad", "rad", "IMU roll"),
    ("pitch_rad", "rad", "IMU pitch"),
    ("yaw_rad", "rad", "IMU yaw"),
    ("p_rad_s", "rad/s", "gyro about x"),
    ("q_rad_s", "rad/s", "gyro about y"),
    ("r_rad_s", "rad/s", "gyro about z"),
    ("depth_m", "m", "depth from pressure"),
    ("est_depth_m", "m", "filtered depth"),
    ("est_depth_rate_m_s", "m/s", "filtered depth rate"),
    ("ref_depth_m", "m", "reference depth"),
    ("ref_depth_rate_m_s", "m/s", "reference depth rate"),
    ("ref_pitch_rad", "rad", "reference pitch"),
    ("ref_pitch_rate_rad_s", "rad/s", "reference pitch rate"),
    ("ref_roll_rad", "rad", "reference roll"),
    ("ref_roll_rate_rad_s", "rad/s", "reference roll rate"),
    ("int_pitch_m", "m", "integrator of the pitch loop"),
    ("int_depth_kg", "kg", "integrator of the depth loop"),
    ("mode", "1", "0 waiting, 1 flying, 2 completed, 3 aborted"),
    ("leg", "1", "leg being flown, from 0"),
    ("reason", "1", "why the dive was given up; core/layouts/control_layout; past 100 the row of the fault table"),
    ("lateness_s", "s", "start of the tick after its deadline"),
    ("duration_s", "s", "time the tick before this one took"),
    ("density_kg_m3", "kg/m3", "water density from pressure and temperature"),
    ("pressure_pa", "Pa", "absolute pressure at the beacon"),
    ("temperature_c", "deg C", "water temperature at the beacon"),
    ("imu_time_s", "s", "time of the newest IMU sample"),
    ("beacon_time_s", "s", "time of the newest beacon sample"),
    ("slider_time_s", "s", "time of the newest slider draw-wire sample"),
    ("plunger_time_s", "s", "time of the newest plunger draw-wire sample"),
    ("est_roll_rad", "rad", "estimated roll"),
    ("est_pitch_rad", "rad", "estimated pitch"),
    ("est_yaw_rad", "rad", "estimated yaw"),
    ("est_u_m_s", "m/s", "estimated surge through the water"),
    ("est_v_m_s", "m/s", "estimated sway through the water"),
    ("est_w_m_s", "m/s", "estimated heave through the water"),
    ("est_servo_rad", "rad", "estimated servo angle"),
    ("est_slider_m", "m", "estimated slider position"),
    ("est_ballast_kg", "kg", "estimated net ballast mass"),
    ("est_x_m", "m", "north of the start, by dead reckoning"),
    ("est_y_m", "m", "east of the start, by dead reckoning"),
    ("est_water_n_m_s", "m/s", "estimated current, north"),
    ("est_water_e_m_s", "m/s", "estimated current, east"),
    ("sd_depth_rate_m_s", "m/s", "1 sigma of the estimated depth rate"),
    ("sd_pitch_rad", "rad", "1 sigma of the estimated pitch"),
    ("sd_u_m_s", "m/s", "1 sigma of the estimated surge"),
    ("roughness", "1", "disturbance seen over the one in the vehicle file, 1 or more"),
    (
        "k2_need_pitch_m",
        "m",
        "k2 of pitch that covers one sigma of [uncertainty] and the disturbance seen; NaN: no law",
    ),
    ("k2_need_depth_kg", "kg", "k2 of depth, likewise"),
    (
        "margin_pitch_rad_s2",
        "rad/s2",
        "by how much V of pitch is sure to fall, over |s|; not positive: nothing is sure",
    ),
    ("margin_depth_m_s2", "m/s2", "V of depth, likewise"),
    ("reaction", "1", "supervisor: 0 nothing, 1 log, 2 warn, 3 hold, 4 abort, 5 out-of-band, 6 hardware"),
    ("fault", "1", "row of the fault table that asked for it; docs/explanation/supervisor.md"),
)

# What a replay of the flight needs beside t_s, lateness_s and cmd_*: docs/reference/log.md, Replay.
ASKED = ("asked_servo_rad", "asked_slider_m", "asked_ballast_kg")
RAW = tuple(
    (f"raw_{port}_{name}", unit, text)
    for port, slot in SLOTS.items()
    for name, unit, text in (
        ("time", "s", "time of the sample, before screening"),
        ("validity", "1", "0 missing, 1 valid, 2 stale, 3 fault; before screening"),
        *((name, unit, "before screening") for name, unit in zip(slot.names, slot.units, strict=True)),
    )
)
_REPLAYED = (
    *((name, name.rpartition("_")[2], "command before the actuator's own limits") for name in ASKED),
    *RAW,
    ("recorder", "1", "the recording: 0 well, 1 dropping, 2 failed"),
    ("growth", "1", "memory or handles: 0 none, 1 have grown, 2 past their limit"),
    ("stop", "1", "1: the operator has asked for the dive to be given up"),
)
REPLAYED = tuple(name for name, _, _ in _REPLAYED)

TICK = RecordSpec(
    "/tick",
    "glider/msg/Tick",
    tuple(Field(name, unit=unit, description=text) for name, unit, text in (*_FIELDS, *_REPLAYED)),
)

assert TICK.width == N_RECORD
assert TICK.index(ASKED[0]) == REC_ASKED
assert TICK.index(RAW[0][0]) == REC_FRAME
