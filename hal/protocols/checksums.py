"""The check sums of the devices' protocols that no library at hand has."""

from functools import reduce
from operator import xor


def _crc7_table() -> bytes:
    """CRC-7 of every byte, polynomial 0x91 reflected (Pololu Maestro user's guide, section 5.d)."""
    table = bytearray(256)
    for byte in range(256):
        crc = byte
        for _ in range(8):
            crc = (crc ^ 0x91 if crc & 1 else crc) >> 1
        table[byte] = crc
    return bytes(table)


_CRC7 = _crc7_table()


def crc7(data: bytes) -> int:
    """CRC-7 of a Maestro command, 0-127."""
    crc = 0
    for byte in data:
        crc = _CRC7[crc ^ byte]
    return crc


def xor8(data: bytes) -> int:
    """All bytes exclusive-ored: the check sum of a VN-100 text message, of what stands between $ and *."""
    return reduce(xor, data, 0)
