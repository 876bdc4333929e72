"""Slocum binaries before they are read: headers, pairs of engineering and science files, header caches, cut files."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from glider.tools.data.errors import InputError
from glider.tools.data.files import require_file

ENCODING = "5"
# A line of a list of sensors: whether it is sent, its number, its place in a cycle, its bytes, name and unit.
SENSOR = re.compile(rb"s:\s+[TF]\s+\d+\s+-?\d+\s+[1248]\s+\w+\s+[!-~]+")
KNOWN_BYTES = 16  # the cycle of known bytes after the header: 's', 'a', 0x1234, a float, a double
MAX_FILE_BYTES = 512_000_000
# Engineering file, and the science file of the same segment; the second letter c: compressed.
PAIRS = {"dbd": "ebd", "mbd": "nbd", "sbd": "tbd", "dcd": "ecd", "mcd": "ncd", "scd": "tcd"}
ENGINEERING = frozenset(PAIRS)
SCIENCE = frozenset(PAIRS.values())


@dataclass
class Binary:
    """One binary, whole: its header; its bytes stay on disk, as a mission has many."""

    path: Path
    header: dict[str, str]
    ends_well: bool  # the mark of the end is there

    @property
    def kind(self) -> str:
        """dbd, ebd, ...: by the header, as files are renamed."""
        return self.header["filename_extension"].lower()

    @property
    def segment(self) -> str:
        """Which segment of which glider: 'name-year-day-mission-segment'."""
        return self.header["full_filename"]

    @property
    def glider(self) -> str:
        """The glider's name."""
        return self.segment.rsplit("-", 4)[0]


def check_binary(path: Path, caches: dict[str, Path]) -> Binary:
    """One file looked through to its end; InputError where it is none, is cut, or its header cache is not there."""
    data = unpacked(path)
    if not data:
        raise InputError("the file is empty", source=path)
    header, start = _header(path, data)
    crc, sensors = header["sensor_list_crc"].lower(), int(header["total_num_sensors"])
    if header["sensor_list_factored"] == "1":
        if crc not in caches:
            message = f"its list of sensors is in {crc}.cac, which is neither beside the files nor in --cache"
            raise InputError(message, source=path)
        source, lines = caches[crc], caches[crc].read_bytes().splitlines()
    else:
        source = path
        lines, start = _lines(path, data, start, sensors)
    sizes = _sizes(source, lines, sensors, int(header["sensors_per_cycle"]))
    ends_well = _walk(path, data, start, sizes, int(header["state_bytes_per_cycle"]))
    return Binary(path, header, ends_well)


def find_caches(paths: list[Path], folder: Path | None) -> dict[str, Path]:
    """Header caches by their sum: beside the files, in a folder `cache` or `Cache` there, and in the folder given."""
    folders = [*dict.fromkeys(path.parent for path in paths)]
    folders += [one / name for one in folders for name in ("cache", "Cache")] + ([folder] if folder else [])
    if folder is not None and not folder.is_dir():
        raise InputError("no such folder", source=folder)
    found = [path for one in folders if one.is_dir() for path in sorted(one.iterdir())]
    return {path.stem.lower(): path for path in found if path.suffix.lower() == ".cac"}


def in_pairs(binaries: list[Binary]) -> list[tuple[Binary, Binary]]:
    """Engineering and science file of each segment; InputError where one has no other, or is there twice."""
    engineering: dict[str, Binary] = {}
    science: dict[str, Binary] = {}
    for one in binaries:
        if one.kind not in ENGINEERING | SCIENCE:
            raise InputError(f"neither an engineering nor a science file: .{one.kind} in its header", source=one.path)
        side = engineering if one.kind in ENGINEERING else science
        if one.segment in side:
            raise InputError(f"the same segment ({one.segment}) is in {side[one.segment].path} too", source=one.path)
        side[one.segment] = one
    for segment, one in science.items():
        if segment not in engineering:
            wanted = next(kind for kind, other in PAIRS.items() if other == one.kind)
            message = f"a science file without the engineering file (.{wanted}) of its segment ({segment})"
            raise InputError(message, source=one.path)
    for segment, one in engineering.items():
        other = science.get(segment)
        if other is None:
            message = f"an engineering file without the science file (.{PAIRS[one.kind]}) of its segment ({segment})"
            raise InputError(message, source=one.path)
        if other.kind != PAIRS[one.kind]:
            raise InputError(f"a .{other.kind} does not go with the .{one.kind} {one.path}", source=other.path)
    return [(one, science[segment]) for segment, one in engineering.items()]


