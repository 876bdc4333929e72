"""Faults of the simulated board's devices, switched on in flight: what a port of a broken device says and does.

Sensors: silent (nothing new), off (unplugged), stuck (fresh times, old values), garbage (not numbers), wrong (drifts
away), jump (somewhere else at once), slow (a sample now and then), delayed (late, under its own time), repeated
(another sample under the same time), backwards (times run back), intermittent (comes and goes). Actuators: silent
(hears and says nothing), off (likewise, and out of the out-of-band process's reach), stuck (jammed), wrong (runs the
wrong way), slow, alarm (once), alarm_kept, stalled, misconfigured (what a driver says of its drive).
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np

from glider.firmware.core.vehicle.layout import BALLAST_MIN, BALLAST_RATE, NET_MASS, SERVO_RATE, SLIDER_RATE, X_ACT
from glider.hal.ports import Condition, Validity
from glider.sim_backend.board import SimBoard
from glider.sim_backend.world import World

RATES = (SERVO_RATE, SLIDER_RATE, BALLAST_RATE)
JAMMED = 1e-9  # of a rate
SAID = {"alarm_kept": Condition.ALARM_KEPT, "stalled": Condition.GIVEN_UP, "misconfigured": Condition.MISCONFIGURED}
CLEARING_S = 0.3
LATE_S = 0.4
PERIOD_S = 1.0  # of what comes and goes


class FaultySensor:
    """A sensor port in front of a well one. `begin(kind, ...)` breaks it, `end()` repairs it."""

    def __init__(self, port: Any, world: World):
        self._port, self._world = port, world
        self._kind, self._since = "", 0.0
        self._drift: tuple[float, ...] = ()
        self._kept: np.ndarray | None = None
        self._queue: deque[np.ndarray] = deque(maxlen=256)

    def begin(self, kind: str, drift: tuple[float, ...] = ()) -> None:
        """drift: of `wrong` per second, of `jump` at once, one for each value, in its unit."""
        self._kind, self._since, self._drift, self._kept = kind, self._world.time, drift, None
        self._queue.clear()

    def end(self) -> None:
        self._kind = ""

    def read(self, out: np.ndarray) -> None:
        """The newest sample as the broken sensor has it."""
        self._port.read(out)
        if self._kind:
            getattr(self, f"_{self._kind}")(out, self._world.time - self._since)

    def _hold(self, out: np.ndarray, renew: bool) -> None:
        if renew or self._kept is None:
            self._kept = out.copy()
        out[...] = self._kept

    def _silent(self, out: np.ndarray, elapsed: float) -> None:
        self._hold(out, renew=False)

    def _off(self, out: np.ndarray, elapsed: float) -> None:
        out[1], out[2:] = Validity.MISSING, math.nan

    def _stuck(self, out: np.ndarray, elapsed: float) -> None:
        time = out[0]
        self._hold(out, renew=False)
        out[0] = time

    def _garbage(self, out: np.ndarray, elapsed: float) -> None:
        out[2:] = (math.nan, math.inf, -1e30, 1e12)[int(elapsed / 0.2) % 4]

    def _wrong(self, out: np.ndarray, elapsed: float) -> None:
        out[2:] += np.multiply(self._drift, elapsed)

    def _jump(self, out: np.ndarray, elapsed: float) -> None:
        out[2:] += self._drift

    def _slow(self, out: np.ndarray, elapsed: float) -> None:
        self._hold(out, renew=self._kept is not None and out[0] - self._kept[0] >= PERIOD_S)

    def _delayed(self, out: np.ndarray, elapsed: float) -> None:
        if not self._queue or self._queue[-1][0] != out[0]:
            self._queue.append(out.copy())
        while len(self._queue) > 1 and self._queue[1][0] <= self._world.time - LATE_S:
            self._queue.popleft()
        out[...] = self._queue[0]

    def _repeated(self, out: np.ndarray, elapsed: float) -> None:
        if self._kept is None:
            self._kept = out.copy()
        out[0] = self._kept[0]

    def _backwards(self, out: np.ndarray, elapsed: float) -> None:
        out[0] -= 2.0 * elapsed

    def _intermittent(self, out: np.ndarray, elapsed: float) -> None:
        self._hold(out, renew=elapsed % PERIOD_S > 0.6 * PERIOD_S)


class FaultyActuator:
    """An actuator port in front of a well one, on plant actuator `index` (servo, slider, ballast)."""

    def __init__(self, port: Any, world: World, index: int):
        self._port, self._world, self._index = port, world, index
        self.limits = port.limits
        self._kind, self._since, self._place, self._heard = "", 0.0, 0.0, 0.0
        self._rate = float(world.P[RATES[index]])
        self.reachable = True  # for the out-of-band process
        self.taken = False  # by it

    def begin(self, kind: str) -> None:
        self._kind, self._since = kind, self._world.time
        self._place = float(self._world.x[X_ACT + self._index])
        self.reachable = kind not in ("off", "stuck")
        if kind in ("stuck", "slow"):
            self._world.P[RATES[self._index]] = self._rate * (JAMMED if kind == "stuck" else 0.4)

    def end(self) -> None:
        self._kind, self.reachable = "", True
        self._world.P[RATES[self._index]] = self._rate

    def read(self, out: np.ndarray) -> None:
        self._port.read(out)
        if self._kind in ("silent", "off"):
            out[0] = self._since
        elif self._kind == "alarm" and self._world.time - self._since < CLEARING_S:
            out[2] = Condition.ALARM
        elif self._kind in SAID:
            out[2] = SAID[self._kind]

    def command(self, value: float) -> float:
        if self.taken:
            return value
        if self._kind in ("silent", "off") or self._kind in SAID:
            self._world.cmd[self._index] = self._place
            return value
        if self._kind == "wrong" and value == value:
            self._port.command(2.0 * self._place - value)
            return value
        return self._port.command(value)


class SimulatedEscape:
    """What is left when the flight software is not: the out-of-band process on the pump, and the drop weight."""

    def __init__(self, world: World, pump: FaultyActuator, weight_kg: float = 0.6):
        self._world, self._pump, self._weight = world, pump, weight_kg

    def ascend(self) -> None:
        """The pump to its light end, by another way than the flight's, if it can be reached."""
        if self._pump.reachable:
            self._pump.end()
            self._pump.taken = True  # the flight has no say any more
            self._world.cmd[2] = self._world.P[BALLAST_MIN]

    def release(self) -> None:
        self._world.P[NET_MASS] -= self._weight


