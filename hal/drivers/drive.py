"""Slider and ballast pump: a stepper drive moved by absolute positions, watched by the draw-wire.

Counts = zero + zero_drift + counts_per_m * metres. With follow = "wire" a slow loop on the draw-wire estimates
`zero_drift`, so that lost steps and slip do not stay; it is quick while the drive stands and ten times slower while it
moves, when the wire lags. A move that does not show is a stall: stopped, tried twice more, then an error; one the wrong
way is stopped at once. Errors keep the drive still until `reset`.
"""

import math
from collections.abc import Sequence

from glider.hal.boardfile import DriveTable
from glider.hal.drivers.count import Count
from glider.hal.drivers.poll import ExceptionCounter, Poll, exception_text
from glider.hal.drivers.samples import Health, SampleState, Sensor
from glider.hal.ports import SLOTS, STALL_REST_S, STALL_TRIES, Condition, Validity
from glider.hal.protocols import modbus
from glider.hal.protocols.modbus import Frame, Request
from glider.hal.protocols.modbus_master import Failure, ModbusBus
from glider.hal.protocols.registers import RegisterMap, registers_of, value_of

FAULT, ENABLED, RUNNING = 1, 2, 4  # bits of the status
STATUS_S = 0.2
DRIFT_STANDING, DRIFT_MOVING = 0.1, 0.01  # shares of the wire's disagreement taken over at each reading
LOST_AFTER_S = 0.5  # without its position
STALLED, WRONG_WAY, ALARM = "stalled", "runs the wrong way", "drive alarm"
CONDITIONS = {STALLED: Condition.GIVEN_UP, WRONG_WAY: Condition.WRONG_WAY, ALARM: Condition.ALARM_KEPT}


