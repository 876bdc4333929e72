"""Modbus RTU on pymodbus's framer and PDU classes: bytes in, events out; no port, no clock.

pymodbus builds, checks and reads the frames. What is added is the search for them: pymodbus's own decoder drops all
it has on a bad check sum, and waits on a length that garbage claims. RTU has no transaction number, so a Request says
exactly which reply it takes: device, function, length and, for writes, the echo.
"""

from typing import NamedTuple

from pymodbus.framer import FramerRTU
from pymodbus.pdu import DecodePDU, ExceptionResponse, ModbusPDU
from pymodbus.pdu.register_message import (
    ReadHoldingRegistersRequest,
    ReadInputRegistersRequest,
    WriteMultipleRegistersRequest,
    WriteSingleRegisterRequest,
)

READ_HOLDING, READ_INPUT, WRITE_ONE, WRITE_MANY = 3, 4, 6, 16
FUNCTIONS = (READ_HOLDING, READ_INPUT, WRITE_ONE, WRITE_MANY)
ERROR = 0x80  # added to the function in an exception reply
EXCEPTION_SIZE = 5
MAX_FRAME_BYTES = 256  # bytes, the standard's longest frame
_REQUESTS = FramerRTU(DecodePDU(True))
_REPLIES = FramerRTU(DecodePDU(False))


class Request(NamedTuple):
    """A request's frame and the only reply that answers it."""

    frame: bytes
    device: int
    function: int
    reply_size: int
    echo: bytes = b""  # what a write's reply repeats after the function

    @property
    def reply_signature(self) -> tuple[int, int, int, bytes]:
        """What its reply is recognised by; requests whose replies look alike are never sent while one may be late."""
        return self.device, self.function, self.reply_size, self.echo


class Frame(NamedTuple):
    """A frame that passed its check."""

    device: int
    function: int
    pdu: ModbusPDU
    raw: bytes

    @property
    def exception(self) -> int:
        """The exception code; 0 for a reply that is none."""
        return self.pdu.exception_code if isinstance(self.pdu, ExceptionResponse) else 0

    @property
    def registers(self) -> list[int]:
        return list(self.pdu.registers)


def _check(device: int, address: int, count: int, most: int) -> None:
    if not 1 <= device <= 247:
        raise ValueError(f"device {device}: expected 1 to 247")
    if not (address >= 0 and 1 <= count <= most and address + count <= 0x10000):
        raise ValueError(f"{count} registers from {address:#06x}: expected 1 to {most} within 0 to 0xffff")


def read(device: int, function: int, address: int, count: int) -> Request:
    """Read `count` holding (3) or input (4) registers."""
    _check(device, address, count, 125)
    kind = {READ_HOLDING: ReadHoldingRegistersRequest, READ_INPUT: ReadInputRegistersRequest}[function]
    frame = _REPLIES.buildFrame(kind(dev_id=device, address=address, count=count))
    return Request(frame, device, function, 2 * count + 5)


def write_one(device: int, address: int, value: int) -> Request:
    """Write one holding register."""
    _check(device, address, 1, 1)
    frame = _REPLIES.buildFrame(WriteSingleRegisterRequest(dev_id=device, address=address, registers=[value]))
    return Request(frame, device, WRITE_ONE, 8, frame[2:6])


def write_many(device: int, address: int, values: list[int]) -> Request:
    """Write holding registers in a row."""
    _check(device, address, len(values), 123)
    frame = _REPLIES.buildFrame(WriteMultipleRegistersRequest(dev_id=device, address=address, registers=values))
    return Request(frame, device, WRITE_MANY, 8, frame[2:6])


def check_sum_holds(frame: bytes) -> bool:
    """True if the last two bytes are the CRC-16 of the rest."""
    return FramerRTU.check_CRC(frame[:-2], frame[-2] << 8 | frame[-1])


def with_check_sum(body: bytes) -> bytes:
    """The frame of these bytes: device, function, data."""
    return body + FramerRTU.compute_CRC(body).to_bytes(2, "big")


def answers(frame: bytes, request: Request) -> bool:
    """True if a frame of the request's function has the length, or the echo, that its reply has."""
    if request.function in (READ_HOLDING, READ_INPUT):
        return frame[2] == request.reply_size - 5
    return frame[2:6] == request.echo


class RtuDecoder:
    """Finds frames in whatever comes. With `expect`, only the reply to that request and what else looks whole is
    not waited for; without, any frame of FUNCTIONS (a listener, a twin, a fuzzer)."""

    check_sum_holds = staticmethod(check_sum_holds)
    answers = staticmethod(answers)

    def __init__(self, *, requests: bool = False) -> None:
        self._framer = _REQUESTS if requests else _REPLIES
        self._requests = requests
        self._buffer = bytearray()
        self._wanted: Request | None = None
        self.good = self.bad = self.skipped = 0

    @property
    def pending(self) -> int:
        """Bytes kept for a frame that is not whole yet, fewer than MAX_FRAME_BYTES."""
        return len(self._buffer)

    def reset(self) -> None:
        """Forget what is unfinished."""
        self.skipped += len(self._buffer)
        self._buffer.clear()

    def expect(self, request: Request | None) -> None:
        """Take only what answers this request; None: take every frame."""
        self.reset()
        self._wanted = request

    def feed(self, data: bytes) -> list[Frame]:
        """Take bytes; the frames that they complete."""
        self._buffer += data
        buffer, at, end, events = bytes(self._buffer), 0, len(self._buffer), []
        while at < end:
            size = self.frame_size(buffer, at, end)
            if size == 0 or size > end - at:
                break
            event = self._whole(buffer[at : at + size]) if size > 0 else None
            if event is None:
                self.skipped += 1
                at += 1
                continue
            self.good += 1
            events.append(event)
            at += size
        del self._buffer[:at]
        return events

    def frame_size(self, buffer: bytes, at: int, end: int) -> int:
        """Bytes of the frame that may start here; 0: too few to say; -1: none does."""
        wanted = self._wanted
        if wanted is not None and buffer[at] != wanted.device:
            return -1
        if end - at < 2:
            return 0 if wanted is not None or 1 <= buffer[at] <= 247 else -1
        function = buffer[at + 1]
        if wanted is not None:
            if function == wanted.function | ERROR:
                return EXCEPTION_SIZE
            return wanted.reply_size if function == wanted.function else -1
        if function & ~ERROR not in FUNCTIONS or not 1 <= buffer[at] <= 247:
            return -1
        if function & ERROR:
            return -1 if self._requests else EXCEPTION_SIZE
        kind = self._framer.decoder.lookupPduClass(buffer[at : at + 2])
        size = kind.calculateRtuFrameSize(buffer[at : at + 8]) if kind is not None else -1
        return size if size <= MAX_FRAME_BYTES else -1

    def _whole(self, frame: bytes) -> Frame | None:
        """The frame, if its check sum holds, pymodbus can read it, and it is the one expected."""
        if not self.check_sum_holds(frame):
            self.bad += 1
            return None
        wanted = self._wanted
        if wanted is not None and not frame[1] & ERROR and not self.answers(frame, wanted):
            return None
        pdu = self._framer.decoder.decode(frame[1:-2])
        if pdu is None:
            self.bad += 1
            return None
        pdu.dev_id = frame[0]
        return Frame(frame[0], frame[1], pdu, frame)
