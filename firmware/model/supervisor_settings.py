"""[limits] and [supervisor] of a vehicle file: how deep, how steep, how few volts, and for how long.

What is left out keeps its default; times are those of the fault table, less what it takes to see them.
"""

import math
from typing import Annotated

import msgspec
import numpy as np

from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.faults import FAULT_TABLE
from glider.hal.ports import STALL_REST_S, STALL_TRIES
from glider.hal.strict import Table

Seconds = Annotated[float, msgspec.Meta(gt=0.0, le=3600.0)]
Short = Annotated[float, msgspec.Meta(gt=0.0, le=10.0)]
Metres = Annotated[float, msgspec.Meta(gt=0.0, le=11000.0)]
Volts = Annotated[float, msgspec.Meta(gt=0.0, le=100.0)]
Angle = Annotated[float, msgspec.Meta(gt=0.0, le=90.0)]
Count = Annotated[int, msgspec.Meta(ge=1, le=1000)]
PI = math.pi


class Limits(Table):
    """[limits]: what this hull and battery bear. Unset depths: the mission's site counts, and hardware does not arm."""

    working_depth_m: Metres | None = None
    at_risk_depth_m: Metres | None = None  # unset: a tenth deeper than the working depth
    low_voltage: Volts | None = None  # below: WARN
    least_voltage: Volts | None = None  # below: ABORT

    def __post_init__(self):
        if self.at_risk_depth_m is not None and not (self.working_depth_m or math.inf) < self.at_risk_depth_m:
            raise ValueError("at_risk_depth_m: expected a working_depth_m, and more than that")
        if self.least_voltage is not None and not self.least_voltage < (self.low_voltage or 0.0):
            raise ValueError("least_voltage: expected a low_voltage, and less than that")


class SupervisorTable(Table):
    """[supervisor]: times and counts of the detectors."""

    imu_s: Short = 0.16
    pressure_s: Short = 0.45
    wire_s: Short = 0.45
    actuator_s: Short = 0.45
    hold_s: Short = 1.0
    frozen_s: Short = 0.12
    stuck_s: Short = 1.8
    unfit_run: Count = 5
    disagree_s: Short = 4.2
    disagree_pitch_deg: Angle = 8.0
    disagree_rate_m_s: Annotated[float, msgspec.Meta(gt=0.0, le=2.0)] = 0.05
    deep_s: Short = 0.5
    at_risk_s: Short = 0.1
    no_ascent_s: Seconds = 30.0
    ascent_step_m: Annotated[float, msgspec.Meta(gt=0.0, le=10.0)] = 0.3
    blind_ascent_s: Seconds = 300.0
    same_depth_s: Seconds = 120.0
    same_depth_m: Annotated[float, msgspec.Meta(gt=0.0, le=10.0)] = 0.5
    leak_samples: Count = 3
    steep_deg: Angle = 60.0
    steep_margin_deg: Angle = 20.0
    roll_deg: Annotated[float, msgspec.Meta(gt=0.0, le=180.0)] = 75.0
    steep_s: Short = 1.8
    law_tries: Count = 3
    law_rest_s: Seconds = 5.0
    filter_restarts: Count = 3
    voltage_s: Seconds = 9.0
    overruns: Count = 10
    overrun_share: Annotated[float, msgspec.Meta(gt=0.0, le=1.0)] = 0.01
    stall_factor: Annotated[float, msgspec.Meta(ge=1.0, le=10.0)] = 1.5
    stall_tries: Count = STALL_TRIES
    stall_rest_s: Short = STALL_REST_S
    wrong_way_s: Annotated[float, msgspec.Meta(ge=0.1, le=0.3)] = 0.24
    longest_delay_s: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.6  # of commands; younger ones prove nothing
    surface_m: Annotated[float, msgspec.Meta(gt=0.0, le=2.0)] = 0.4
    surfaced_s: Short = 3.0
    memory_mb: Annotated[float, msgspec.Meta(gt=0.0, le=100_000.0)] = 100.0  # grown since arming: ABORT; half: WARN
    handles: Count = 200  # likewise


# One physical range (low, high), jump and jump rate for each value of the frame's sensors, in their order.
_OVER = 0.2  # rad that bias and noise carry an angle past where it goes round
_IMU = [(-PI - _OVER, PI + _OVER), (-PI / 2 - _OVER, PI / 2 + _OVER), (-PI - _OVER, PI + _OVER), *3 * [(-10.0, 10.0)]]
_JUMPS = [0.3, 0.3, 0.3, 2.0, 2.0, 2.0, 15_000.0, 5.0, 0.01, 0.01, 1.0, 10.0]
_JUMP_RATES = [3.0, 3.0, 3.0, 20.0, 20.0, 20.0, 30_000.0, 1.0, 0.05, 0.05, 1.0, 10.0]
_DEEPEST_PA = 1.2e8
_OTHERS = [(50_000.0, _DEEPEST_PA), (-10.0, 60.0), (-0.5, 0.5), (-0.5, 0.5), (0.0, 1.0), (0.0, 100.0)]


