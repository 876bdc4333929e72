"""The ports between the flight software and whatever carries it: narrow protocols, one sample frame, a clock.

Every sensor port writes its newest sample into a slot of the frame, and every actuator how it does: the frame is a
preallocated float64 vector that belongs to the loop. A slot is [time, validity, value ...]: the time of the measurement
on the board's clock (s), a Validity, then the values in SI. Nothing is allocated to read, and the compiled autopilot
takes the frame as it is. A device that is unplugged in flight writes its validity and never raises; it raises when it
is opened.
"""

from collections.abc import Callable
from enum import IntEnum
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from glider.hal.recorder.schema import RecordSpec


class Validity(IntEnum):
    """What a sample is worth. Stored as a float in the frame."""

    MISSING = 0  # the device has not answered yet
    VALID = 1
    STALE = 2  # the last answer is older than the device's period allows
    FAULT = 3  # the device answers, but says that its value is wrong


class Slot(NamedTuple):
    """A port's place in the frame: start, names of its values and their units."""

    start: int
    names: tuple[str, ...]
    units: tuple[str, ...]

    @property
    def time(self) -> int:
        return self.start

    @property
    def validity(self) -> int:
        return self.start + 1

    @property
    def values(self) -> slice:
        return slice(self.start + 2, self.start + 2 + len(self.names))

    @property
    def all(self) -> slice:
        return slice(self.start, self.start + 2 + len(self.names))


class Condition(IntEnum):
    """How an actuator does. Stored as a float in the frame; one that does not answer lets its time grow old."""

    WELL = 0
    ALARM = 1  # its drive is in alarm, which is being cleared
    ALARM_KEPT = 2  # the alarm came back; kept still
    RETRYING = 3  # did not move when sent; tried again
    GIVEN_UP = 4  # did not move at any try; kept still
    WRONG_WAY = 5  # ran the wrong way; kept still
    MISCONFIGURED = 6  # refuses what it is asked: address, function or value


MAX_AGE_PERIODS = 3.0  # a sample older than so many of its sensor's periods is stale: for drivers, twins and autopilot

# An actuator that does not move when sent: tried again so often, so long apart. The supervisor counts by its draw-wire,
# a driver by its own count, for it has to act alone at the bench.
STALL_TRIES, STALL_REST_S = 2, 1.0

# Where each slot begins: plain integers, because the kernels freeze them.
IMU, BEACON, SLIDER_WIRE, PLUNGER_WIRE, LEAK, BATTERY = 0, 8, 12, 15, 18, 21
SERVO, SLIDER, BALLAST = 24, 27, 30
FRAME_SIZE = 33

SLOTS = {
    "imu": Slot(IMU, ("roll", "pitch", "yaw", "p", "q", "r"), ("rad",) * 3 + ("rad/s",) * 3),
    "beacon": Slot(BEACON, ("pressure", "temperature_c"), ("Pa", "deg C")),
    "slider_wire": Slot(SLIDER_WIRE, ("slider",), ("m",)),
    "plunger_wire": Slot(PLUNGER_WIRE, ("plunger",), ("m",)),
    "leak": Slot(LEAK, ("wet",), ("1",)),
    "battery": Slot(BATTERY, ("voltage",), ("V",)),
    "servo": Slot(SERVO, ("condition",), ("1",)),
    "slider": Slot(SLIDER, ("condition",), ("1",)),
    "ballast": Slot(BALLAST, ("condition",), ("1",)),
}
ACTUATORS = tuple(name for name, slot in SLOTS.items() if slot.names == ("condition",))
SENSORS = tuple(name for name in SLOTS if name not in ACTUATORS)


def empty_frame() -> np.ndarray:
    """A frame in which every sample is missing, shape (FRAME_SIZE,)."""
    frame = np.full(FRAME_SIZE, np.nan)
    for slot in SLOTS.values():
        frame[slot.validity] = Validity.MISSING
    return frame


@runtime_checkable
class SensorPort(Protocol):
    """A sensor: IMU (roll, pitch, yaw, p, q, r), beacon (pressure, temperature), a draw-wire, leak, battery."""

    def read(self, out: np.ndarray) -> None:
        """Write the newest sample [time, validity, values ...] into `out`, the port's slot of the frame."""


