"""Arming: one list of checks, each with its reason. Refusing is the default: what cannot be checked is not fit.

Run on an open board, before the recorder starts and anything moves; `glider fly` on devices and twins refuses on the
first reason, `glider check` shows the same list.
"""

import os
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from glider.firmware.core.jit import CACHE_DIR, compiled_signatures
from glider.firmware.core.vehicle.layout import GRAVITY
from glider.firmware.core.vehicle.seawater import water_density
from glider.hal.ports import ACTUATORS, SLOTS, BoardError, Condition, Hardware, Validity, empty_frame
from glider.tools.data.errors import InputError
from glider.tools.flight.compose import Flight

LISTEN_S = 0.4
# What weather does to the pressure at one place, about its mean; more is a sensor's error, or not the surface.
WEATHER_PA = 6_000.0
STEADY_DEG = 45.0
TURNING_DEG_S = 60.0
WIRE_SLACK = 0.1  # of an actuator's range, by which its draw-wire may be off
BYTES_PER_SECOND = 60_000.0  # of a log, generously
SPARE_BYTES = 50e6


@dataclass(frozen=True)
class ArmingCheck:
    """One thing looked at before a flight."""

    name: str
    passed: bool
    reason: str


class ArmingRefused(Exception):
    """A check's reason to refuse."""


