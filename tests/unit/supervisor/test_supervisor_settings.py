"""[limits] and [supervisor] of a vehicle file: read strictly, defaults where nothing is said."""

import math

import numpy as np
import pytest

from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.model.library import shipped
from glider.firmware.model.supervisor_settings import Limits, SupervisorTable, settings_vector
from glider.firmware.model.vehicle import decode_vehicle
from glider.hal.ports import SLOTS
from glider.hal.strict import ConfigError

SHIPPED = shipped("model/vehicles")["roughie"]
TEXT = SHIPPED.split("[limits]")[0]
PERIODS = {"imu": 0.02, "beacon": 0.04, "wires": 0.1}


def vector(limits=None, dt=0.02, site=6.0, inputs=None, **table):
    periods = {**PERIODS, **(inputs or {})}
    return settings_vector(
        limits or Limits(), SupervisorTable(**table), dt=dt, periods=periods, site_depth=site, mission_time=600.0
    )


def test_a_vehicle_file_may_say_nothing_of_them():
    vehicle = decode_vehicle(TEXT, "roughie")
    assert vehicle.limits is None
    assert decode_vehicle(SHIPPED, "roughie").limits == Limits(working_depth_m=60.0)
    assert vehicle.supervisor == SupervisorTable()


def test_a_vehicle_file_may_say_all_of_it():
    more = "\n[limits]\nworking_depth_m = 50\nlow_voltage = 12.0\nleast_voltage = 11.0\n[supervisor]\nhold_s = 0.5\n"
    vehicle = decode_vehicle(TEXT + more, "v.toml")
    assert vehicle.limits == Limits(working_depth_m=50.0, low_voltage=12.0, least_voltage=11.0)
    assert vehicle.supervisor.hold_s == 0.5
    assert vehicle.supervisor.imu_s == SupervisorTable().imu_s


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("[limits]\nworking_depth = 5", "limits.working_depth: unknown key"),
        ("[limits]\nworking_depth_m = -1.0", "limits.working_depth_m: expected `float` > 0.0"),
        ("[limits]\nat_risk_depth_m = 9.0", "at_risk_depth_m: expected a working_depth_m"),
        ("[limits]\nworking_depth_m = 9.0\nat_risk_depth_m = 9.0", "and more"),
        ("[limits]\nleast_voltage = 9.0", "least_voltage: expected a low_voltage"),
        ("[limits]\nlow_voltage = 9.0\nleast_voltage = 9.0", "and less"),
        ("[supervisor]\nimu_s = 0.0", "supervisor.imu_s: expected `float` > 0.0"),
        ("[supervisor]\nimu_s = nan", "supervisor.imu_s: "),
        ("[supervisor]\nleak_samples = 1.5", "supervisor.leak_samples: expected `int`"),
    ],
)
def test_what_makes_no_sense_is_refused_by_name(more, said):
    with pytest.raises(ConfigError, match=said.replace("(", "\\(")) as error:
        decode_vehicle(f"{TEXT}\n{more}\n", "v.toml")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("limits", "site", "working", "risk"),
    [
        (Limits(), 6.0, 6.0, 6.6),
        (Limits(), 0.0, math.inf, math.inf),
        (Limits(working_depth_m=50.0), 0.0, 50.0, 55.0),
        (Limits(working_depth_m=50.0), 6.0, 6.0, 6.6),
        (Limits(working_depth_m=5.0), 6.0, 5.0, 5.5),
        (Limits(working_depth_m=5.0, at_risk_depth_m=5.2), 6.0, 5.0, 5.2),
        (Limits(working_depth_m=5.0, at_risk_depth_m=9.0), 6.0, 5.0, 6.6),
    ],
)
def test_the_shallower_of_hull_and_site_counts(limits, site, working, risk):
    G = vector(limits, site=site)
    assert G[sup.WORKING_DEPTH] == pytest.approx(working)
    assert G[sup.RISK_DEPTH] == pytest.approx(risk)


@pytest.mark.parametrize(("dt", "ticks", "delay"), [(0.02, 12, 30), (0.01, 24, 60), (0.1, 2, 6), (0.001, 63, 63)])
def test_times_become_ticks_within_the_ring(dt, ticks, delay):
    G = vector(dt=dt)
    assert (G[sup.WRONG_TICKS], G[sup.DELAY_TICKS]) == (ticks, delay)
    assert G[sup.TICK] == dt


def test_the_layout_follows_the_frame():
    names = ("imu", "beacon", "slider_wire", "plunger_wire", "leak", "battery")
    assert tuple(SLOTS[name].start for name in names) == sup.STARTS
    assert tuple(len(SLOTS[name].names) for name in names) == sup.WIDTHS
    assert tuple(sum(sup.WIDTHS[:i]) for i in range(6)) == sup.PLACES
    assert sum(sup.WIDTHS) == sup.N_VALUES
    assert tuple(SLOTS[name].start for name in ("servo", "slider", "ballast")) == sup.STATES
    assert all(len(SLOTS[name].names) == 1 for name in ("servo", "slider", "ballast"))


