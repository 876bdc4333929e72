"""Faults that are flown: devices, plant, clock and controller break under the real runtime on the simulated board."""

import math
import os
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.core.maths.rotations import euler_from_quaternion
from glider.firmware.core.vehicle.layout import CG_X, CG_Y, X_ACT, X_NU, X_QUAT
from glider.firmware.faults import Reaction
from glider.firmware.model.supervisor_settings import Limits
from glider.tools.verify.faults.cases import ALL, IN_WATER, MOVING, UNDER_WAY, FaultCase
from glider.tools.verify.faults.scene import Scene, Setting

NOTHING, LOG, WARN, HOLD, ABORT, OOB, HW = Reaction
SAMPLE_S = 0.04  # between two samples of the slowest of IMU, beacon and draw-wires
SENSORS = ("imu", "beacon", "slider_wire", "plunger_wire")
RANGES = (2.0944, 0.12, 0.4)  # rad, m, kg: of servo, slider, ballast
JUMPS = {"imu": (0.0, 0.8, 0.0, 0.0, 0.0, 0.0), "beacon": (60_000.0, 0.0), "slider_wire": (0.05,),
         "plunger_wire": (0.03,)}  # fmt: skip
BATTERY = Limits(low_voltage=12.0, least_voltage=11.0)


def device(name: str, kind: str, **more: Any):
    """Break one device."""

    def begin(scene: Scene) -> None:
        getattr(scene.board, name).begin(kind, **more)

    return begin


def broken(
    row: int, names: tuple[str, ...], kinds: tuple[str, ...], reaction: Reaction, allowed_s: float,
    phases: tuple[str, ...] = ALL,
) -> list[FaultCase]:  # fmt: skip
    """A case for each of the devices and each way in which it breaks."""
    return [
        FaultCase(row, f"{name} {kind}", device(name, kind), reaction, allowed_s, phases)
        for name in names
        for kind in kinds
    ]


def devices() -> list[FaultCase]:
    """Rows 1 to 6, 9 to 11, 14, 16: what a device can do wrong."""
    gone, drives = ("silent", "off"), ("slider", "ballast")
    cases = [
        *broken(sup.FAULT_IMU_LOST, ("imu",), (*gone, "stuck", "garbage"), ABORT, 0.2),
        *broken(sup.FAULT_IMU_LOST, ("imu",), ("slow", "intermittent"), HOLD, 0.2),
        *broken(sup.FAULT_PRESSURE_LOST, ("beacon",), (*gone, "garbage", "slow", "intermittent"), ABORT, 0.5),
        *broken(sup.FAULT_BUS_LOST, drives, gone, ABORT, 0.5),
        *broken(sup.FAULT_WIRE_LOST, ("slider_wire",), (*gone, "garbage"), WARN, 0.5),
        *broken(sup.FAULT_WIRE_LOST, ("plunger_wire",), (*gone, "garbage"), ABORT, 0.5),
        *broken(sup.FAULT_SERVO_LOST, ("servo",), gone, WARN, 0.5),
        *broken(
            sup.FAULT_SAMPLE_TIME, SENSORS, ("delayed", "repeated", "backwards", "slow"), LOG, 4 * SAMPLE_S, IN_WATER
        ),
    ]
    cases += [
        FaultCase(sup.FAULT_EXCEPTION, f"{name} refuses", device(name, "misconfigured"), ABORT, 0.1) for name in drives
    ]
    cases += broken(sup.FAULT_IMPLAUSIBLE, SENSORS, ("garbage",), WARN, SAMPLE_S)
    cases += [
        FaultCase(
            sup.FAULT_IMPLAUSIBLE, f"{name} jumps", device(name, "jump", drift=JUMPS[name]), WARN, SAMPLE_S, IN_WATER
        )
        for name in SENSORS
    ]
    cases += broken(sup.FAULT_STUCK_SENSOR, ("beacon",), ("stuck",), WARN, 2.0 + SAMPLE_S, MOVING)
    cases += [
        FaultCase(sup.FAULT_STUCK_SENSOR, f"{name} stuck", stuck_wire(name, index), WARN, 2.0 + SAMPLE_S, UNDER_WAY)
        for name, index in (("slider_wire", 1), ("plunger_wire", 2))
    ]
    return cases