class Drive:
    """Actuator port. `unit` is what a metre is worth in the port's unit: 1 for the slider, kg of net mass per metre of
    plunger for the ballast pump."""

    def __init__(
        self, name: str, table: DriveTable, registers: RegisterMap, unit: float,
        vehicle_range: tuple[float, float], wire: Sensor | None,
    ):  # fmt: skip
        self.name, self.table, self.unit = name, table, unit
        self.health = Health(name)
        low, high = (limit * unit for limit in table.limits_m)
        self.limits = (max(low, vehicle_range[0]), min(high, vehicle_range[1]))
        self.target: float | None = None  # m; None: no command
        self.enabled = False
        self.speed_share = 1.0
        self.status = 0
        self.counts = 0.0
        self.counts_at = -math.inf
        self.zero_drift = 0.0
        self.stalls = 0
        self.fault = ""  # what keeps it still until `reset`
        self._map, self._wire = registers, wire
        self._drift_known = False
        self._watch = StallDetector(table.stall_m, table.stall_s)
        self._count = Count(table.id, registers)
        self._position = Poll(
            self._count.requests, 1.0 / table.rate_hz, self._took_position, self.health, in_error=self.refused
        )
        self._status = Poll(
            [registers.read(table.id, "status")], STATUS_S, self._took_status, self.health, in_error=self.refused
        )
        self._mover = MotionJob(self)
        self._state = SampleState(SLOTS[name])
        self.start, self.read = self._state.start, self._state.read

    def join(self, bus: ModbusBus) -> None:
        """Take part in a line."""
        for job in (self._mover, self._position, self._status):
            bus.add(job)

    # --- the port ---------------------------------------------------------------------------------------------------
    def command(self, value: float) -> float:
        """Ask for a position in the port's unit; returns what is sent after limits. NaN changes nothing."""
        low, high = self.limits
        if value != value:
            return self.target * self.unit if self.target is not None else 0.0
        value = low if value < low else high if value > high else value
        self.target = value / self.unit
        return value

    def stop(self) -> None:
        """Quick stop, before anything else on the line."""
        self.target = None
        self._mover.stop_wanted = True

    def reset(self) -> None:
        """Forget an error, after someone has looked."""
        self.health.error = self.fault = ""
        self.stalls = 0
        self._mover.clears = 0
        self._watch.forget(0.0)

    def age(self, now: float) -> None:
        """Say that the drive is gone once its position has not come for a while."""
        if self.counts_at > -math.inf and not self.health.error and now - self.counts_at > LOST_AFTER_S:
            self.health.say(now, "no answer")

    def answering(self, now: float) -> bool:
        return now - self.counts_at < LOST_AFTER_S

    def refused(self, now: float, what: str) -> None:
        """It answers, and refuses what it is asked, for good."""
        self._state.answered(now, Condition.MISCONFIGURED)

    def _condition(self) -> Condition:
        """How it does, as the supervisor asks."""
        if self.fault:
            return CONDITIONS[self.fault]
        if self.status & FAULT:
            return Condition.ALARM
        return Condition.RETRYING if self.stalls else Condition.WELL

    def _fail(self, now: float, what: str) -> None:
        self.fault = what
        self._state.say(CONDITIONS[what])
        self.health.say(now, what)

    def position(self) -> float:
        """Where the drive is by its own count and its zero's drift, m."""
        return (self.counts - self.table.zero_counts - self.zero_drift) / self.table.counts_per_m

    def measured(self) -> float:
        """Where it is by the draw-wire, if that is well, else by its own count; m."""
        wire = self._wire
        return wire.values[0] if wire is not None and wire.validity == Validity.VALID else self.position()

    def counts_for(self, metres: float) -> float:
        low, high = self.table.limits_m
        return self.table.zero_counts + self.zero_drift + self.table.counts_per_m * min(max(metres, low), high)

    # --- replies ----------------------------------------------------------------------------------------------------
    def _took_position(self, request: Request, registers: list[int], asked_at: float, now: float) -> None:
        before = self.counts
        if asked_at - self.counts_at > LOST_AFTER_S:
            self._mover.forget()  # the drive may have been without power
        self.counts = self._count.take(request, registers)
        self.counts_at = asked_at
        self._state.answered(now, self._condition())
        if self.health.error != self.fault:
            self.health.say(now, self.fault)
        if self.table.follow == "wire":
            self._update_drift(self.counts - before)
        if self.target is not None and self.enabled and not self.fault:
            self._look(now)

    def _update_drift(self, moved: float) -> None:
        wire = self._wire
        if wire is None or wire.validity != Validity.VALID:
            return
        found = self.counts - self.table.zero_counts - self.table.counts_per_m * wire.values[0]
        if not self._drift_known:
            self._drift_known, self.zero_drift = True, found
            return
        standing = abs(moved) <= 2.0 * self.table.deadband_m * abs(self.table.counts_per_m)
        self.zero_drift += (DRIFT_STANDING if standing else DRIFT_MOVING) * (found - self.zero_drift)

    def _look(self, now: float) -> None:
        """Does it move where it was sent?"""
        assert self.target is not None
        verdict = self._watch.look(self.target, self.position(), now)
        wire = self._wire
        if not verdict and wire is not None and wire.validity == Validity.VALID:
            verdict = self._watch.compare(self.counts / self.table.counts_per_m, wire.values[0])
        if not verdict:
            return
        self.stalls += 1
        self._mover.stop_wanted = True
        self._mover.rest_until = now + STALL_REST_S
        self._watch.forget(now)
        if verdict == WRONG_WAY or self.stalls > STALL_TRIES:
            self._fail(now, verdict)

    def _took_status(self, request: Request, registers: list[int], asked_at: float, now: float) -> None:
        self.status = int(value_of(self._map.block["status"], "status", registers))
        if not self.status & FAULT:
            return
        if self._mover.clears == 0:
            self._mover.clear_wanted = True
        elif not self._mover.clear_wanted and not self.fault:
            self._fail(now, ALARM)


class StallDetector:
    """Sees a stall: no progress towards a target that is away; or a drive that counts on while its wire stands.

    The wire is judged by how far it moves, not by where it is: a wrong zero is no stall.
    """

    def __init__(self, least_m: float, patience_s: float):
        self._least, self._patience = least_m, patience_s
        self._from, self._since, self._way = math.nan, 0.0, 0.0
        self._mark = (math.nan, math.nan)

    def restart(self, position: float, now: float, way: float = 0.0) -> None:
        self._from, self._since, self._way = position, now, way

    def forget(self, now: float) -> None:
        """Begin anew, after a verdict or a reset."""
        self.restart(math.nan, now)
        self._mark = (math.nan, math.nan)

    def look(self, target: float, position: float, now: float) -> str:
        """What is wrong with the drive's own progress, in words; empty while nothing is."""
        left = target - position
        way = 0.0 if abs(left) < self._least else math.copysign(1.0, left)
        progress = way * (position - self._from)
        if way == 0.0 or way != self._way or not progress < self._least / 4.0:
            self.restart(position, now, way)
            return ""
        if progress < -self._least:
            return WRONG_WAY
        return STALLED if now - self._since > self._patience else ""

    def compare(self, counted: float, wire: float) -> str:
        """What is wrong between the drive's way and its wire's, m; empty while nothing is."""
        moved = counted - self._mark[0]
        if abs(moved) < 2.0 * self._least:
            return ""
        shown = math.copysign(1.0, moved) * (wire - self._mark[1])
        self._mark = (counted, wire)
        if shown < -0.25 * abs(moved):
            return WRONG_WAY
        return STALLED if shown < 0.25 * abs(moved) else ""