class Arming:
    """The checks of one flight. `folder`: where its log goes, None without one; `hardware`: a real vehicle."""

    def __init__(self, flight: Flight, *, folder: Path | None, hardware: bool):
        self.flight, self.folder, self.hardware = flight, folder, hardware
        self.frame = empty_frame()
        self.pressures: list[float] = []  # Pa, of the fit samples while listening
        self.surface_pressure = flight.board.surface_pressure  # Pa; as measured, once the zero depth has passed

    def run(self, disabled: bool = False) -> list[ArmingCheck]:
        """Every check, in the order of the list; `disabled`: none of them refuses, to show that they do."""
        self._listen()
        checks = [self._one(name, work) for name, work in self._list().items()]
        return [ArmingCheck(item.name, True, item.reason) for item in checks] if disabled else checks

    def _list(self) -> dict[str, Callable[[], str]]:
        return {
            "calibration": self.calibration, "devices": self.devices, "zero depth": self.zero_depth,
            "attitude": self.attitude, "actuators": self.actuators, "leak": self.leak, "battery": self.battery,
            "limits": self.limits, "mission": self.mission, "clock": self.clock,
            "disk": self.disk, "kernels": self.kernels,
        }  # fmt: skip

    def _one(self, name: str, work: Callable[[], str]) -> ArmingCheck:
        try:
            return ArmingCheck(name, True, work())
        except (ArmingRefused, BoardError) as error:
            return ArmingCheck(name, False, str(error))
        except Exception as error:  # whatever goes wrong in a check, it has not passed
            return ArmingCheck(name, False, f"could not be checked: {type(error).__name__}: {error}")

    def _listen(self) -> None:
        """Let time pass and take a sample of everything."""
        board, beacon = self.flight.board, SLOTS["beacon"]
        begin, listen = board.clock.now(), max(LISTEN_S, 1.5 * max(board.periods.values()))
        for tick in range(1, round(listen * board.loop_hz) + 1):
            board.clock.sleep_until(begin + tick / board.loop_hz)
            board.beacon.read(self.frame[beacon.all])
            if self.frame[beacon.validity] == Validity.VALID:
                self.pressures.append(float(self.frame[beacon.values][0]))
        for name, slot in SLOTS.items():
            port = getattr(board, name)
            if port is not None:
                port.read(self.frame[slot.all])

    # --- the checks -------------------------------------------------------------------------------------------------
    def calibration(self) -> str:
        return self.flight.board.check_calibration()

    def devices(self) -> str:
        silent, board = self.flight.board.silent(), self.flight.board
        fitted = [name for name in SLOTS if getattr(board, name) is not None]
        bad = [name for name in fitted if self.frame[SLOTS[name].validity] != Validity.VALID]
        bad += [name for name in fitted if not np.isfinite(self.frame[SLOTS[name].values]).all() and name not in bad]
        if silent or bad:
            raise ArmingRefused("; ".join(silent) or f"nothing fit from {', '.join(bad)}")
        return "every device answers"

    def zero_depth(self) -> str:
        """The pressure at the surface, from the beacon where the vehicle is armed: the zero of every depth."""
        board, (_, temperature) = self.flight.board, self.frame[SLOTS["beacon"].values]
        density = water_density(0.0, float(temperature), self.flight.mission.site.salinity)
        measured = float(np.mean(self.pressures)) - density * GRAVITY * board.armed_depth
        off = measured - board.surface_pressure
        if not abs(off) <= WEATHER_PA:
            depth = board.armed_depth + off / (density * GRAVITY)
            where = f"{board.armed_depth:g} m deep" if board.armed_depth else "in air or awash"
            raise ArmingRefused(
                f"{depth:.2f} m deep, not {where}; {off / 100:+.0f} hPa is no weather ({WEATHER_PA / 100:g} at most):"
                " armed_depth_m and [beacon] surface_pa of the board file, or `zero beacon` in the bench"
            )
        self.surface_pressure = measured
        return f"surface at {measured / 100:.1f} hPa, {off / 100:+.1f} from the board file's"

    def attitude(self) -> str:
        angles = np.degrees(self.frame[SLOTS["imu"].values])
        (roll, pitch), rates = angles[:2], angles[3:]
        if not (abs(roll) <= STEADY_DEG and abs(pitch) <= STEADY_DEG):
            raise ArmingRefused(f"roll {roll:.0f}, pitch {pitch:.0f} deg: no attitude to begin from")
        if not np.abs(rates).max() <= TURNING_DEG_S:
            raise ArmingRefused(f"turns at {np.abs(rates).max():.0f} deg/s: hold it still, or the gyro is off")
        return f"roll {roll:.0f}, pitch {pitch:.0f} deg"

    def actuators(self) -> str:
        """Every drive well, and slider and plunger where they can be."""
        bad = []
        for name in ACTUATORS:
            condition = self.frame[SLOTS[name].values][0]
            if condition != Condition.WELL:
                known = condition in list(Condition)
                bad.append(f"{name}: {Condition(int(condition)).name.lower() if known else 'condition not known'}")
        temperature = float(self.frame[SLOTS["beacon"].values][1])
        density = water_density(0.0, temperature, self.flight.mission.site.salinity)
        actuators = self.flight.vehicle.actuators
        for wire, table, scale, unit in (
            ("slider_wire", actuators.slider, 1.0, "m"),
            ("plunger_wire", actuators.ballast, density * actuators.ballast.plunger_area, "kg"),
        ):
            low, high = table.range
            place, slack = scale * float(self.frame[SLOTS[wire].values][0]), WIRE_SLACK * (high - low)
            if place < low - slack or place > high + slack:  # one that is not a number: `devices`
                bad.append(f"{wire}: at {place:.4g} {unit}, outside {low:.4g} to {high:.4g}")
        if bad:
            raise ArmingRefused("; ".join(bad))
        return "all well, within their ranges"

    def leak(self) -> str:
        if self.flight.board.leak is None:
            return "not fitted"
        if self.frame[SLOTS["leak"].values][0] != 0.0:
            raise ArmingRefused("wet")
        return "dry"

    def battery(self) -> str:
        limits = self.flight.vehicle.limits
        if self.flight.board.battery is None:
            return "not fitted"
        volts = float(self.frame[SLOTS["battery"].values][0])
        if limits is None or limits.low_voltage is None:
            return f"{volts:.1f} V; the vehicle file has no [limits] low_voltage"
        if not volts >= limits.low_voltage:
            raise ArmingRefused(f"{volts:.1f} V, below the vehicle's low_voltage of {limits.low_voltage:g} V")
        return f"{volts:.1f} V"

    def limits(self) -> str:
        limits = self.flight.vehicle.limits
        depth = None if limits is None else limits.working_depth_m
        if depth is None and self.hardware:
            raise ArmingRefused("the vehicle file has no [limits] working_depth_m")
        if depth is None:
            return f"no working depth; the site's {self.flight.mission.site.depth_m:g} m counts"
        return f"working depth {depth:g} m"

    def mission(self) -> str:
        limits, mission = self.flight.vehicle.limits, self.flight.mission
        deepest = max((leg.depth_m for leg in mission.leg if leg.depth_m is not None), default=0.0)
        if limits is not None and limits.working_depth_m is not None and deepest > limits.working_depth_m:
            raise ArmingRefused(
                f"{mission.name} goes to {deepest:g} m, deeper than the hull's {limits.working_depth_m:g} m"
            )
        return f"{mission.name}: {len(mission.leg)} legs"

    def clock(self) -> str:
        clock = self.flight.board.clock
        before = clock.now()
        clock.sleep_until(before + 0.02)
        passed = clock.now() - before
        if not 0.019 <= passed < 1.0:
            raise ArmingRefused(f"20 ms of the board's clock took {1e3 * passed:.1f} ms")
        return "runs"

    def disk(self) -> str:
        if self.folder is None:
            return "no log"
        if not os.access(self.folder, os.W_OK):
            raise ArmingRefused(f"{self.folder}: cannot be written")
        needed = SPARE_BYTES + BYTES_PER_SECOND * self.flight.mission.time_limit_s
        free = shutil.disk_usage(self.folder).free
        if free < needed:
            raise ArmingRefused(f"{self.folder}: {free / 1e6:.0f} MB free, a flight may need {needed / 1e6:.0f} MB")
        return f"{free / 1e6:.0f} MB free"

    def kernels(self) -> str:
        from glider.firmware.runtime import rehearse

        if CACHE_DIR is None and self.hardware:
            raise ArmingRefused("plain Python (GLIDER_JIT=0) is too slow to fly with")
        rehearse(self.flight.autopilot, self.flight.supervisor)
        before, took = compiled_signatures(), 1.0
        for _ in range(5):  # the quickest: the machine may have been at something else
            begin = time.perf_counter()
            rehearse(self.flight.autopilot, self.flight.supervisor)
            took = min(took, time.perf_counter() - begin)
        if compiled_signatures() != before:
            raise ArmingRefused("kernels compile anew in every rehearsal")
        if self.hardware and took > 1.0 / self.flight.board.loop_hz:
            raise ArmingRefused(
                f"a rehearsal takes {1e3 * took:.0f} ms, a tick has {1e3 / self.flight.board.loop_hz:.0f} ms"
            )
        return f"compiled; a rehearsed tick takes {1e3 * took:.1f} ms"


def refuse(checks: list[ArmingCheck]) -> None:
    """BoardError with every reason; nothing where all is fit."""
    reasons = [f"{check.name}: {check.reason}" for check in checks if not check.passed]
    if reasons:
        raise BoardError("; ".join(reasons))


def arm(flight: Flight, *, log: Path | None) -> list[ArmingCheck]:
    """The checks of a flight on an open board; BoardError where one refuses. Simulated boards are not asked.

    Once all have passed, depths of this flight count from the surface pressure that was measured.
    """
    if flight.board.hardware is Hardware.NONE:
        return []
    folder = None if log is None else log.resolve().parent
    if folder is not None and not folder.is_dir():
        raise InputError("no such folder", source=folder)
    arming = Arming(flight, folder=folder, hardware=not flight.twinned)
    checks = arming.run()
    refuse(checks)
    flight.count_depth_from(arming.surface_pressure)
    return checks
