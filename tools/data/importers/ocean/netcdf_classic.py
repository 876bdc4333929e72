"""How long a classic NetCDF file (versions 1, 2 and 5) is by its own header: a cut one is shorter.

The format's grammar, "The NetCDF Classic Format Specification": magic, numrecs, dimensions, attributes, variables.
"""

import math
import struct

_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 4, 6: 8, 7: 1, 8: 2, 9: 4, 10: 8, 11: 8}  # bytes of a type


class _Header:
    def __init__(self, data: bytes):
        self.data, self.at, self.version = data, 4, data[3]

    def number(self, bytes_: int) -> int:
        """An unsigned integer, big-endian; struct.error where the header ends before it."""
        (found,) = struct.unpack_from(">I" if bytes_ == 4 else ">Q", self.data, self.at)
        self.at += bytes_
        return found

    def count(self) -> int:
        """A number of things: of four bytes, in version 5 of eight."""
        return self.number(8 if self.version == 5 else 4)

    def skip(self, bytes_: int) -> None:
        """Pass over bytes and the padding to a multiple of four."""
        self.at += bytes_ + -bytes_ % 4

    def skip_attributes(self) -> None:
        """Pass over a list of attributes."""
        self.number(4)
        for _ in range(self.count()):
            self.skip(self.count())
            size = _SIZES[self.number(4)]
            self.skip(size * self.count())


def classic_size(data: bytes) -> int:
    """Bytes of the whole file that begins with `data`; struct.error, KeyError or IndexError where it is no header."""
    header = _Header(data)
    records = header.count()
    header.number(4)
    dimensions = []
    for _ in range(header.count()):
        header.skip(header.count())
        dimensions.append(header.count())
    header.skip_attributes()
    header.number(4)
    end, record_size, record_begin, record_sizes = 0, 0, 0, []
    for _ in range(header.count()):
        header.skip(header.count())
        shape = [dimensions[header.count()] for _ in range(header.count())]
        header.skip_attributes()
        item = _SIZES[header.number(4)]
        header.count()
        begin = header.number(4 if header.version == 1 else 8)
        if shape and shape[0] == 0:
            record_sizes.append(item * math.prod(shape[1:]))
            record_begin = max(record_begin, begin)
        else:
            end = max(end, begin + item * math.prod(shape))
    # Records are padded to four bytes each variable, but where there is one variable alone.
    padded = [size + -size % 4 for size in record_sizes] if len(record_sizes) > 1 else record_sizes
    record_size = sum(padded)
    if record_sizes and records:
        end = max(end, record_begin + (records - 1) * record_size + record_sizes[-1])
    return max(end, header.at)
