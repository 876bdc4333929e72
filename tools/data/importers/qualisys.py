"""Qualisys Track Manager's 6DOF export (tab-separated) into motion-capture poses: x, y, z in mm, angles in deg.

A file has header lines `NAME<tab>value`, among them NO_OF_BODIES, FREQUENCY and BODY_NAMES, and a line of titles. Then
come rows with, for each body, X Y Z, three Euler angles, a residual and nine elements of the rotation matrix, its
columns one behind the other. The matrix is used, not the angles: their order is a setting of the program. A residual
below 0 or a pose of nothing but zeros means that the body was not seen. The laboratory's frame has Z up as the program
calibrates it, and so has the body's, X ahead: both are turned about x by 180 deg into NED and the vehicle's axes
(docs/explanation/model.md, Frames and state). What is left of a turn between capture's body and vehicle is for `glider
identify`
to find.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from glider.firmware.core.maths.rotations import euler_from_quaternion
from glider.tools.data.errors import InputError
from glider.tools.data.sources import read_text

FIELDS = 16  # X Y Z, three angles, residual, nine of the matrix
TURN = np.diag([1.0, -1.0, -1.0])  # Z up to Z down


@dataclass
class Capture:
    """Poses of one body: t (rows,) s, pose (rows, 6) NED m and rad, NaN where it was not seen; its rate, Hz."""

    body: str
    t: np.ndarray
    pose: np.ndarray
    rate_hz: float


def _header(lines: list[str], source: str) -> tuple[dict[str, list[str]], int]:
    """Header entries by name, and the number of the first line of data."""
    found: dict[str, list[str]] = {}
    for number, line in enumerate(lines):
        cells = line.rstrip("\n").split("\t")
        try:
            [float(cell) for cell in cells if cell]
            if len(cells) >= FIELDS:
                return found, number
        except ValueError:
            pass
        found[cells[0]] = cells[1:]
    raise InputError(f"no rows of at least {FIELDS} numbers: not a 6DOF export", source=source)


def _number(header: dict[str, list[str]], key: str, source: str) -> float:
    try:
        value = float(header[key][0])
    except KeyError:
        raise InputError(
            "the header has no such line: not a 6DOF export of Qualisys", source=source, column=key
        ) from None
    except (ValueError, IndexError):
        raise InputError("expected a number", source=source, column=key) from None
    if not value > 0.0:
        raise InputError(f"expected a number above 0, got {value:g}", source=source, column=key)
    return value


def _rows(lines: list[str], first: int, wanted: int, source: str) -> np.ndarray:
    table = []
    for number, line in enumerate(lines[first:], start=first + 1):
        if not line.strip():
            continue
        cells = line.rstrip("\r\n").rstrip("\t").split("\t")
        if len(cells) < wanted:
            raise InputError(f"{len(cells)} fields, {wanted} expected", source=source, line=number)
        try:
            table.append([float(cell) if cell else np.nan for cell in cells])
        except ValueError:
            raise InputError("not a number", source=source, line=number) from None
        if len(table) > 1 and len(table[-1]) != len(table[0]):
            raise InputError(f"{len(table[-1])} fields, {len(table[0])} in the first row", source=source, line=number)
    return np.array(table)


def _euler(matrices: np.ndarray) -> np.ndarray:
    """Roll, pitch, yaw (rows, 3) of rotation matrices (rows, 3, 3), body to NED."""
    from scipy.spatial.transform import Rotation

    quaternions = Rotation.from_matrix(matrices).as_quat()[:, [3, 0, 1, 2]]
    return np.array([euler_from_quaternion(*q) for q in quaternions]).reshape(-1, 3)


def read_capture(path: Path, body: str | None = None) -> Capture:
    """One body of a 6DOF export (the first, if none is named); InputError with file, line and column."""
    source = str(path)
    lines = read_text(path).splitlines()
    header, first = _header(lines, source)
    bodies = int(_number(header, "NO_OF_BODIES", source))
    rate = _number(header, "FREQUENCY", source)
    names = [name for name in header.get("BODY_NAMES", []) if name] or [f"body {n + 1}" for n in range(bodies)]
    if len(names) != bodies:
        raise InputError(f"{len(names)} names for {bodies} bodies", source=source, column="BODY_NAMES")
    if body is not None and body not in names:
        raise InputError(f"no body '{body}': there are {', '.join(names)}", source=source)
    number = 0 if body is None else names.index(body)
    table = _rows(lines, first, FIELDS * bodies, source)
    extra = table.shape[1] - FIELDS * bodies
    if extra not in (0, 2):
        raise InputError(f"{table.shape[1]} fields a row do not make {bodies} bodies of {FIELDS}", source=source)
    t = table[:, 1] if extra else np.arange(len(table)) / rate  # frame number and time stand ahead, if at all
    if (np.diff(t) <= 0.0).any():
        late = int(np.flatnonzero(np.diff(t) <= 0.0)[0])
        raise InputError("time does not go on", source=source, line=first + late + 2, column="Time")
    part = table[:, extra + FIELDS * number : extra + FIELDS * (number + 1)]
    matrix = part[:, 7:16].reshape(-1, 3, 3).transpose(0, 2, 1)
    seen = np.isfinite(part).all(axis=1) & (part[:, 6] >= 0.0) & (np.abs(matrix).max(axis=(1, 2)) > 0.0)
    square = np.abs(matrix[seen] @ matrix[seen].transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2), initial=0.0)
    if (square > 0.02).any():
        line = first + 1 + int(np.flatnonzero(seen)[np.argmax(square)])
        raise InputError("the nine last fields are no rotation matrix", source=source, line=line, column=names[number])
    pose = np.full((len(t), 6), np.nan)
    pose[seen, :3] = (part[seen, :3] / 1000.0) @ TURN
    if seen.any():
        pose[seen, 3:] = _euler(TURN @ matrix[seen] @ TURN)
    return Capture(names[number], t - t[0], pose, rate)
