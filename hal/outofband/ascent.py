"""The way up without the flight: pump to its light end, mass aft, servo to the middle; asked again until it is so."""

import struct
import time

from hal.outofband.plan import AxisPlan, Plan, ServoPlan, WirePlan
from hal.outofband.wire import (
    Port,
    path_words,
    read_frame,
    registers_of,
    servo_frame,
    write_many_frame,
    write_one_frame,
)

FAULT, RUNNING = 1, 4  # bits of a drive's status
CLEAR_S = 2.0  # between two tries to clear an alarm
AGAIN_S = 5.0  # after which a path that shows no effect is written anew
SHARE_S = 2.0  # a port that is still held after this is opened all the same


class Ascent:
    """`step` serves every actuator once; it waits for the lines, a second or two at most where all are dead."""

    def __init__(self, plan: Plan):
        self.plan = plan
        self._ports: dict[str, Port] = {}
        self._axes = [Axis(axis, self) for axis in plan.axes]
        self._began = time.monotonic()
        self.pump_heard_at = 0.0  # monotonic, s; 0: not heard yet
        self.reached_port_at = self._began  # any port

    def port(self, path: str, baud: int) -> Port | None:
        """A port, open; None where it cannot be."""
        port = self._ports.setdefault(path, Port(path, baud))
        if not port.open(exclusive=time.monotonic() - self._began < SHARE_S):
            return None
        self.reached_port_at = time.monotonic()
        return port

    def step(self) -> str:
        """Serve all; a line that says how each does."""
        said = []
        for axis in self._axes:
            said.append(axis.step())
            if axis is self._axes[0] and axis.answered:
                self.pump_heard_at = time.monotonic()
        if self.plan.servo is not None:
            said.append(self._centre(self.plan.servo))
        return ", ".join(said)

    def _centre(self, servo: ServoPlan) -> str:
        port = self.port(servo.port, servo.baud)
        frame = servo_frame(servo.channel, servo.quarter_us, servo.number, servo.crc)
        return "servo centred" if port is not None and port.send(frame) else "servo: no port"

    def close(self) -> None:
        """Give the ports back; the drives go on to where they were sent."""
        for port in self._ports.values():
            port.close()


class Axis:
    """A drive on its way to an end."""

    def __init__(self, plan: AxisPlan, ascent: Ascent):
        self.plan, self._ascent = plan, ascent
        self.answered = False
        self._zero_drift = 0.0  # counts between the drive's zero and the draw-wire's
        self._written: int | None = None
        self._written_at = self._cleared_at = -1e9

    def step(self) -> str:
        """Look, clear an alarm, send it; how it does in words."""
        plan = self.plan
        self.answered = False
        port = self._ascent.port(plan.port, plan.baud)
        if port is None:
            return f"{plan.name}: no port"
        status = self._read(port, plan.status, 1)
        position = self._read(port, plan.position, 2)
        counts = None if position is None else struct.unpack(">i", struct.pack(">HH", *position))[0]
        self.answered = status is not None or position is not None
        if status is not None and status[0] & FAULT:
            self._clear(port)
        if counts is not None and plan.wire is not None:
            measured = self._measure(plan.wire)
            if measured is not None:
                self._zero_drift = counts - plan.zero_counts - plan.counts_per_m * measured
        target = round(plan.zero_counts + self._zero_drift + plan.counts_per_m * plan.end_m)
        near = plan.tolerance_m * abs(plan.counts_per_m)
        if counts is not None and abs(counts - target) <= near:
            return f"{plan.name} at its end"
        running = status is not None and bool(status[0] & RUNNING)
        moved_on = self._written is None or abs(target - self._written) > near
        stands = not running and time.monotonic() - self._written_at > 1.0
        if moved_on or stands or time.monotonic() - self._written_at > AGAIN_S:
            self._send(port, target)
        return f"{plan.name} on its way" if self.answered else f"{plan.name}: no answer"

    def _read(self, port: Port, address: int, count: int) -> list[int] | None:
        reply = port.exchange(read_frame(self.plan.id, 3, address, count), 5 + 2 * count)
        return registers_of(reply, self.plan.id, 3, count)

    def _clear(self, port: Port) -> None:
        now = time.monotonic()
        if now - self._cleared_at > CLEAR_S:
            self._cleared_at, self._written = now, None
            port.exchange(write_one_frame(self.plan.id, self.plan.auxiliary, self.plan.clear_alarm), 8)

    def _measure(self, wire: WirePlan) -> float | None:
        """Where the draw-wire says the actuator is, m; None where it says nothing that can be."""
        port = self._ascent.port(wire.port, wire.baud)
        if port is None:
            return None
        request = read_frame(wire.id, wire.function, wire.address, wire.words)
        registers = registers_of(port.exchange(request, 5 + 2 * wire.words), wire.id, wire.function, wire.words)
        if registers is None:
            return None
        reading = registers[0] if wire.words == 1 else registers[0] << 16 | registers[1]
        metres = (reading - wire.zero) / wire.per_m
        return metres if wire.low_m <= metres <= wire.high_m else None

    def _send(self, port: Port, counts: int) -> None:
        plan = self.plan
        words = path_words(plan.absolute, counts, plan.rpm, plan.ramp_ms, plan.trigger)
        request = write_many_frame(plan.id, plan.path, words)
        reply = port.exchange(request, 8)
        self._written_at = time.monotonic()
        self._written = counts if reply[:6] == request[:6] else None
