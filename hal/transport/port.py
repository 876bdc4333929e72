"""A serial port that never makes anyone wait. pyserial opens it and sets it up; bytes go past pyserial, to the
descriptor.

pyserial reports an unplugged device as SerialException, OSError or termios.error, depending on the call: here it is
always Unplugged. Reading is for when the port is known to be readable.
"""

import contextlib
import os
import termios

import serial

CHUNK = 1024  # bytes taken at once


class Unplugged(Exception):
    """The port is not there, or not any more; str() says what the system said."""


class Busy(Unplugged):
    """Another program holds the port."""


class SerialPort:
    """8N1, exclusive, without waiting."""

    exclusive = True

    def __init__(self, path: str, baud: int):
        self.path, self.baud = path, baud
        self.fd = -1
        self._serial: serial.Serial | None = None

    def open(self) -> None:
        """Open the port; Unplugged, or Busy, says why not."""
        if not os.path.exists(self.path):  # quick: asked again and again in flight
            raise Unplugged(f"{self.path}: not there")
        try:
            port = serial.Serial(self.path, self.baud, timeout=0, write_timeout=0, exclusive=self.exclusive)
        except (serial.SerialException, OSError, termios.error, ValueError) as error:
            kind = Busy if "exclusively lock" in str(error) else Unplugged
            raise kind(f"{self.path}: {_reason(error)}") from None
        with contextlib.suppress(OSError, ValueError, NotImplementedError, termios.error):
            port.set_low_latency_mode(True)  # FTDI adapters; others have none
        self._serial, self.fd = port, port.fileno()

    def read(self) -> bytes:
        """What has arrived, at most CHUNK bytes; the port has to be readable."""
        try:
            data = os.read(self.fd, CHUNK)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise Unplugged(f"{self.path}: {error.strerror}") from None
        if not data:
            raise Unplugged(f"{self.path}: hung up")
        return data

    def write(self, data: bytes) -> int:
        """Hand over as many bytes as the system takes now."""
        try:
            return os.write(self.fd, data)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise Unplugged(f"{self.path}: {error.strerror}") from None

    def close(self) -> None:
        """Close; whatever the port says to that is of no interest any more."""
        if self._serial is not None:
            with contextlib.suppress(serial.SerialException, OSError, termios.error):
                self._serial.close()
        self._serial, self.fd = None, -1


def _reason(error: Exception) -> str:
    text = getattr(error, "strerror", None) or str(error)
    return "held by another program" if "exclusively lock" in text else text.removeprefix("[Errno ").strip()