def settings_vector(
    limits: Limits, table: SupervisorTable, *, dt: float, periods: dict[str, float], site_depth: float,
    mission_time: float, restarted: bool = False,
) -> np.ndarray:  # fmt: skip
    """The supervisor's vector G, shape (N_G,), at the start of a flight.

    dt: the loop's step, s; periods: of imu, beacon, wires and, where fitted, leak and battery, s; site_depth (m; 0:
    unknown) and mission_time (s) are the mission's; restarted: the flight before this one did not end in order.
    """
    G = np.zeros(sup.N_G)
    G[sup.ENABLED : sup.ENABLED + sup.N_ROWS] = 1.0
    G[sup.TICK] = dt
    G[sup.PERIOD : sup.PERIOD + sup.N_SENSORS] = [
        periods["imu"],
        periods["beacon"],
        *2 * [periods["wires"]],
        *(periods.get(name, math.inf) for name in ("leak", "battery")),  # not fitted: no sample is ever old
    ]
    lost = [table.imu_s, table.pressure_s, table.wire_s, table.wire_s, math.inf, math.inf]
    G[sup.LOST_AFTER : sup.LOST_AFTER + sup.N_SENSORS] = lost
    ranges = np.array(_IMU + _OTHERS)
    G[sup.LOW : sup.LOW + sup.N_VALUES], G[sup.HIGH : sup.HIGH + sup.N_VALUES] = ranges.T
    G[sup.JUMP : sup.JUMP + sup.N_VALUES], G[sup.JUMP_RATE : sup.JUMP_RATE + sup.N_VALUES] = _JUMPS, _JUMP_RATES
    for place, (reaction, clear_after) in _levels(table).items():
        G[sup.REACTION + place], G[sup.CLEAR_AFTER + place] = reaction, clear_after
    for place, value in _scalars(limits, table, dt, site_depth, mission_time).items():
        G[place] = value
    G[sup.RESTARTED] = float(restarted)
    G[sup.BEGAN : sup.N_G] = 0.0
    for place, count in _UNSET:
        G[place : place + count] = math.nan
    G[sup.TAKEN : sup.TAKEN + sup.N_SENSORS] = -math.inf
    G[sup.FIRST : sup.FIRST + sup.N_ROWS] = -1.0
    return G


_UNSET = (
    (sup.BEGAN, 1), (sup.SEEN, sup.N_SENSORS), (sup.SAME_SINCE, sup.N_SENSORS), (sup.LAST, sup.N_VALUES),
    (sup.RAW, sup.N_VALUES), (sup.SINCE, sup.N_TIMERS), (sup.SLOW_TIME, 1), (sup.BAND_MARK, 1), (sup.MINUTE, 1),
    (sup.LEAK_SEEN, 1), (sup.OOB_SINCE, 1), (sup.MARK, 2), (sup.RING, 4 * sup.N_RING), (sup.PUMP_SINCE, 1),
)  # fmt: skip


def _levels(table: SupervisorTable) -> dict[int, tuple[float, float]]:
    """Reaction and clear time (s) of each level of the fault table, by its place."""
    return {
        row * sup.N_LEVELS + number: (
            float(level.reaction),
            float(getattr(table, level.clear_after) if isinstance(level.clear_after, str) else level.clear_after),
        )
        for row, fault in FAULT_TABLE.items()
        for number, level in enumerate(fault.levels)
    }


def _scalars(
    limits: Limits, table: SupervisorTable, dt: float, site_depth: float, mission_time: float
) -> dict[int, float]:
    """The settings that stand alone, by their place."""
    working = min(limits.working_depth_m or math.inf, site_depth or math.inf)
    risk = limits.at_risk_depth_m or 1.1 * (limits.working_depth_m or math.inf)
    return {
        sup.STATE_AGE: table.actuator_s, sup.HOLD_TIME: table.hold_s, sup.FROZEN_TIME: table.frozen_s,
        sup.STUCK_TIME: table.stuck_s, sup.UNFIT_RUN: table.unfit_run,
        sup.DISAGREE_TIME: table.disagree_s, sup.DISAGREE_PITCH: math.radians(table.disagree_pitch_deg),
        sup.DISAGREE_RATE: table.disagree_rate_m_s,
        sup.WORKING_DEPTH: working, sup.DEEP_TIME: table.deep_s,
        sup.RISK_DEPTH: min(risk, 1.1 * site_depth or math.inf), sup.RISK_TIME: table.at_risk_s,
        sup.ASCENT_TIME: table.no_ascent_s, sup.ASCENT_STEP: table.ascent_step_m, sup.BLIND_TIME: table.blind_ascent_s,
        sup.SAME_TIME: table.same_depth_s, sup.SAME_BAND: table.same_depth_m, sup.LEAK_COUNT: table.leak_samples,
        sup.STEEP_PITCH: math.radians(table.steep_deg), sup.STEEP_MARGIN: math.radians(table.steep_margin_deg),
        sup.STEEP_ROLL: math.radians(table.roll_deg), sup.STEEP_TIME: table.steep_s,
        sup.LAW_RUN: table.law_tries, sup.RESTART_COUNT: table.filter_restarts,
        sup.LOW_VOLTAGE: limits.low_voltage or 0.0, sup.LEAST_VOLTAGE: limits.least_voltage or 0.0,
        sup.VOLTAGE_TIME: table.voltage_s, sup.OVERRUN_RUN: table.overruns, sup.OVERRUN_SHARE: table.overrun_share,
        sup.MISSION_TIME: mission_time, sup.STALL_FACTOR: table.stall_factor, sup.STALL_COUNT: table.stall_tries,
        sup.STALL_REST: table.stall_rest_s, sup.SURFACE_DEPTH: table.surface_m, sup.SURFACED_TIME: table.surfaced_s,
        sup.WRONG_TICKS: min(max(round(table.wrong_way_s / dt), 2), sup.N_RING - 1),
        sup.DELAY_TICKS: min(max(round(table.longest_delay_s / dt), 2), sup.N_RING - 1),
    }  # fmt: skip
