"""The twins of a board, moved by the plant in real time, with a line of commands for faults.

`python -m glider.sim_backend.twins.service` is how a flight starts them: a line of JSON on standard input says
what, a line of JSON on standard output says that they are there, and the end of standard input ends them.
"""

import asyncio
import contextlib
import json
import math
import os
import random
import stat
import sys
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import msgspec

from glider.firmware.model.vehicle import Vehicle
from glider.hal import boardfile
from glider.hal.strict import ConfigError
from glider.sim_backend.twins.boardfile import TwinFile, decode_twin_file
from glider.sim_backend.twins.faults import FaultError, TwinFault, parse_fault
from glider.sim_backend.twins.modbus_devices import AnalogTwin, DriveTwin, EncoderTwin, PressureTwin, RegisterTwin
from glider.sim_backend.twins.modbus_line import ModbusTwin
from glider.sim_backend.twins.plant import CMD_BALLAST, CMD_SLIDER, TwinPlant
from glider.sim_backend.twins.serial_devices import MaestroTwin, Vn100Twin

LINE_TWINS = {"vn100": Vn100Twin, "maestro": MaestroTwin}  # by the names of glider.hal.boardfile.DRIVERS
STEP_S = 0.01
FALL_BEHIND_S = 1.0  # past which the plant's time stands rather than runs after the clock
HELP = (
    "fault DEVICE KIND [NUMBER]; pose ROLL PITCH YAW DEPTH (deg, m); release; alarm slider|ballast CODE; leak 0|1; "
    "battery VOLTS; state; adrift SECONDS (depth so long from now, nobody at the controls); quit"
)


