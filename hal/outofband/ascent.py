"""The way up without the flight: pump to its light end, mass aft, servo to the middle; asked again until it is so.

Where the plan has a pressure transmitter it is seen whether the vehicle rises, and what follows where it does not.
"""

import time

from glider.hal.outofband.plan import AscentPlan, AxisPlan, PressurePlan, ServoPlan, WirePlan
from glider.hal.outofband.rise import AscentStage, Rise
from glider.hal.outofband.wire import Port, number_of, path_words, servo_frame, write_many_frame, write_one_frame

FAULT, RUNNING = 1, 4  # bits of a drive's status
CLEAR_S = 2.0  # between two tries to clear an alarm
AGAIN_S = 5.0  # after which a path that shows no effect is written anew
SHARE_S = 2.0  # a port that is still held after this is opened all the same
STUCK_SHARE = 1.0 / 3.0  # of the time to rise; twenty readings of the default 30 s, equal to the last bit: it is stuck
SAID = {
    AscentStage.BLIND: "no depth", AscentStage.RISING: "under water", AscentStage.SURFACED: "at the surface",
    AscentStage.AGAIN: "does not rise at {depth:.0f} m (row 18): pumping again",
    AscentStage.HARDWARE: "does not rise at {depth:.0f} m (row 18): no more feeding of the hardware watchdog",
}  # fmt: skip


class Ascent:
    """`step` serves every actuator once; it waits for the lines, a second or two at most where all are dead."""

    def __init__(self, plan: AscentPlan):
        self.plan = plan
        self._ports: dict[str, Port] = {}
        self._axes = [Axis(axis, self) for axis in plan.axes]
        self._transmitter = None if plan.pressure is None else Transmitter(plan.pressure, self)
        self._rise = None if plan.pressure is None else Rise(
            plan.pressure.patience_s, plan.pressure.step_m, plan.pressure.surface_m
        )  # fmt: skip
        self.stage, self.depth = AscentStage.BLIND, float("nan")
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
        if self._rise is not None and self._transmitter is not None:
            self._judge(self._rise, self._transmitter.read())
            said.append(SAID[self.stage].format(depth=self.depth))
        return ", ".join(said)

    def _judge(self, rise: Rise, depth: float | None) -> None:
        """Row 18: pump again when it is time to."""
        before, self.stage = self.stage, rise.look(time.monotonic(), depth)
        if depth is not None:
            self.depth = depth
        if self.stage >= AscentStage.AGAIN and self.stage != before:
            for axis in self._axes:
                axis.again()

    def registers(self, plan: WirePlan | PressurePlan) -> list[int] | None:
        """What stands in a transmitter's registers; None where it does not answer."""
        port = self.port(plan.port, plan.baud)
        return None if port is None else port.registers(plan.id, plan.reading)

    def _centre(self, servo: ServoPlan) -> str:
        port = self.port(servo.port, servo.baud)
        frame = servo_frame(servo.channel, servo.quarter_us, servo.number, servo.crc)
        return "servo centred" if port is not None and port.send(frame) else "servo: no port"

    def close(self) -> None:
        """Give the ports back; the drives go on to where they were sent."""
        for port in self._ports.values():
            port.close()


class Transmitter:
    """Depth from the pressure transmitter."""

    def __init__(self, plan: PressurePlan, ascent: Ascent):
        self.plan, self._ascent = plan, ascent
        self._registers: list[int] | None = None
        self._changed_at = 0.0

    def read(self) -> float | None:
        """Depth, m; None where the transmitter says nothing that can be, or always the same."""
        plan, now = self.plan, time.monotonic()
        registers = self._ascent.registers(plan)
        if registers is None:
            return None
        number = plan.reading.number
        words = registers[number.places.start : number.places.stop]
        if words != self._registers:
            self._registers, self._changed_at = words, now
        pressure = number_of(number, registers) - plan.zero_pa
        if not plan.low_pa <= pressure <= plan.high_pa or now - self._changed_at > STUCK_SHARE * plan.patience_s:
            return None
        return (pressure - plan.surface_pa) / plan.pa_per_m


class Axis:
    """A drive on its way to an end."""

    def __init__(self, plan: AxisPlan, ascent: Ascent):
        self.plan, self._ascent = plan, ascent
        self.answered = False
        self._end = plan.end_m
        self._zero_drift = 0.0  # counts between the drive's zero and the draw-wire's
        self._forced = False
        self._written: int | None = None
        self._written_at = self._cleared_at = -1e9

    def step(self) -> str:
        """Look, clear an alarm, send it; how it does in words."""
        plan = self.plan
        self.answered = False
        port = self._ascent.port(plan.port, plan.baud)
        if port is None:
            self._written = None  # the drive may have lost its power with the line
            return f"{plan.name}: no port"
        bits = port.registers(plan.id, plan.status)
        status = 0 if bits is None else int(number_of(plan.status.number, bits))
        position = port.registers(plan.id, plan.position)
        counts = None if position is None else number_of(plan.position.number, position)
        self.answered = bits is not None or position is not None
        if not self.answered:
            self._written = None
        if self._forced or status & FAULT:
            self._forced = False
            self._clear(port)
        if counts is not None and plan.wire is not None:
            measured = self._measure(plan.wire)
            if measured is not None:
                self._zero_drift = counts - plan.zero_counts - plan.counts_per_m * measured
        target = round(plan.zero_counts + self._zero_drift + plan.counts_per_m * self._end)
        near = plan.tolerance_m * abs(plan.counts_per_m)
        if counts is not None and abs(counts - target) <= near:
            return f"{plan.name} at its end"
        running = bool(status & RUNNING)
        moved_on = self._written is None or abs(target - self._written) > near
        stands = not running and time.monotonic() - self._written_at > 1.0
        if moved_on or stands or time.monotonic() - self._written_at > AGAIN_S:
            self._send(port, target)
        return f"{plan.name} on its way" if self.answered else f"{plan.name}: no answer"

    def again(self) -> None:
        """As if nothing had been done yet, and as far as it goes: the next step clears alarms, whatever the drive says
        of them, and writes the path anew."""
        self._end, self._written = self.plan.last_m, None
        self._written_at = self._cleared_at = -1e9
        self._forced = True

    def _clear(self, port: Port) -> None:
        now = time.monotonic()
        if now - self._cleared_at > CLEAR_S:
            self._cleared_at, self._written = now, None
            port.exchange(write_one_frame(self.plan.id, self.plan.auxiliary, self.plan.clear_alarm), 8)

    def _measure(self, wire: WirePlan) -> float | None:
        """Where the draw-wire says the actuator is, m; None where it says nothing that can be."""
        registers = self._ascent.registers(wire)
        if registers is None:
            return None
        metres = (number_of(wire.reading.number, registers) - wire.zero) / wire.per_m
        return metres if wire.low_m <= metres <= wire.high_m else None

    def _send(self, port: Port, counts: int) -> None:
        plan = self.plan
        words = path_words(
            plan.path, absolute=plan.absolute, counts=counts, rpm=plan.rpm, ramp_ms=plan.ramp_ms, trigger=plan.trigger
        )
        request = write_many_frame(plan.id, plan.path.address, words)
        reply = port.exchange(request, 8)
        self._written_at = time.monotonic()
        self._written = counts if reply[:6] == request[:6] else None
