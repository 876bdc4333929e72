"""Numbers, texts, arrays and tuples of these between two processes: MessagePack, each message behind its length."""

import struct
from typing import IO, Any

import msgspec
import numpy as np

LENGTH = struct.Struct("<Q")


def send(to: IO[bytes], message: Any) -> None:
    """Write a message; OSError where the other end is closed."""
    text = msgspec.msgpack.encode(_plain(message))
    to.write(LENGTH.pack(len(text)) + text)
    to.flush()


def receive(by: IO[bytes]) -> Any:
    """The next message, arrays in it writable; EOFError where there is none."""
    head = by.read(LENGTH.size)
    text = by.read(*LENGTH.unpack(head)) if len(head) == LENGTH.size else b""
    if not text or len(text) < LENGTH.unpack(head)[0]:
        raise EOFError
    return _of_plain(msgspec.msgpack.decode(text))


def _plain(one: Any) -> Any:
    if isinstance(one, np.ndarray):
        return {"type": one.dtype.str, "shape": one.shape, "bytes": one.tobytes()}
    if isinstance(one, np.generic):
        return one.item()
    return [_plain(each) for each in one] if isinstance(one, tuple) else one


def _of_plain(one: Any) -> Any:
    if isinstance(one, dict):
        return np.ndarray(one["shape"], one["type"], bytearray(one["bytes"]))
    return tuple(_of_plain(each) for each in one) if isinstance(one, list) else one