class TwinService:
    """All twins of one board file, in a folder of named ports."""

    def __init__(self, file: TwinFile, source: str, vehicle: Any, folder: Path, seed: int, *, let_go: bool = True):
        self.file, self.folder = file, folder
        self.plant = TwinPlant(vehicle, file.environment, file.start, seed, file.effects, let_go=let_go)
        self.slips = 0
        self._rng = random.Random(seed)
        self._stopping = asyncio.Event()
        self.imu, self.servo = (self._line_twin(name, source) for name in boardfile.DRIVERS)
        self.registers: dict[str, RegisterTwin] = {}  # by place on the board
        self._modules: dict[tuple[str, int], AnalogTwin] = {}
        self.drives: dict[str, DriveTwin] = {}
        for name in boardfile.ROLES:
            if getattr(file, name) is not None:
                self.registers[name] = self._register_twin(name, source)
        self._devices: dict[str, Any] = {"imu": self.imu, "servo": self.servo, **self.registers}  # by place
        self.modbus = {
            port: self._modbus_twin(port) for port in file.port if port not in (file.imu.port, file.servo.port)
        }

    def _line_twin(self, name: str, source: str) -> Any:
        table = getattr(self.file, name)
        if table.device not in LINE_TWINS:
            raise ConfigError(source, f"'{table.device}' has no twin", key=f"{name}.device")
        line = self.file.port[table.port]
        return LINE_TWINS[table.device](self.folder / table.port, line, table, self.plant, self._rng)

    def _register_twin(self, name: str, source: str) -> RegisterTwin:
        table, found = getattr(self.file, name), boardfile.preset_of(self.file, name, source)
        if found.role == "pressure":
            return PressureTwin(table.id, found, self.plant, table.zero_pa)
        if found.role == "encoder":
            return EncoderTwin(table.id, found, self.plant, name, table)
        if found.role == "drive":
            index = CMD_SLIDER if name == "slider" else CMD_BALLAST
            self.drives[name] = DriveTwin(table.id, found, self.plant, index, table)
            return self.drives[name]
        module = self._modules.setdefault((table.port, table.id), AnalogTwin(table.id, found, self.plant))
        module.add(name, table)
        return module

    def _modbus_twin(self, port: str) -> ModbusTwin:
        on = {twin.device: twin for name, twin in self.registers.items() if getattr(self.file, name).port == port}
        return ModbusTwin(self.folder / port, self.file.port[port], list(on.values()), self._rng)

    def line_of(self, device: str) -> Any:
        """The line that a device is on."""
        twin = getattr(self, device, None) if device in ("imu", "servo") else None
        return twin.line if twin is not None else self.modbus[getattr(self.file, device).port].line

    def device(self, name: str) -> Any:
        """A device's twin by its place on the board; FaultError for another name."""
        if name not in self._devices:
            raise FaultError(f"no device '{name}'; there are {', '.join(self._devices)}")
        return self._devices[name]

    # --- running ----------------------------------------------------------------------------------------------------
    async def run(self, ready: Callable[[], None]) -> None:
        """Start everything, say so, and run until stop()."""
        for line in (self.imu.line, self.servo.line):
            line.plug()
        for twin in self.modbus.values():
            await twin.start()
        server = await asyncio.start_unix_server(self._client, self.folder / "control")
        ready()
        try:
            await self._move()
        finally:
            server.close()
            for line in (self.imu.line, self.servo.line):
                line.unplug()
            for twin in self.modbus.values():
                await twin.stop()
            with contextlib.suppress(FileNotFoundError):
                (self.folder / "control").unlink()

    def stop(self) -> None:
        self._stopping.set()

    async def _move(self) -> None:
        """The plant and all twins, step by step, on absolute deadlines."""
        loop = asyncio.get_running_loop()
        begin, step = loop.time(), 0
        twins: tuple[Any, ...] = (self.imu, self.servo, *self.modbus.values())
        while not self._stopping.is_set():
            step += 1
            self.plant.step()
            for twin in twins:
                twin.step(self.plant.time, step)
            self._babble()
            wait = begin + step * STEP_S - loop.time()
            if wait < -FALL_BEHIND_S:
                begin -= wait
                self.slips += 1
            await asyncio.sleep(max(wait, 0.0))

    def _babble(self) -> None:
        for name, device in self._devices.items():
            if device.fault.kind == "babble":
                line = self.line_of(name)
                line.send(self._rng.randbytes(int(line.baud / 10 * STEP_S)))

    # --- commands ---------------------------------------------------------------------------------------------------
    def command(self, text: str) -> str:
        """One command; its answer, which begins with 'error: ' where it could not be done."""
        words = text.split()
        try:
            return self._command(words)
        except (FaultError, ValueError, IndexError, KeyError) as error:
            what = str(error) if isinstance(error, FaultError) else f"not understood; {HELP}"
            return f"error: {what}"

    def _command(self, words: list[str]) -> str:
        verb, rest = words[0], words[1:]
        if verb == "help":
            return HELP
        if verb == "fault":
            self._fault(rest[0], parse_fault(" ".join(rest[1:])))
        elif verb == "pose":
            roll, pitch, yaw, depth = (float(word) for word in rest)
            self.plant.pose(math.radians(roll), math.radians(pitch), math.radians(yaw), depth)
        elif verb == "release":
            self.plant.release()
        elif verb == "alarm":
            self.drives[rest[0]].alarm = int(rest[1])
        elif verb in ("leak", "battery"):
            self._input(verb, float(rest[0]))
        elif verb == "state":
            return json.dumps({**self.plant.state(), "slips": self.slips})
        elif verb == "adrift":
            return json.dumps({"z_m": self.plant.world.adrift(float(rest[0]))})
        elif verb == "quit":
            self.stop()
        else:
            raise ValueError(verb)
        return "ok"

    def _fault(self, name: str, fault: TwinFault) -> None:
        device, line = self.device(name), self.line_of(name)
        if fault.kind == "unplug":
            line.unplug()
        else:
            line.plug()
        if isinstance(device, RegisterTwin) and fault.kind == "none":
            device.well()
        device.fault = fault

    def _input(self, name: str, value: float) -> None:
        table, module = getattr(self.file, name), self.registers[name]
        assert isinstance(module, AnalogTwin)
        if name == "battery":
            reading = value * table.per_volt
        else:
            reading = 20_000.0 if (value > 0) != table.inverted else 4_000.0
        module.channels[table.channel - 1] = reading

    async def _client(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(ConnectionError):
            while line := await reader.readline():
                if line.strip():
                    writer.write((self.command(line.decode("utf-8", "replace")) + "\n").encode())
                    await writer.drain()
        writer.close()

    async def obey_stdin(self, *, end_stops: bool, answer: Callable[[str], None] | None) -> None:
        """Commands from standard input; its end stops everything, if that is agreed."""
        async for line in _stdin_lines():
            said = self.command(line.decode("utf-8", "replace")) if line.strip() else ""
            if said and answer is not None:
                answer(said)
        if end_stops:
            self.stop()


async def _stdin_lines() -> AsyncIterator[bytes]:
    """Standard input, line by line: a pipe or terminal as it comes, a file at once."""
    kind = os.fstat(0).st_mode
    if not (stat.S_ISFIFO(kind) or stat.S_ISSOCK(kind) or os.isatty(0)):
        for line in sys.stdin.buffer:
            yield line
        return
    reader = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(
        lambda: asyncio.StreamReaderProtocol(reader), os.fdopen(os.dup(0), "rb", 0)
    )
    while line := await reader.readline():
        yield line


def replaced_ports(file: Any, folder: Path) -> Any:
    """A board file whose ports are those in the folder."""
    ports = {name: msgspec.structs.replace(table, path=str(folder / name)) for name, table in file.port.items()}
    return msgspec.structs.replace(file, port=ports)


async def _serve(config: dict) -> None:
    file = decode_twin_file(config["text"], config["source"])
    file = msgspec.structs.replace(file, effects={**file.effects, **config["effects"]})
    if file.environment.floor_m == 0.0 and config["site_depth"]:
        environment = msgspec.structs.replace(file.environment, floor_m=config["site_depth"])
        file = msgspec.structs.replace(file, environment=environment)
    vehicle = msgspec.convert(config["vehicle"], Vehicle)
    service = TwinService(file, config["source"], vehicle, Path(config["folder"]), config["seed"])
    service.plant.step()  # kernels are loaded before anyone waits

    def ready() -> None:
        os.write(1, b'{"ready": true}\n')

    stdin = asyncio.create_task(service.obey_stdin(end_stops=True, answer=None))
    await service.run(ready)
    stdin.cancel()


def main() -> None:
    with contextlib.suppress(AttributeError, OSError):  # under a real-time flight: below it, above all the rest
        if os.sched_getscheduler(0) == os.SCHED_FIFO:
            below = max(1, os.sched_getparam(0).sched_priority - 10)
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(below))
    line = b""
    while not line.endswith(b"\n"):  # unbuffered: what follows belongs to the commands
        byte = os.read(0, 1)
        if not byte:
            return
        line += byte
    asyncio.run(_serve(json.loads(line)))


if __name__ == "__main__":
    main()