def counted_when(holds: Callable[[Scene], bool]) -> Callable[[Scene, float], None]:
    """Each tick: a fault's time counts from when a condition first holds."""

    def look(scene: Scene, t: float) -> None:
        if not scene.counted and holds(scene):
            scene.counted, scene.since = True, t

    return look


def on_their_way(scene: Scene, change: Callable[[Any], None]) -> None:
    """Change the commands behind the controller's tick, in place."""
    honest = scene.pilot.tick

    def tick(t: float):
        commands = honest(t)
        change(commands)
        return commands

    scene.pilot.tick = tick  # type: ignore[method-assign]


def stuck_wire(name: str, index: int):
    """A wire that repeats itself; time counts from when its actuator has been sent a twentieth of its way off."""

    def begin(scene: Scene) -> None:
        sensor = getattr(scene.board, name)
        sensor.begin("stuck")
        place, span = float(scene.pilot.commands[index]), RANGES[index]
        scene.each_tick = counted_when(lambda scene: abs(scene.pilot.commands[index] - place) > 0.0499 * span)

    return begin


def actuators() -> list[FaultCase]:
    """Rows 14 and 16."""
    ways = {"slider": 1.5 * (0.12 / 0.02 + 0.15), "ballast": 1.5 * (0.4 / 0.03 + 0.3)}
    cases = [
        FaultCase(sup.FAULT_STALL, "slider jams", device("slider", "stuck"), ABORT, ways["slider"], MOVING),
        FaultCase(sup.FAULT_STALL, "ballast jams", device("ballast", "stuck"), ABORT, ways["ballast"], ("descent",)),
    ]
    cases += [
        FaultCase(sup.FAULT_STALL, f"{name} given up by its drive", device(name, "stalled"), ABORT, 0.1)
        for name in ways
    ]
    cases += [
        FaultCase(sup.FAULT_STALL, f"{name} runs the wrong way", wrong_way(name), ABORT, 0.3, ("level",))
        for name in ways
    ]
    cases += [FaultCase(sup.FAULT_DRIVE_ALARM, f"{name} alarm", device(name, "alarm"), WARN, 0.2) for name in ways]
    cases += [
        FaultCase(sup.FAULT_DRIVE_ALARM, f"{name} alarm kept", device(name, "alarm_kept"), ABORT, 0.2) for name in ways
    ]
    return cases


def wrong_way(name: str):
    """The drive is sent far off and goes the other way; time counts from when it has gone half a percent of its way."""
    index = 1 if name == "slider" else 2

    def begin(scene: Scene) -> None:
        place = float(scene.world.x[X_ACT + index])

        def turn(commands: Any) -> None:
            commands[index] = -math.copysign(1.0, place)

        getattr(scene.board, name).begin("wrong")
        on_their_way(scene, turn)
        scene.each_tick = counted_when(lambda scene: abs(scene.world.x[X_ACT + index] - place) > 0.005 * RANGES[index])

    return begin


def controller(values: Any, ticks: float = math.inf, index: int = 1):
    """What the controller asks for, from outside: the value itself, or a factor of the actuator's range."""

    def begin(scene: Scene) -> None:
        count = [0]

        def put(commands: Any) -> None:
            if count[0] < ticks:
                count[0] += 1
                commands[index] = values
                scene.pilot.ap[ctl.WANTED_SERVO + index] = values

        on_their_way(scene, put)

    return begin


def no_solution(scene: Scene) -> None:
    """The law's form has no solution (g near zero), each time it is asked."""

    def fail(commands: Any) -> None:
        if scene.pilot.ap[ctl.ACTIVE] == ctl.LAW:
            scene.pilot.ap[ctl.LAW_STATUS] = 1.0

    on_their_way(scene, fail)


def no_number_in_the_filter(times: int):
    """So many times, half a second apart, a number of the Kalman filter's state is none."""

    def begin(scene: Scene) -> None:
        spoilt = [0]

        def spoil(scene: Scene, t: float) -> None:
            if spoilt[0] < times and t >= since + 0.5 * spoilt[0] - 1e-9:
                scene.pilot.nav[ctl.NAV_X + X_NU + spoilt[0]] = math.nan
                spoilt[0] += 1

        since = scene.world.time
        scene.each_tick = spoil

    return begin


