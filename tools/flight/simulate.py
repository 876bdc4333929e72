"""Open-loop nominal flights from a table of commands: the work behind `glider simulate`.

The columns are those of the reference flights: time, three commands, the fifteen states. The states are read from the
first row alone; u, v, w are relative to the water, there as everywhere.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from glider.firmware.core.maths.rotations import euler_from_quaternion, quaternion_from_euler, wrap_angle
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.flight import nominal_run
from glider.tools.data.errors import InputError
from glider.tools.data.runs.csvfile import CsvTable
from glider.tools.data.sources import read_text

TIME = "t_s"
COMMANDS = ("cmd_servo_rad", "cmd_slider_m", "cmd_ballast_kg")
POSE = ("X", "Y", "Z", "phi", "theta", "psi")
VELOCITY = ("u", "v", "w", "p", "q", "r")
ACTUATORS = ("servo_rad", "slider_m", "ballast_kg")
STATES = POSE + VELOCITY + ACTUATORS
COLUMNS = (TIME, *COMMANDS, *STATES)
PSI = STATES.index("psi")
POSITIONS, ANGLES, VELOCITIES, STROKES = slice(0, 3), slice(3, 6), slice(6, 12), slice(12, 15)  # of STATES

DEFAULT_DT = 0.01  # s
MAX_STEPS = 1e9  # some ten minutes of computing; a longer flight is a time column in the wrong unit
MAX_SPEED, MAX_RATE = 50.0, 50.0  # m/s, rad/s: beyond these no glider flies, and a calculation that gets there diverges
WATCH_S = 0.1  # s between looks at heading and finiteness: no heading turns by half a circle in it
OUTSIDE = 0.05  # share of its range by which a measured actuator may stand outside: noise, not a wrong unit


@dataclass(frozen=True)
class CommandColumns:
    """What a command file says: n rows, each command holding from the time of its row."""

    times: np.ndarray  # (n,), s, increasing
    commands: np.ndarray  # (n, 3), rad, m, kg
    start: np.ndarray  # (15,), the states of the first row
    labels: tuple[tuple[str, ...], ...]  # (n, 4), time and commands as they were written
    source: str
    lines: tuple[int, ...]  # (n,), where each row stood


def read_commands(path: Path) -> CommandColumns:
    """A command file as a table; InputError with file, line and column where it cannot be flown.

    Rows may end behind the commands: states are read from the first one alone. Columns that mean nothing here are
    passed over.
    """
    first, *rows = read_text(path).splitlines() or [""]
    width = first.count(",")
    padded = [first, *(row + "," * (width - row.count(",")) if row.strip() else "" for row in rows)]
    table = CsvTable(path, "\n".join(padded).encode())
    missing = [name for name in COLUMNS if name not in table.header]
    if missing:
        raise table.error(f"missing: {', '.join(missing)}", line=1, column="header")
    times, *commands = (_complete(table, name, table.rows) for name in (TIME, *COMMANDS))
    table.require_increasing(TIME, times)
    start = np.concatenate([_complete(table, name, 1) for name in STATES])
    labels = tuple(zip(*([label.strip() for label in table.texts(name)] for name in (TIME, *COMMANDS)), strict=True))
    lines = tuple(table.line(row) for row in range(table.rows))
    return CommandColumns(times, np.column_stack(commands), start, labels, str(path), lines)


def _complete(table: CsvTable, name: str, rows: int) -> np.ndarray:
    """The first rows of a column, (rows,); InputError where one has no number."""
    values, bad = table.numbers_and_bad(name)
    if bad[:rows].any():
        table.numbers(name)  # says which
    missing = np.flatnonzero(np.isnan(values[:rows]))
    if missing.size:
        raise table.error("no value", row=int(missing[0]), column=name)
    return values[:rows]


def check_start(P: np.ndarray, table: CommandColumns) -> None:
    """InputError where the first row holds a state that this vehicle cannot be in."""
    source, line = table.source, table.lines[0]
    for name, value in zip(VELOCITY, table.start[VELOCITIES], strict=True):
        limit = MAX_SPEED if name in "uvw" else MAX_RATE
        if abs(value) > limit:
            unit = "m/s" if name in "uvw" else "rad/s"
            raise InputError(f"{value:g} {unit} is no speed of a glider", source=source, line=line, column=name)
    ranges = (layout.SERVO_MIN, layout.SLIDER_MIN, layout.BALLAST_MIN)
    for name, value, place in zip(ACTUATORS, table.start[STROKES], ranges, strict=True):
        low, high = P[place], P[place + 1]
        if not low - OUTSIDE * (high - low) <= value <= high + OUTSIDE * (high - low):
            message = f"{value:g} is outside the actuator's range, {low:g} to {high:g}"
            raise InputError(message, source=source, line=line, column=name)


def check_dt(P: np.ndarray, dt: float) -> None:
    """InputError for a step in which an actuator could run past its command: longer than its time constant."""
    if not math.isfinite(dt) or dt <= 0.0:
        raise InputError(f"--dt: expected a positive number of seconds, got {dt:g}")
    longest = float(min(P[layout.SERVO_TAU], P[layout.SLIDER_TAU], P[layout.BALLAST_TAU]))
    if dt > longest:
        raise InputError(f"--dt: {dt:g} s is longer than the fastest actuator's time constant, {longest:g} s")


def _kernel_state(start: np.ndarray) -> np.ndarray:
    """The kernels' state vector, shape (N_X,), of the fifteen states of a row."""
    x = np.zeros(layout.N_X)
    x[layout.X_POS : layout.X_QUAT] = start[POSITIONS]
    x[layout.X_QUAT : layout.X_QUAT + 4] = quaternion_from_euler(*start[ANGLES])
    x[layout.X_NU :] = start[VELOCITIES.start :]
    return x