def test_places_in_the_vector_do_not_overlap():
    G = vector()
    assert list(G[sup.PERIOD : sup.PERIOD + sup.N_SENSORS]) == [0.02, 0.04, 0.1, 0.1, math.inf, math.inf]
    slow = vector(inputs={"leak": 1.0, "battery": 0.5})
    assert list(slow[sup.PERIOD + sup.SENSOR_LEAK : sup.PERIOD + sup.N_SENSORS]) == [1.0, 0.5]
    assert (G[sup.ENABLED : sup.ENABLED + sup.N_ROWS] == 1.0).all()
    assert (G[sup.HIGH : sup.HIGH + sup.N_VALUES] > G[sup.LOW : sup.LOW + sup.N_VALUES]).all()
    singles = [value for name, value in vars(sup).items() if name.isupper() and isinstance(value, int)]
    assert max(singles) == sup.N_G == len(G)


def test_leak_and_battery_are_judged_by_the_periods_of_their_devices():
    slower = settings_vector(
        Limits(), SupervisorTable(), dt=0.02, periods={**PERIODS, "leak": 1.0, "battery": 0.5}, site_depth=6.0,
        mission_time=5.0,
    )  # fmt: skip
    assert list(slower[sup.PERIOD + sup.SENSOR_LEAK : sup.PERIOD + sup.N_SENSORS]) == [1.0, 0.5]


def test_what_the_mission_and_the_flight_before_say_is_there():
    G = vector()
    assert G[sup.MISSION_TIME] == 600.0
    assert G[sup.RESTARTED] == 0.0
    more = settings_vector(
        Limits(low_voltage=12.0, least_voltage=11.0), SupervisorTable(), dt=0.02, periods=PERIODS, site_depth=6.0,
        mission_time=5.0, restarted=True,
    )  # fmt: skip
    assert (more[sup.RESTARTED], more[sup.MISSION_TIME]) == (1.0, 5.0)
    assert (more[sup.LOW_VOLTAGE], more[sup.LEAST_VOLTAGE]) == (12.0, 11.0)
    assert (G[sup.LOW_VOLTAGE], G[sup.LEAST_VOLTAGE]) == (0.0, 0.0)


SCALARS = {
    "hold_s": sup.HOLD_TIME, "frozen_s": sup.FROZEN_TIME, "stuck_s": sup.STUCK_TIME, "actuator_s": sup.STATE_AGE,
    "unfit_run": sup.UNFIT_RUN, "disagree_s": sup.DISAGREE_TIME, "disagree_rate_m_s": sup.DISAGREE_RATE,
    "deep_s": sup.DEEP_TIME, "at_risk_s": sup.RISK_TIME,
    "no_ascent_s": sup.ASCENT_TIME, "ascent_step_m": sup.ASCENT_STEP,
    "blind_ascent_s": sup.BLIND_TIME, "same_depth_s": sup.SAME_TIME, "same_depth_m": sup.SAME_BAND,
    "leak_samples": sup.LEAK_COUNT, "steep_s": sup.STEEP_TIME, "law_tries": sup.LAW_RUN,
    "filter_restarts": sup.RESTART_COUNT,
    "voltage_s": sup.VOLTAGE_TIME, "overruns": sup.OVERRUN_RUN, "overrun_share": sup.OVERRUN_SHARE,
    "stall_factor": sup.STALL_FACTOR, "stall_tries": sup.STALL_COUNT, "stall_rest_s": sup.STALL_REST,
    "surface_m": sup.SURFACE_DEPTH, "imu_s": sup.LOST_AFTER, "pressure_s": sup.LOST_AFTER + 1,
    "wire_s": sup.LOST_AFTER + 2, "law_rest_s": sup.CLEAR_AFTER + sup.FAULT_NO_ANSWER * sup.N_LEVELS + sup.LEVEL_1,
}  # fmt: skip
ANGLES = {"disagree_pitch_deg": sup.DISAGREE_PITCH, "steep_deg": sup.STEEP_PITCH, "steep_margin_deg": sup.STEEP_MARGIN,
          "roll_deg": sup.STEEP_ROLL}  # fmt: skip


@pytest.mark.parametrize("name", [*SCALARS, *ANGLES])
def test_every_setting_has_its_place(name):
    default = getattr(SupervisorTable(), name)
    value = 1 if isinstance(default, int) else 0.5 * default
    if name == "stall_factor":
        value = 1.25
    changed, before = vector(**{name: value}), vector()
    place = {**SCALARS, **ANGLES}[name]
    places = [place, place + 1] if name == "wire_s" else [place]
    assert [int(i) for i in np.flatnonzero((changed != before) & ~np.isnan(changed))] == places
    assert changed[place] == pytest.approx(math.radians(value) if name in ANGLES else value)


def test_ranges_and_jumps_stand_at_their_values():
    G = vector()
    low, high = (list(G[place : place + sup.N_VALUES]) for place in (sup.LOW, sup.HIGH))
    assert low[:6] == pytest.approx([-math.pi - 0.2, -math.pi / 2 - 0.2, -math.pi - 0.2, -10, -10, -10])
    assert high[:6] == pytest.approx([math.pi + 0.2, math.pi / 2 + 0.2, math.pi + 0.2, 10, 10, 10])
    assert low[6:] == [50_000.0, -10.0, -0.5, -0.5, 0.0, 0.0]
    assert high[6:] == [1.2e8, 60.0, 0.5, 0.5, 1.0, 100.0]
    assert list(G[sup.JUMP : sup.JUMP + 12]) == [0.3, 0.3, 0.3, 2, 2, 2, 15_000.0, 5, 0.01, 0.01, 1, 10]
    assert list(G[sup.JUMP_RATE : sup.JUMP_RATE + 12]) == [3, 3, 3, 20, 20, 20, 30_000.0, 1, 0.05, 0.05, 1, 10]