class MotionJob:
    """The job that writes: quick stop, clearing an alarm once, and the path to the target when that has moved."""

    def __init__(self, drive: Drive):
        self._drive, self._map = drive, drive._map
        self.device = drive.table.id
        self.stop_wanted = self.clear_wanted = False
        self.clears = 0
        self.rest_until = -math.inf
        self._refusals = ExceptionCounter()
        self._written: float | None = None
        self._next = -math.inf
        self._stopping = False
        word, command = self._map.word, self._map.command
        stop = modbus.write_one(self.device, word["control"], command["quick_stop"])
        # the same with another function, for when the echo of a stop may still come
        self._stops = (stop, modbus.write_many(self.device, word["control"], [command["quick_stop"]]))
        self._clear = modbus.write_one(self.device, word["auxiliary"], command["clear_alarm"])

    @property
    def due(self) -> float:
        if self.stop_wanted or self.clear_wanted:
            return self._next
        return max(self._next, self.rest_until) if self._wants_to_move() else math.inf

    @due.setter
    def due(self, at: float) -> None:
        self._next = at

    def _wants_to_move(self) -> bool:
        drive = self._drive
        if not drive.enabled or drive.target is None or drive.fault or drive.counts_at == -math.inf:
            return False
        if self._written is None:
            return True
        deadband = drive.table.deadband_m * abs(drive.table.counts_per_m)
        return abs(drive.counts_for(drive.target) - self._written) > deadband

    def requests(self, now: float) -> Sequence[Request]:
        self._next = now + 1.0 / self._drive.table.rate_hz
        if self.stop_wanted:
            return self._stops
        if self.clear_wanted:
            return (self._clear,)
        if not self._wants_to_move():
            return ()
        return self._paths()

    def _paths(self) -> Sequence[Request]:
        """Build the requests that send the drive to its target: the whole path, and a variant for when the echo of that
        could be mistaken for a late one. The variant leaves the mode out, which the drive has already; a map with the
        mode between other numbers has no variant, and the path waits until no echo is missing."""
        drive, table = self._drive, self._drive.table
        assert drive.target is not None
        self._asked_for = drive.counts_for(drive.target)
        path, command = self._map.block["path"], self._map.command
        numbers = {
            "mode": command["absolute"], "position": self._asked_for,
            "speed": max(1, round(table.rpm * drive.speed_share)), "acceleration": table.ramp_ms,
            "deceleration": table.ramp_ms, "pause": 0, "trigger": command["trigger"],
        }  # fmt: skip
        places: dict[int, int] = {}
        for name, number in numbers.items():
            places |= registers_of(path, name, number)
        mode = path.value["mode"].places
        first, last = path.address, path.address + path.count
        spans = [(first, last)]
        if mode.start == 0:
            spans.append((first + mode.stop, last))
        elif mode.stop == path.count:
            spans.append((first, first + mode.start))
        return [modbus.write_many(self.device, at, [places[i] for i in range(at, end)]) for at, end in spans]

    def answered(self, request: Request, reply: Frame, asked_at: float, now: float) -> None:
        self._refusals.running = 0
        if request in self._stops:
            self.stop_wanted = False
            self.forget()
            self._next = now
        elif request is self._clear:
            self.clear_wanted = False
            self.clears += 1
        else:
            self._written = self._asked_for

    def forget(self) -> None:
        """Write the path again: the drive may not have it."""
        self._written = None

    def failed(self, request: Request | None, failure: Failure, exception: int, now: float) -> None:
        health = self._drive.health
        self.forget()
        if failure is Failure.EXCEPTION:
            health.exceptions += 1
            health.say(now, exception_text(exception))
            self._next = now + 0.1
            if self._refusals.refused(exception):
                self._drive.refused(now, exception_text(exception))
        elif failure in (Failure.TIMEOUT, Failure.DAMAGED):
            health.timeouts += 1