def lateness(pattern):
    """The clock is read late: pattern(ticks since) in s."""

    def begin(scene: Scene) -> None:
        count = [0]

        def late(deadline: float) -> float:
            count[0] += 1
            return pattern(count[0])

        scene.lateness = late

    return begin


def tipped(place: int, metres: float):
    """A mass in the hull comes loose; time counts from when the vehicle is past 60 deg of pitch or 75 of roll."""

    def begin(scene: Scene) -> None:
        def past(scene: Scene) -> bool:
            roll, pitch, _ = euler_from_quaternion(*scene.world.x[X_QUAT : X_QUAT + 4])
            return abs(pitch) > math.radians(60.0) or abs(roll) > math.radians(75.0)

        scene.world.P[place] += metres
        scene.each_tick = counted_when(past)

    return begin


def nothing(scene: Scene) -> None:
    """The setting is the fault."""


def informed(place: int, value: float):
    """The runtime is informed by another part."""

    def begin(scene: Scene) -> None:
        scene.supervisor.G[place] = value

    return begin


def handles(number: int):
    """So many files are opened and never closed, in this process."""

    def begin(scene: Scene) -> None:
        files = [os.open(os.devnull, os.O_RDONLY) for _ in range(number)]
        scene.cleanup += [partial(os.close, fd) for fd in files]

    return begin


def memory(megabytes: int):
    """So much memory is taken and kept, in this process."""

    def begin(scene: Scene) -> None:
        taken = [np.ones(megabytes * 125_000)]
        scene.cleanup.append(taken.clear)

    return begin


def leak(samples: float):
    def begin(scene: Scene) -> None:
        scene.broken.leak.value = 1.0
        end = scene.world.time + 0.2 * samples

        def dry(scene: Scene, t: float) -> None:
            if t >= end - 0.01:
                scene.broken.leak.value = 0.0

        scene.each_tick = dry

    return begin


def voltage(volts: float):
    def begin(scene: Scene) -> None:
        scene.broken.battery.value = volts

    return begin


def pump_fails_in_abort(kind: str):
    """The operator gives the dive up, and the pump does not bring the vehicle up."""

    def begin(scene: Scene) -> None:
        scene.broken.pump.begin(kind)
        scene.pilot.give_up()

    return begin


def too_deep(to: float):
    """The sea floor is deeper than the hull bears, and the vehicle sinks: heavier by what it has taken in."""

    def begin(scene: Scene) -> None:
        scene.each_tick = counted_when(lambda scene: scene.depth > to)

    return begin