@runtime_checkable
class ActuatorPort(Protocol):
    """Servo (rad), slider (m) or ballast pump (kg of net mass, from which the driver makes plunger travel)."""

    limits: tuple[float, float]  # of what is sent, in the port's unit: the vehicle's range within the device's own

    def command(self, value: float) -> float:
        """Ask for a position; returns what was really sent after the device's own limits. NaN changes nothing."""

    def read(self, out: np.ndarray) -> None:
        """Write [time of its last answer, validity, Condition] into `out`, the actuator's slot of the frame."""


@runtime_checkable
class Clock(Protocol):
    """Time is a device too: real, or simulated and then moved by whoever waits."""

    def now(self) -> float:
        """Seconds since the board was opened, never running back."""

    def sleep_until(self, deadline: float) -> None:
        """Wait until `deadline` on this clock."""


@runtime_checkable
class DropWeight(Protocol):
    def release(self) -> None:
        """Let the drop weight go. Cannot be taken back."""


@runtime_checkable
class OutOfBand(Protocol):
    def ascend(self) -> None:
        """Have the out-of-band process take the pump and bring the vehicle up. Cannot be taken back."""


@runtime_checkable
class HardwareWatchdog(Protocol):
    def feed(self) -> None:
        """Hold off the hardware watchdog for one more of its periods."""


class Hardware(IntEnum):
    """What a board's ports lead to."""

    NONE = 0  # a simulated vehicle: no devices, nothing to keep alive
    TWINNED = 1  # the real drivers, in front of twins that the board starts: nothing real moves
    REAL = 2


class Ports(Protocol):
    """What the loop flies by. Optional devices are None."""

    loop_hz: float
    out_of_band: OutOfBand | None

    @property
    def hardware(self) -> Hardware: ...
    @property
    def clock(self) -> Clock: ...
    @property
    def imu(self) -> SensorPort: ...
    @property
    def beacon(self) -> SensorPort: ...
    @property
    def slider_wire(self) -> SensorPort: ...
    @property
    def plunger_wire(self) -> SensorPort: ...
    @property
    def leak(self) -> SensorPort | None: ...
    @property
    def battery(self) -> SensorPort | None: ...
    @property
    def servo(self) -> ActuatorPort: ...
    @property
    def slider(self) -> ActuatorPort: ...
    @property
    def ballast(self) -> ActuatorPort: ...
    @property
    def drop_weight(self) -> DropWeight | None: ...


class Board(Ports, Protocol):
    """A vehicle's hardware, or what stands in for it."""

    name: str
    surface_pressure: float  # Pa, absolute, where depth is zero: as filed, then as measured at arming
    armed_depth: float  # m, of the beacon below the surface when the vehicle is armed; 0: in air or awash
    periods: dict[str, float]  # s between two samples: imu, beacon, wires (the slower of both); leak, battery if fitted

    @property
    def watchdog(self) -> HardwareWatchdog | None: ...
    @property
    def records(self) -> tuple[RecordSpec, ...]:
        """What it records beside the ticks."""

    def recording(self, channel: Callable[[str], Any]) -> tuple[Callable[[float], None], ...]:
        """Functions of time that record it, once a tick, on an open board; `channel(topic)` is where to."""

    def open(self) -> None:
        """Open the devices; raises BoardError naming the device that does not answer."""

    def check_calibration(self) -> str:
        """Whose the calibration is, in words; raises BoardError where it is not the one accepted."""

    def silent(self) -> list[str]:
        """A line for each device that gives nothing, or nothing good."""

    def health(self) -> dict[str, dict[str, Any]]:
        """How every device does, by its place on the board: counts, what is wrong now, what has changed."""

    def state(self) -> dict[str, float]:
        """Where the plant behind it truly is (x_m, y_m, z_m, servo_rad, slider_m, ballast_kg); empty on a real one."""

    def close(self, *, stop: bool = False) -> None:
        """Close the devices; actuators hold, or go on to, where they were sent last, or `stop` where they stand. Never
        raises; twice does no harm."""


class BoardError(RuntimeError):
    """A board or one of its devices cannot be used; str() names the device and what is wrong."""
