"""Twins of the devices with a line of their own: IMU and servo board."""

import asyncio
import math
import random
from pathlib import Path

from glider.firmware.core.vehicle.layout import GRAVITY
from glider.hal.boardfile import ImuTable, PortTable, ServoTable
from glider.hal.drivers.vn100 import euler, rotation
from glider.hal.protocols import maestro, vn100
from glider.sim_backend.twins.faults import TwinFault
from glider.sim_backend.twins.line import Line
from glider.sim_backend.twins.plant import CMD_SERVO, TwinPlant

MODEL = "VN-100T-CR"
DEAD_MAN_S = 1.0  # the servo board's serial timeout


class Vn100Twin:
    """Answers commands and streams binary output at the rate set, the plant's attitude and rates in it."""

    def __init__(self, link: Path, port: PortTable, table: ImuTable, plant: TwinPlant, rng: random.Random):
        self.fault = TwinFault()
        self.line = Line(link, port.baud, self._received)
        self._plant, self._rng = plant, rng
        self._R_db = rotation(*(math.radians(angle) for angle in table.mount_deg)).T
        self._decoder = vn100.Vn100Decoder()
        self._mask, self._divisor, self._ascii = 0, 0, 14
        self._last: bytes = b""

    def _received(self, data: bytes) -> None:
        for message in self._decoder.feed(data):
            if isinstance(message, vn100.TextMessage) and self.fault.kind != "silent":
                self._answer(message)

    def _answer(self, message: vn100.TextMessage) -> None:
        fields = message.fields
        if message.header == "VNRRG" and fields == ("01",):
            reply = f"VNRRG,01,{MODEL}"
        elif message.header == "VNWRG" and len(fields) == 2 and fields[0] == "06" and fields[1].isdigit():
            self._ascii, reply = int(fields[1]), f"VNWRG,06,{fields[1]}"
        elif message.header == "VNWRG" and len(fields) == 5 and fields[0] == "75" and fields[2].isdigit():
            self._divisor = int(fields[2])
            self._mask = int(fields[4], 16) & 0x7FFF
            reply = "VNWRG," + ",".join(fields)
        else:
            reply = "VNERR,09"  # invalid register
        self.line.send(vn100.encode_text(reply))

    def step(self, t: float, step: int) -> None:
        """A plant step has been made: send what is due."""
        if self.fault.kind == "babble" or not self.line.plugged:
            return
        every = max(1, round(self._divisor / 8)) if self._divisor else 1  # of the plant's 100 Hz
        if step % every:
            return
        frame = b""
        if self._mask == vn100.FLIGHT_MASK:
            frame = self._binary(t)
        elif self._ascii == 14 and step % 5 == 0:
            frame = self._text()
        if frame:
            self._send(frame)

    def _values(self) -> tuple[tuple[float, float, float], tuple[float, ...]]:
        """Roll, pitch, yaw (deg) and rates (rad/s) of the sensor as it is mounted."""
        roll, pitch, yaw, *rates = self._plant.imu()
        R_nd = rotation(roll, pitch, yaw) @ self._R_db.T
        angles = tuple(math.degrees(angle) for angle in euler(R_nd))
        return angles, tuple((self._R_db @ rates).tolist())  # type: ignore[return-value]

    def _binary(self, t: float) -> bytes:
        (roll, pitch, yaw), rates = self._values()
        if self.fault.kind == "nan":
            roll = pitch = yaw = math.nan
        gravity = (rotation(math.radians(roll), math.radians(pitch), 0.0).T @ (0.0, 0.0, -GRAVITY)).tolist()
        return vn100.encode_binary(vn100.FLIGHT_MASK, int(t * 1e9), yaw, pitch, roll, *rates, *gravity)

    def _text(self) -> bytes:
        (roll, pitch, yaw), rates = self._values()
        numbers = ",".join(f"{angle:+08.3f}" for angle in (yaw, pitch, roll))
        rest = ",".join(f"{value:+010.6f}" for value in rates)
        return vn100.encode_text(f"VNYMR,{numbers},+00.2000,+00.0000,+00.4000,+00.000,+00.000,-09.807,{rest}")

    def _send(self, frame: bytes) -> None:
        kind, value = self.fault.kind, self.fault.value
        if kind == "stuck":
            frame = self._last or frame
        self._last = frame
        if kind == "silent":
            return
        if kind == "bad_crc":
            frame = frame[:-1] + bytes((frame[-1] ^ 0xFF,))
        if kind == "noise" and self._rng.random() < value:
            frame = self._rng.randbytes(self._rng.randrange(1, 20)) + frame
        self.line.send(frame, value if kind == "late" else 0.0)


class MaestroTwin:
    """Takes targets, keeps an error word, and goes home when nobody has spoken for a while."""

    def __init__(self, link: Path, port: PortTable, table: ServoTable, plant: TwinPlant, rng: random.Random):
        self.fault = TwinFault()
        self.line = Line(link, port.baud, self._received)
        self._table, self._plant, self._rng = table, plant, rng
        number = 12 if table.number is None else table.number
        self._decoder = maestro.CommandDecoder(number, table.crc)
        self._pulses = {table.channel: round(4 * table.zero_us)}
        self._heard_at: float | None = None

    def _received(self, data: bytes) -> None:
        for command in self._decoder.feed(data):
            self._heard_at = asyncio.get_running_loop().time()
            if command.code == maestro.SET_TARGET:
                self._target(command.data[0], command.value)
            elif command.code == maestro.GO_HOME:
                self._target(self._table.channel, 0)
            elif maestro.COMMANDS[command.code][1]:
                self._reply(command)

    def _target(self, channel: int, quarter_us: int) -> None:
        self._pulses[channel] = quarter_us
        if channel != self._table.channel or self.fault.kind == "stuck":
            return
        self._plant.first_command()
        if quarter_us:  # 0: no pulses, the servo stays where it is
            self._plant.commands[CMD_SERVO] = (quarter_us / 4.0 - self._table.zero_us) / self._table.us_per_rad

    def _reply(self, command: maestro.Command) -> None:
        if command.code == maestro.GET_ERRORS:
            reply = int(self._decoder.errors).to_bytes(2, "little")
            self._decoder.errors = maestro.MaestroError(0)
        elif command.code == maestro.GET_POSITION:
            reply = self._pulses.get(command.data[0], 0).to_bytes(2, "little")
        else:
            reply = b"\x00"
        kind, value = self.fault.kind, self.fault.value
        if kind in ("silent", "babble"):
            return
        if kind in ("bad_crc", "wrong_id", "nan"):
            reply = b"\xff\xff"  # replies carry no check: a word with bits that no error has
        if kind == "noise" and self._rng.random() < value:
            reply = self._rng.randbytes(self._rng.randrange(1, 4)) + reply
        self.line.send(reply, value if kind == "late" else 0.0005)

    def step(self, t: float, step: int) -> None:
        """The dead-man: no command for DEAD_MAN_S, no pulses."""
        if self._heard_at is not None and asyncio.get_running_loop().time() - self._heard_at > DEAD_MAN_S:
            self._heard_at = None
            self._decoder.errors |= maestro.MaestroError.TIMEOUT
            self._pulses[self._table.channel] = 0