def conditions() -> list[FaultCase]:
    """Rows 13, 15, 17 to 24, 33, 35: what the vehicle, its controller, its loop and its surroundings do."""
    deep = Limits(working_depth_m=2.0, at_risk_depth_m=5.0)
    risk = Limits(working_depth_m=1.99, at_risk_depth_m=2.0)
    drift = {"drift": (-4_000.0, 0.0)}
    cases = [
        FaultCase(sup.FAULT_DISAGREE, "pressure drifts", device("beacon", "wrong", **drift), WARN, 5.0, ("descent",)),
        FaultCase(sup.FAULT_SOFT_LIMIT, "past the slider's range", controller(0.09), LOG, 0.0, UNDER_WAY),
        FaultCase(sup.FAULT_SOFT_LIMIT, "past the servo's range", controller(-2.0, index=0), LOG, 0.0, UNDER_WAY),
        FaultCase(sup.FAULT_SOFT_LIMIT, "past the ballast's range", controller(0.5, index=2), LOG, 0.0, ("descent",)),
        FaultCase(sup.FAULT_TOO_DEEP, "deeper than the working depth", too_deep(2.0), ABORT, 1.0, ("descent",),
             Setting(limits=deep)),
        FaultCase(sup.FAULT_TOO_DEEP, "deeper than the at-risk depth", too_deep(2.0), OOB, 0.2, ("descent",),
             Setting(limits=risk)),
        FaultCase(sup.FAULT_NO_ASCENT, "pump hears nothing", pump_fails_in_abort("silent"), OOB, 30.0, ("descent",)),
        FaultCase(sup.FAULT_NO_ASCENT, "pump jams", pump_fails_in_abort("stuck"), HW, 30.0, ("descent",)),
        FaultCase(sup.FAULT_OVERTIME, "too light to dive", nothing, ABORT, 120.0, ("waiting",),
             Setting(effects={"net_buoyancy": {"mass": -0.3}})),
        FaultCase(sup.FAULT_OVERTIME, "mission overtime", nothing, ABORT, 41.0, ("waiting",), Setting(mission_s=40.0)),
        FaultCase(sup.FAULT_LEAK, "leak, one sample", leak(1), WARN, 1.0),
        FaultCase(sup.FAULT_LEAK, "leak", leak(1000), ABORT, 1.0),
        FaultCase(sup.FAULT_STEEP, "mass shifted forward", tipped(CG_X, 0.04), ABORT, 2.0, MOVING),
        FaultCase(sup.FAULT_STEEP, "mass shifted to the side", tipped(CG_Y, 0.05), ABORT, 2.0, UNDER_WAY),
        FaultCase(sup.FAULT_NO_ANSWER, "no number, once", controller(math.nan, 1), WARN, 0.0, UNDER_WAY),
        FaultCase(sup.FAULT_NO_ANSWER, "no number", controller(math.nan), ABORT, 0.0, UNDER_WAY),
        FaultCase(sup.FAULT_NO_ANSWER, "beyond all measure", controller(1e6), ABORT, 0.0, UNDER_WAY),
        FaultCase(sup.FAULT_NO_ANSWER, "law without a solution", no_solution, ABORT, 0.02, UNDER_WAY,
             Setting(controller="law")),
        FaultCase(sup.FAULT_ESTIMATE, "no number in the filter", no_number_in_the_filter(1), WARN, 0.0, IN_WATER),
        FaultCase(sup.FAULT_ESTIMATE, "no number in the filter, three times", no_number_in_the_filter(3), ABORT, 0.0,
             IN_WATER),
        FaultCase(sup.FAULT_VOLTAGE, "voltage low", voltage(11.5), WARN, 10.0, setting=Setting(limits=BATTERY)),
        FaultCase(sup.FAULT_VOLTAGE, "voltage too low", voltage(10.5), ABORT, 10.0, setting=Setting(limits=BATTERY)),
        FaultCase(sup.FAULT_OVERRUN, "one overrun", lateness(lambda n: 0.03 * (n == 1)), LOG, 0.02, late=True),
        FaultCase(sup.FAULT_OVERRUN, "every tick late", lateness(lambda n: 0.03), ABORT, 0.02, late=True),
        FaultCase(sup.FAULT_OVERRUN, "one in ten late", lateness(lambda n: 0.03 * (n % 10 == 0)), ABORT, 0.2,
             UNDER_WAY, late=True,
             setting=Setting(hold_s=60.0)),
        FaultCase(sup.FAULT_LOOP_HUNG, "restarted", nothing, ABORT, 0.02, ("waiting",), Setting(restarted=True)),
        FaultCase(sup.FAULT_DISK, "recorder drops", informed(sup.RECORDER, 1.0), LOG, 0.0),
        FaultCase(sup.FAULT_DISK, "recorder failed", informed(sup.RECORDER, 2.0), WARN, 0.0),
        FaultCase(sup.FAULT_GROWTH, "handles are not given back", handles(130), WARN, 60.0, UNDER_WAY,
        Setting(hold_s=30.0)), FaultCase(sup.FAULT_GROWTH, "handles, without end", handles(260), ABORT, 60.0,
        UNDER_WAY, Setting(hold_s=30.0)), FaultCase(sup.FAULT_GROWTH, "memory is not given back", memory(70), WARN,
        60.0, ("descent",), Setting(hold_s=30.0)), FaultCase(sup.FAULT_GROWTH, "memory, without end", memory(160),
    ABORT, 60.0, ("descent",), Setting(hold_s=30.0)), ]  # fmt: skip
    return cases


def flown() -> list[FaultCase]:
    """Every case that is flown."""
    return devices() + actuators() + conditions()
