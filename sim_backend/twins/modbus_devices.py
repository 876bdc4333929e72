"""What stands in the registers of the Modbus twins; pymodbus's own server serves them.

A device is a pymodbus SimDevice whose action fills the registers just before they are read, and acts on what is
written.
"""

import math
from abc import ABC, abstractmethod
from typing import Any

from pymodbus.constants import ExcCodes
from pymodbus.simulator import DataType, SimData, SimDevice

from glider.hal.boardfile import BatteryTable, DriveTable, LeakTable, WireTable
from glider.hal.protocols.registers import (
    LOW,
    WORDS,
    RegisterMap,
    channel_of,
    registers_of,
    step_of,
    to_registers,
    value_of,
)
from glider.sim_backend.twins.faults import TwinFault
from glider.sim_backend.twins.plant import TwinPlant


class RegisterTwin(ABC):
    """A device with registers. `extra` are further addresses, with their counts, that it has."""

    def __init__(self, device: int, registers: RegisterMap, extra: tuple[tuple[int, int], ...] = ()):
        self.device, self.map, self.fault = device, registers, TwinFault()
        self._held: dict[int, list[int]] = {}
        places: dict[int, int] = {}
        for start, count in (*((b.address, b.count) for b in registers.block.values()), *extra):
            for address in range(start, start + count):
                places[address] = 1
        data = [SimData(address, values=0, datatype=DataType.REGISTERS) for address in sorted(places)]
        self.sim = SimDevice(device, simdata=data, action=self._action)

    async def _action(
        self, function: int, start: int, address: int, count: int, registers: list[int], values: Any
    ) -> ExcCodes | None:
        if values is not None:
            return self.written(address, list(values), lambda place: registers[place - start])
        if self.fault.kind == "stuck" and address in self._held:
            return None
        for place, number in self.fill().items():
            if place - start < len(registers) - 1:
                registers[place - start] = number
        self._held[address] = []
        return None

    def well(self) -> None:
        """A fault is over."""
        self._held.clear()

    @abstractmethod
    def fill(self) -> dict[int, int]:
        """Address -> register, as of now."""

    def written(self, address: int, values: list[int], stored: Any) -> ExcCodes | None:
        """Registers were written; an exception refuses them."""
        return ExcCodes.ILLEGAL_ADDRESS

    def step(self, t: float, step: int) -> None:  # noqa: B027 (most devices do not move)
        """A plant step has been made."""

    def _place(self, block: str, name: str, number: float) -> dict[int, int]:
        return registers_of(self.map.block[block], name, number)

    def _place_count(self, count: float) -> dict[int, int]:
        """A count where the whole number stands, and where its low word stands alone."""
        low, whole, name = LOW[self.map.role]
        part, number = self.map.block[low].value[name], self.map.block[whole].value[name]
        places = self._place(whole, name, count)
        if WORDS[part.type] < WORDS[number.type]:
            *_, low_word = to_registers(number.type, count / step_of(number))
            return places | {self.map.block[low].address + part.at: low_word}
        return places | self._place(low, name, count)


class PressureTwin(RegisterTwin):
    """A pressure transmitter."""

    def __init__(self, device: int, registers: RegisterMap, plant: TwinPlant, zero_pa: float):
        super().__init__(device, registers)
        self._plant, self._zero = plant, zero_pa

    def fill(self) -> dict[int, int]:
        pressure, temperature = self._plant.pressure()
        now = {"pressure": math.nan if self.fault.kind == "nan" else pressure + self._zero, "temperature": temperature}
        places: dict[int, int] = {}
        for name, block in self.map.block.items():
            for quantity in now.keys() & block.value.keys():
                places |= self._place(name, quantity, now[quantity])
        return places


