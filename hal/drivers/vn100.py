"""IMU: a VN-100 on a port of its own, streaming binary output; turned into the vehicle's axes by how it is mounted."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from glider.hal.boardfile import ImuTable, PortTable
from glider.hal.drivers.samples import Sensor
from glider.hal.ports import SLOTS
from glider.hal.protocols import vn100
from glider.hal.units import BITS

ASK_AGAIN_S = 1.0
PI = math.pi


def rotation(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """R_nb of ZYX Euler angles, (3, 3)."""
    cr, sr, cp, sp, cy, sy = (
        math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch), math.cos(yaw), math.sin(yaw),
    )  # fmt: skip
    return np.array([
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ])  # fmt: skip


def euler(R: np.ndarray) -> tuple[float, float, float]:
    """Roll, pitch and yaw of R_nb."""
    return (
        math.atan2(R[2, 1], R[2, 2]), math.asin(min(max(-R[2, 0], -1.0), 1.0)), math.atan2(R[1, 0], R[0, 0]),
    )  # fmt: skip


def build(table: ImuTable, port: PortTable, vehicle: Any) -> "Vn100":
    """The driver of a board file's [imu]."""
    return Vn100(table, port.baud)


class Vn100(Sensor):
    """Sensor port and line handler in one. Sample times: arrival less time on the line and the file's delay."""

    def __init__(self, table: ImuTable, baud: int):
        rate = (-table.rate_limit_rad_s, table.rate_limit_rad_s)
        ranges = ((-PI, PI), (-PI / 2, PI / 2), (-PI, PI), rate, rate, rate)
        super().__init__("imu", SLOTS["imu"], 1.0 / table.rate_hz, ranges)
        self._delay = table.delay_s + BITS / baud * (6 + vn100.payload_size(vn100.FLIGHT_MASK))
        self._setup = vn100.encode_text("VNWRG,06,0") + vn100.encode_text(
            f"VNWRG,75,{table.output},{round(800.0 / table.rate_hz)},01,{vn100.FLIGHT_MASK:04X}"
        )
        level = table.mount_deg == (0.0, 0.0, 0.0)
        self._R_bd = None if level else rotation(*(math.radians(angle) for angle in table.mount_deg))
        self.decoder = vn100.Vn100Decoder()
        self._bad = 0
        self._send: Callable[[bytes], bool] = lambda data: False
        self._heard_at = self._asked_at = -math.inf

    def attach(self, send: Callable[[bytes], bool]) -> None:
        self._send = send

    def connected(self, now: float) -> None:
        self.decoder.reset()
        self._heard_at = self._asked_at = -math.inf

    def lost(self, now: float) -> None:
        self.decoder.reset()
        self.health.say(now, "port lost")

    def service(self, now: float) -> float:
        """Set the sensor up, and again whenever it has nothing to say; ask for its model until that is known."""
        silent = now - self._heard_at > ASK_AGAIN_S / 4
        if (silent or not self.model) and now - self._asked_at >= ASK_AGAIN_S:
            self._asked_at = now
            self._send(vn100.encode_text("VNRRG,01") + (self._setup if silent else b""))
        return (max(self._asked_at, self._heard_at) if self.model else self._asked_at) + ASK_AGAIN_S

    def feed(self, data: bytes, now: float) -> None:
        newest = None
        for message in self.decoder.feed(data):
            if isinstance(message, vn100.BinaryMessage):
                if message.mask == vn100.FLIGHT_MASK:
                    newest = message.values()[1:7]
            elif message.header == "VNYMR" and len(message.fields) == 12:
                numbers = message.numbers()
                newest = None if numbers is None else (*numbers[:3], *numbers[9:])
            elif message.header == "VNRRG" and message.fields[0] in ("01", "1"):
                self.model = ",".join(message.fields[1:])
        if self.decoder.bad > self._bad:
            self.damage(now, self.decoder.bad - self._bad)
            self._bad = self.decoder.bad
        if newest is not None:
            self._heard_at = now
            self.accept(now - self._delay, self._to_body(newest), now)

    def _to_body(self, values: tuple[float, ...]) -> tuple[float, ...]:
        """Yaw, pitch, roll in degrees and rates of the sensor as roll, pitch, yaw in rad and rates of the hull."""
        yaw, pitch, roll, p, q, r = values
        roll, pitch, yaw = math.radians(roll), math.radians(pitch), math.radians(yaw)
        if self._R_bd is None or not math.isfinite(roll + pitch + yaw + p + q + r):
            return roll, pitch, yaw, p, q, r
        R_bd = self._R_bd
        rates = R_bd @ (p, q, r)
        return *euler(rotation(roll, pitch, yaw) @ R_bd.T), *rates.tolist()
