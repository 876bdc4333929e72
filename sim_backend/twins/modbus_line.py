"""A Modbus line's twin: pymodbus's own serial server answers, and between it and the outer port stands the wire.

The wire has the line's speed, the devices' turnaround, and their faults. Only whole requests for devices that are there
reach the server: pymodbus 3.16 answers for those that are not.
"""

import asyncio
import contextlib
import os
import random
from collections import deque
from pathlib import Path

from pymodbus.server import ModbusSerialServer

from hal.boardfile import PortTable
from hal.protocols.modbus import ERROR, RtuDecoder, with_check_sum
from sim_backend.twins.faults import Fault
from sim_backend.twins.line import Line, open_pty
from sim_backend.twins.modbus_devices import RegisterTwin

TURNAROUND_S = 0.002


class ModbusTwin:
    """A line with its devices."""

    def __init__(self, link: Path, port: PortTable, devices: list[RegisterTwin], rng: random.Random):
        self.devices = {device.device: device for device in devices}
        self.line = Line(link, port.baud, self._received)
        self._rng = rng
        self._requests = RtuDecoder(requests=True)
        self._replies = RtuDecoder()
        self._waiting: deque[RegisterTwin] = deque()
        self._inner = self._inner_slave = -1
        self._server: ModbusSerialServer | None = None

    async def start(self) -> None:
        """Start pymodbus's server on a line of its own, and plug the outer one in."""
        self._inner, self._inner_slave, path = open_pty()
        self._server = ModbusSerialServer(
            [device.sim for device in self.devices.values()], port=path, baudrate=self.line.baud
        )
        await self._server.serve_forever(background=True)
        asyncio.get_running_loop().add_reader(self._inner, self._answered)
        self.line.plug()

    async def stop(self) -> None:
        self.line.unplug()
        asyncio.get_running_loop().remove_reader(self._inner)
        if self._server is not None:
            await self._server.shutdown()
        for fd in (self._inner, self._inner_slave):
            with contextlib.suppress(OSError):
                os.close(fd)

    def _received(self, data: bytes) -> None:
        """Requests from outside, on to the server."""
        for frame in self._requests.feed(data):
            device = self.devices.get(frame.device)
            if device is None or device.fault.kind in ("silent", "babble"):
                continue
            self._waiting.append(device)
            os.write(self._inner, frame.raw)

    def _answered(self) -> None:
        """The server's replies, out on the wire."""
        try:
            data = os.read(self._inner, 4096)
        except OSError:
            return
        for frame in self._replies.feed(data):
            if self._waiting:
                self._reply(self._waiting.popleft().fault, frame.raw)

    def _reply(self, fault: Fault, raw: bytes) -> None:
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
