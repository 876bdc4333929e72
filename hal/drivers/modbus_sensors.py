"""Sensors on Modbus lines: the beacon's pressure, draw-wires, leak and battery inputs."""

from collections.abc import Callable

from glider.hal.boardfile import BatteryTable, BeaconTable, LeakTable, WireTable
from glider.hal.drivers.count import Count
from glider.hal.drivers.poll import Poll
from glider.hal.drivers.samples import Health, Sensor
from glider.hal.ports import SLOTS
from glider.hal.protocols import modbus
from glider.hal.protocols.modbus import Request
from glider.hal.protocols.registers import RegisterMap, channel_of, from_registers, step_of, value_of

TEMPERATURES = (-10.0, 60.0)  # deg C, past which the transmitter is not in water


class Beacon(Sensor):
    """Absolute pressure (Pa) and water temperature (deg C)."""

    def __init__(self, table: BeaconTable, registers: RegisterMap):
        super().__init__("beacon", SLOTS["beacon"], 1.0 / table.rate_hz, (table.range_pa, TEMPERATURES))
        self._zero = table.zero_pa
        self._temperature = 15.0  # until the transmitter says its own, if it has any
        names = [name for name in ("all", "pressure") if name in registers.block]
        self._blocks = {registers.read(table.id, name): registers.block[name] for name in names}
        self.poll = Poll(
            list(self._blocks), self.period, self._taken, self.health, in_error=self.fail, damaged=self.damage
        )

    def _taken(self, request: Request, registers: list[int], asked_at: float, now: float) -> None:
        block = self._blocks[request]
        if "temperature" in block.value:
            self._temperature = value_of(block, "temperature", registers)
        pressure = value_of(block, "pressure", registers)
        self.accept(asked_at, (pressure - self._zero, self._temperature), now)


class InputRegister(Sensor):
    """A sensor of one number that is made of one reading: draw-wire, leak, battery."""

    def __init__(self, name: str, period: float, limits: tuple[float, float], convert: Callable[[float], float]):
        super().__init__(name, SLOTS[name], period, (limits,))
        self._convert = convert
        self.reading = float("nan")  # as the device gave it

    def take(self, reading: float, asked_at: float, now: float) -> None:
        self.reading = reading
        self.accept(asked_at, (self._convert(reading),), now)


def wire(name: str, table: WireTable) -> InputRegister:
    """A draw-wire: metres from readings; a broken wire reads NaN."""
    floor = table.broken_below

    def convert(reading: float) -> float:
        if floor is not None and reading < floor:
            return float("nan")
        return (reading - table.zero) / table.per_m

    return InputRegister(name, 1.0 / table.rate_hz, table.range_m, convert)


def leak(table: LeakTable) -> InputRegister:
    """1 where it is wet, 0 where it is not."""
    return InputRegister(
        "leak", 1.0 / table.rate_hz, (0.0, 1.0), lambda x: float((x > table.wet_above) != table.inverted)
    )


def battery(table: BatteryTable) -> InputRegister:
    return InputRegister("battery", 1.0 / table.rate_hz, table.range_v, lambda x: x / table.per_volt)


class AnalogModule:
    """An analog module: one read brings all its channels to the inputs on them."""

    def __init__(self, device: int, registers: RegisterMap, inputs: list[tuple[int, InputRegister]]):
        self._inputs = [(channel_of(registers, channel), item) for channel, item in inputs]
        self.health = Health(f"analog module {device}")
        block = registers.block["all"]
        last = max(value.places.stop for value, _ in self._inputs)
        counts = range(block.count, max(last, block.count - 3) - 1, -1)
        variants = [modbus.read(device, block.function, block.address, count) for count in counts]
        self.poll = Poll(
            variants, min(item.period for _, item in inputs), self._taken, self.health,
            in_error=self._fail, damaged=self._damage,
        )  # fmt: skip

    def _fail(self, now: float, what: str) -> None:
        for _, item in self._inputs:
            item.fail(now, what)

    def _damage(self, now: float) -> None:
        for _, item in self._inputs:
            item.damage(now)

    def _taken(self, request: Request, registers: list[int], asked_at: float, now: float) -> None:
        for value, item in self._inputs:
            item.take(step_of(value) * from_registers(value.type, registers, value.at), asked_at, now)


class EncoderWire:
    """A draw-wire with an absolute encoder of its own."""

    def __init__(self, device: int, registers: RegisterMap, item: InputRegister):
        self._item, self._count = item, Count(device, registers)
        self.poll = Poll(
            self._count.requests, item.period, self._taken, item.health, in_error=item.fail, damaged=item.damage
        )

    def _taken(self, request: Request, registers: list[int], asked_at: float, now: float) -> None:
        self._item.take(self._count.take(request, registers), asked_at, now)