def unpacked(path: Path) -> bytes:
    """The file's bytes, unpacked where its name says that it is compressed."""
    require_file(path, MAX_FILE_BYTES)
    suffix = path.suffix.lower()
    if not (len(suffix) == 4 and suffix[2] == "c" and suffix[1:] in ENGINEERING | SCIENCE):
        return path.read_bytes()
    import lz4.block
    from dbdreader.decompress import Decompressor

    try:
        with path.open("rb") as file:
            return Decompressor().decompress(file)
    except (lz4.block.LZ4BlockError, ValueError, MemoryError):
        raise InputError("cut or damaged: it cannot be unpacked", source=path) from None


def _header(path: Path, data: bytes) -> tuple[dict[str, str], int]:
    """The header's tags, and where it ends."""
    if not data.startswith(b"dbd_label:") or b"dinkum_binary_data" not in data[:100]:
        raise InputError("not a Slocum binary: it does not begin with dbd_label", source=path)
    found: dict[str, str] = {}
    start, wanted = 0, 1
    while len(found) < wanted:
        end = data.find(b"\n", start, start + 1000)
        name, colon, value = data[start : max(end, start)].decode("ascii", "replace").partition(":")
        if end < 0 or not colon or len(found) > 100:
            raise InputError("cut or damaged within its header", source=path)
        found[name.strip()], start = value.strip(), end + 1
        if name == "num_ascii_tags":
            wanted = int(value) if value.strip().isdigit() else 0
        wanted = max(wanted, len(found) + ("num_ascii_tags" not in found))
    numbers = ("total_num_sensors", "sensors_per_cycle", "state_bytes_per_cycle", "sensor_list_factored")
    texts = ("encoding_ver", "full_filename", "filename_extension", "sensor_list_crc")
    for name in (*numbers, *texts):
        if name not in found or (name in numbers and not found[name].isdigit()):
            raise InputError(f"{name} is missing in its header or is no number", source=path)
    if found["encoding_ver"] != ENCODING:
        raise InputError(f"encoding_ver {found['encoding_ver']}, expected {ENCODING}", source=path)
    return found, start


def _lines(path: Path, data: bytes, start: int, number: int) -> tuple[list[bytes], int]:
    lines = []
    for _ in range(number):
        end = data.find(b"\n", start, start + 1000)
        if end < 0:
            raise InputError("cut or damaged within its list of sensors", source=path)
        lines.append(data[start:end])
        start = end + 1
    return lines, start


def _sizes(source: Path, lines: list[bytes], sensors: int, per_cycle: int) -> np.ndarray:
    """Bytes of each sensor of a cycle, by the lines `s: T n place bytes name unit`."""
    sizes: dict[int, int] = {}
    if len(lines) < sensors:
        raise InputError(f"cut: {len(lines)} of {sensors} sensors in this list", source=source)
    for number, line in enumerate(lines[:sensors], start=1):
        words = line.split()
        if not SENSOR.fullmatch(line.strip()):
            raise InputError("not a line of a list of sensors", source=source, line=number)
        if int(words[3]) >= 0:
            sizes[int(words[3])] = int(words[4])
    if sorted(sizes) != list(range(per_cycle)):
        raise InputError(f"not the list of sensors asked for: {len(sizes)} of {per_cycle} in a cycle", source=source)
    return np.array([sizes[place] for place in range(per_cycle)])


def _walk(path: Path, data: bytes, start: int, sizes: np.ndarray, state_bytes: int) -> bool:
    """Go through all cycles; whether the mark of the end stands behind the last. InputError where one is cut."""
    if data[start : start + 2] != b"sa" or len(data) < start + KNOWN_BYTES:
        raise InputError("cut or damaged behind its header", source=path)
    at, cycles = start + KNOWN_BYTES, 0
    while at < len(data) and data[at] == ord("d"):
        states = np.unpackbits(np.frombuffer(data[at + 1 : at + 1 + state_bytes], dtype=np.uint8))
        if len(states) != 8 * state_bytes:
            raise InputError(f"cut within cycle {cycles + 1}", source=path)
        new = (2 * states[0::2] + states[1::2])[: len(sizes)] == 2
        at += 1 + state_bytes + int(sizes[new].sum())
        if at > len(data):
            raise InputError(f"cut within cycle {cycles + 1}", source=path)
        cycles += 1
    if not cycles:
        raise InputError("no samples behind its header", source=path)
    if at < len(data) and data[at] != ord("X"):
        raise InputError(f"damaged behind cycle {cycles}", source=path)
    return at < len(data)
