"""A Modbus line's twin: pymodbus's own serial server answers, and between it and the outer port stands the wire.

The wire has the line's speed, the devices' turnaround, and their faults. Only whole requests for devices that are there
reach the server: pymodbus answers for those that are not. They reach it in memory, one after the other, as through
the null modem that pymodbus has for its own tests: a pseudo-terminal between would cost more than the server.
"""

import asyncio
import random
from collections import deque
from collections.abc import Callable
from pathlib import Path

from pymodbus.server import ModbusSerialServer
from pymodbus.transport import ModbusProtocol

from glider.hal.boardfile import PortTable
from glider.hal.protocols.modbus import ERROR, RtuDecoder, with_check_sum
from glider.sim_backend.twins.faults import TwinFault
from glider.sim_backend.twins.line import Line
from glider.sim_backend.twins.modbus_devices import RegisterTwin

TURNAROUND_S = 0.002


class Within(asyncio.Transport):
    """What a handler writes to."""

    def __init__(self, written: Callable[[bytes], None]):
        super().__init__()
        self._written = written

    def write(self, data: bytes | bytearray | memoryview) -> None:
        self._written(bytes(data))

    def close(self) -> None:
        """Nothing is open."""


class ModbusTwin:
    """A line with its devices."""

    def __init__(self, link: Path, port: PortTable, devices: list[RegisterTwin], rng: random.Random):
        self.devices = {device.device: device for device in devices}
        self.line = Line(link, port.baud, self._received)
        self._rng = rng
        self._requests = RtuDecoder(requests=True)
        self._waiting: deque[tuple[RegisterTwin, bytes]] = deque()
        self._server: ModbusSerialServer | None = None
        self._handler: ModbusProtocol | None = None

    async def start(self) -> None:
        """Make pymodbus's server, connect to it, and plug the line in."""
        self._server = ModbusSerialServer(
            [device.sim for device in self.devices.values()], port=str(self.line.link), baudrate=self.line.baud
        )
        self._handler = self._server.callback_new_connection()
        self._handler.connection_made(Within(self._answered))
        self.line.plug()

    async def stop(self) -> None:
        self.line.unplug()
        if self._server is not None and self._handler is not None:
            self._handler.close()
            await self._server.shutdown()

    def _received(self, data: bytes) -> None:
        """Requests from outside, on to the server."""
        for frame in self._requests.feed(data):
            device = self.devices.get(frame.device)
            if device is None or device.fault.kind in ("silent", "babble"):
                continue
            self._waiting.append((device, frame.raw))
            if len(self._waiting) == 1:
                self._ask(frame.raw)

    def _ask(self, raw: bytes) -> None:
        assert self._handler is not None
        self._handler.data_received(raw)

    def _answered(self, reply: bytes) -> None:
        """The server's reply, a frame, out on the wire; then the next request."""
        device, _ = self._waiting.popleft()
        self._reply(device.fault, reply)
        if self._waiting:
            self._ask(self._waiting[0][1])

    def _reply(self, fault: TwinFault, raw: bytes) -> None:
        kind, value = fault.kind, fault.value
        if kind == "wrong_id":
            raw = with_check_sum(bytes((raw[0] % 247 + 1,)) + raw[1:-2])
        elif kind == "bad_crc":
            raw = raw[:-1] + bytes((raw[-1] ^ 0xFF,))
        elif kind == "exception":
            raw = with_check_sum(bytes((raw[0], raw[1] & ~ERROR | ERROR, int(value))))
        elif kind == "noise" and self._rng.random() < value:
            raw = self._rng.randbytes(self._rng.randrange(1, 8)) + raw + self._rng.randbytes(2)
        self.line.send(raw, TURNAROUND_S + (value if kind == "late" else 0.0))

    def step(self, t: float, step: int) -> None:
        for device in self.devices.values():
            device.step(t, step)