def _row(x: np.ndarray, psi: float) -> np.ndarray:
    """The fifteen states of a kernels' state vector; psi as near as can be to the psi before."""
    q0, q1, q2, q3 = x[layout.X_QUAT : layout.X_QUAT + 4]
    phi, theta, wrapped = euler_from_quaternion(q0, q1, q2, q3)
    return np.array([*x[layout.X_POS : layout.X_QUAT], phi, theta, psi + wrap_angle(wrapped - psi), *x[layout.X_NU :]])


def _flown(x: np.ndarray) -> bool:
    nu = x[layout.X_NU : layout.X_NU + 6]
    return bool(np.isfinite(x).all() and (np.abs(nu[:3]) <= MAX_SPEED).all() and (np.abs(nu[3:]) <= MAX_RATE).all())


def fly_commands(
    P: np.ndarray,
    table: CommandColumns,
    water: tuple[float, float] = (0.0, 0.0),
    dt: float = DEFAULT_DT,
    advance: Callable[[int], None] | None = None,
) -> np.ndarray:
    """The states at the table's times, shape (n, 15), flown by the nominal model in water moving at N, E (m/s).

    Each interval between rows is cut into equal steps of at most dt. psi runs on through +-pi. Raises InputError for a
    table that this vehicle cannot fly and for a flight that diverges. `advance` is called for every row.
    """
    check_dt(P, dt)
    check_start(P, table)
    if (table.times[-1] - table.times[0]) / dt > MAX_STEPS:
        duration = table.times[-1] - table.times[0]
        message = f"{duration:g} s in steps of {dt:g} s are more than {MAX_STEPS:.0e} steps"
        raise InputError(message, source=table.source, line=table.lines[-1], column=TIME)
    x, work = _kernel_state(table.start), np.zeros((5, layout.N_X))
    states = np.empty((len(table.times), len(STATES)))
    states[0] = _row(x, table.start[PSI])
    psi = states[0, PSI]
    for index in range(1, len(table.times)):
        begin, end = float(table.times[index - 1]), float(table.times[index])
        steps = max(1, math.ceil((end - begin) / dt - 1e-6))
        step = (end - begin) / steps
        stride = max(1, int(WATCH_S / step))
        done = 0
        while done < steps:
            count = min(stride, steps - done)
            nominal_run(P, x, *table.commands[index - 1], water[0], water[1], 0.0, step, count, work)
            done += count
            if not _flown(x):
                message = f"the flight diverges at t = {begin + done * step:.6g} s (step {step:.6g} s)"
                raise InputError(message, source=table.source, line=table.lines[index])
            states[index] = _row(x, psi)
            psi = states[index, PSI]
        if advance is not None:
            advance(1)
    return states


def expected_steps(table: CommandColumns, dt: float) -> float:
    """About how many steps a table takes."""
    return float(table.times[-1] - table.times[0]) / dt if dt > 0.0 else 0.0


def write_flight(table: CommandColumns, states: np.ndarray) -> str:
    """A flight as CSV: the columns of COLUMNS; times and commands stand as they were written, states with 12 digits."""
    rows = [",".join(COLUMNS)]
    for labels, state in zip(table.labels, states, strict=True):
        rows.append(",".join((*labels, *(f"{value:.12g}" for value in state))))
    return "\n".join(rows) + "\n"