class AnalogTwin(RegisterTwin):
    """An analog module: draw-wires by the plant, leak and battery as commanded."""

    def __init__(self, device: int, registers: RegisterMap, plant: TwinPlant):
        super().__init__(device, registers, extra=tuple((word, 1) for word in registers.word.values()))
        self._plant = plant
        self._wires: dict[str, tuple[int, WireTable]] = {}
        first = channel_of(registers, 1)
        self.channels = [0.0] * ((registers.block["all"].count - first.at) // len(first.places))
        self._modes = [3] * (registers.block["modes"].count if "modes" in registers.block else 0)
        self._first_mode = registers.block["modes"].address if self._modes else 0

    def add(self, name: str, table: Any) -> None:
        """Something is connected to a channel."""
        if isinstance(table, WireTable):
            self._wires[name] = (table.channel or 1, table)
        elif isinstance(table, LeakTable):
            self.channels[table.channel - 1] = 20_000.0 if table.inverted else 4_000.0
        elif isinstance(table, BatteryTable):
            self.channels[table.channel - 1] = 14.8 * table.per_volt

    def fill(self) -> dict[int, int]:
        for name, (channel, table) in self._wires.items():
            reading = table.zero + table.per_m * self._plant.wire(name)
            self.channels[channel - 1] = 0.0 if self.fault.kind == "nan" else reading  # a broken wire: no current
        places: dict[int, int] = {}
        for channel, value in enumerate(self.channels, start=1):
            place = channel_of(self.map, channel)
            words = to_registers(place.type, value / step_of(place))
            places |= {self.map.block["all"].address + i: word for i, word in zip(place.places, words, strict=True)}
        return {**places, **{self._first_mode + i: mode for i, mode in enumerate(self._modes)}}

    def written(self, address: int, values: list[int], stored: Any) -> ExcCodes | None:
        first = self._first_mode
        for place, value in enumerate(values, start=address):
            if not first <= place < first + len(self._modes) or value > 4:
                return ExcCodes.ILLEGAL_VALUE
            self._modes[place - first] = value
        return None


class EncoderTwin(RegisterTwin):
    """A draw-wire with an absolute encoder."""

    def __init__(self, device: int, registers: RegisterMap, plant: TwinPlant, name: str, table: WireTable):
        super().__init__(device, registers)
        self._plant, self._name, self._table = plant, name, table

    def fill(self) -> dict[int, int]:
        count = self._table.zero + self._table.per_m * self._plant.wire(self._name)
        return self._place_count(count)


class DriveTwin(RegisterTwin):
    """A stepper drive: path 0 with absolute positions, a trapezoid of speed, quick stop, set zero, alarm."""

    FAULT, ENABLED, RUNNING, COMMAND_DONE, PATH_DONE, HOMED = 1, 2, 4, 16, 32, 64

    def __init__(self, device: int, registers: RegisterMap, plant: TwinPlant, index: int, table: DriveTable):
        super().__init__(device, registers, extra=((registers.word["control"], 1), (registers.word["auxiliary"], 1)))
        self._plant, self._index, self._table = plant, index, table
        self._zero = table.zero_counts
        self.alarm = 0
        self._profile = self._target = self._counts()
        self._speed = 0.0  # counts/s
        self._top, self._acceleration = 0.0, 1.0
        self._going = self._homed = False

    def _counts(self) -> float:
        return self._zero + self._table.counts_per_m * self._plant.actuator(self._index)

    def fill(self) -> dict[int, int]:
        status = self.FAULT if self.alarm else self.ENABLED
        status |= self.RUNNING if self._going else self.COMMAND_DONE | self.PATH_DONE
        status |= self.HOMED if self._homed else 0
        return {
            **self._place("status", "status", status), **self._place_count(self._counts()),
            **(self._place("alarm", "alarm", self.alarm) if "alarm" in self.map.block else {}),
        }  # fmt: skip

    def written(self, address: int, values: list[int], stored: Any) -> ExcCodes | None:
        word, command, path = self.map.word, self.map.command, self.map.block["path"]
        if address == word["auxiliary"] and values == [command["clear_alarm"]]:
            self.alarm = 0
        elif address == word["control"] and values == [command["quick_stop"]]:
            self._profile = self._target = self._counts()
            self._speed, self._going = 0.0, False
            self._plant.drive(self._index, self._plant.actuator(self._index))
        elif address == word["control"] and values == [command.get("set_zero")]:
            self._shift(-self._counts())
            self._homed = True
        elif path.address <= address and address + len(values) <= path.address + path.count:
            words = [stored(path.address + i) for i in range(path.count)]
            words[address - path.address : address - path.address + len(values)] = values
            return self._path(words)
        else:
            return ExcCodes.ILLEGAL_VALUE
        return None

    def _shift(self, counts: float) -> None:
        """Count from another zero."""
        self._zero += counts
        self._profile += counts
        self._target += counts

    def _path(self, words: list[int]) -> ExcCodes | None:
        path = self.map.block["path"]
        mode, position, speed, rise, trigger = (
            value_of(path, name, words) for name in ("mode", "position", "speed", "acceleration", "trigger")
        )
        if mode != self.map.command["absolute"] or not 1 <= speed <= 6000 or rise == 0:
            return ExcCodes.ILLEGAL_VALUE
        if trigger != self.map.command["trigger"] or self.alarm:
            return None
        self._target = position
        per_rpm = self._table.counts_per_rev / 60.0
        self._top, self._acceleration = speed * per_rpm, 1000.0 * per_rpm / (rise * 1e-3)
        self._going = True
        return None

    def step(self, t: float, step: int) -> None:
        """Move the profile a plant step of 0.01 s on, and the plant's actuator with it."""
        if not self._going or self.fault.kind == "stuck" or self.alarm:
            return
        dt, left = 0.01, self._target - self._profile
        brake = math.sqrt(2.0 * self._acceleration * abs(left))
        wanted = math.copysign(min(self._top, brake), left)
        change = self._acceleration * dt
        self._speed += min(max(wanted - self._speed, -change), change)
        if abs(left) <= max(abs(self._speed) * dt, 1.0):
            self._profile, self._speed = self._target, 0.0
            self._going = abs(self._target - self._counts()) > 1e-5 * abs(self._table.counts_per_m)
        else:
            self._profile += self._speed * dt
        self._plant.drive(self._index, (self._profile - self._zero) / self._table.counts_per_m)