class SimulatedInput:
    """A leak or battery input that samples every PERIOD_S."""

    PERIOD_S = 0.2

    def __init__(self, world: World, value: float):
        self._world, self.value = world, value

    def read(self, out: np.ndarray) -> None:
        samples = math.floor(self._world.time / self.PERIOD_S + 1e-6)
        out[0], out[1], out[2] = samples * self.PERIOD_S, Validity.VALID, self.value


@dataclass(frozen=True)
class Broken:
    """What breaks the inputs and the pump of a board that was broken in; its other ports do so themselves."""

    leak: SimulatedInput
    battery: SimulatedInput
    pump: FaultyActuator


def break_in(board: SimBoard) -> Broken:
    """Put a faulty port in front of every device of a simulated board, a leak and a battery, and the ways out."""
    world = board.world
    leak, battery = SimulatedInput(world, 0.0), SimulatedInput(world, 14.0)
    board.leak, board.battery = leak, battery
    board.periods |= {name: SimulatedInput.PERIOD_S for name in ("leak", "battery")}
    for name in ("imu", "beacon", "slider_wire", "plunger_wire", "leak", "battery"):
        setattr(board, name, FaultySensor(getattr(board, name), world))
    for index, name in enumerate(("servo", "slider")):
        setattr(board, name, FaultyActuator(getattr(board, name), world, index))
    board.ballast = pump = FaultyActuator(board.ballast, world, 2)
    board.out_of_band = board.drop_weight = SimulatedEscape(world, pump)
    return Broken(leak, battery, pump)
