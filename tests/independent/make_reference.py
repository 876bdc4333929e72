"""Make the project's own reference flights: `python -m tests.independent.make_reference` from the repository's root.

Writes tests/data/reference/*.csv with the independent model; takes about ten seconds.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .flights import fly
from .nominal import Glider

ROOT = Path(__file__).resolve().parents[2]
VEHICLE = ROOT / "firmware" / "model" / "vehicles" / "roughie.toml"
FOLDER = ROOT / "tests" / "data" / "reference"
HEADER = "t_s,cmd_servo_rad,cmd_slider_m,cmd_ballast_kg,X,Y,Z,phi,theta,psi,u,v,w,p,q,r,servo_rad,slider_m,ballast_kg"
GLIDING = dict(Z=5.0, u=0.3)


@dataclass(frozen=True)
class Manoeuvre:
    """A flight to be made: commands change at the times of `schedule`, rows stand at `times`."""

    schedule: tuple[tuple[float, float, float, float], ...]  # time s, servo rad, slider m, ballast kg
    times: np.ndarray
    start: dict[str, float]  # states that do not begin at zero
    water: tuple[float, float] = (0.0, 0.0)  # m/s, north, east

    def commands(self) -> np.ndarray:
        """(n, 3): the newest entry of the schedule at each row."""
        rows = [max(entry for entry in self.schedule if entry[0] <= time + 1e-9) for time in self.times]
        return np.array([row[1:] for row in rows])


def _uneven(seconds: float, rows: int) -> np.ndarray:
    """Row times on no grid, to 0.1 ms."""
    even = np.linspace(0.0, seconds, rows)
    spacing = seconds / (rows - 1)
    shifted = even + 0.3 * spacing * np.sin(2.4 * np.arange(rows))
    return np.round(shifted - shifted[0], 4)


MANOEUVRES = {
    # down and up again, wings level: pitch and depth alone
    "down_and_up": Manoeuvre(
        ((0, 0, -0.025, 0.15), (18, 0, 0.03, -0.16)), np.arange(0.0, 40.1, 0.5), GLIDING | {"psi": -2.0}
    ),
    # helix to starboard, then to port: heading runs through pi
    "helix": Manoeuvre(
        ((0, 0.9, -0.02, 0.12), (20, -0.7, -0.02, 0.12)), np.arange(0.0, 40.1, 0.5), GLIDING | {"psi": 2.5}
    ),
    # mass all the way forward and heavy, then all the way back and light: the steepest there is
    "steep": Manoeuvre(
        ((0, 0.2, 0.012, 0.2), (15, -0.2, 0.004, -0.2)), np.arange(0.0, 30.1, 0.5), GLIDING | {"theta": -0.5}
    ),
    # every command past its range, and a start in the middle of a swing
    "past_the_stops": Manoeuvre(
        ((0, 3.0, -0.2, 0.5), (8, -3.0, 0.2, -0.5), (20, 0.0, -0.2, 0.5)),
        np.arange(0.0, 30.1, 0.5),
        dict(X=-3.0, Y=8.0, Z=12.0, phi=-0.7, theta=0.3, psi=0.4, u=0.35, v=0.06, w=-0.05, p=0.4, q=-0.2, r=0.15,
             servo_rad=0.8, slider_m=0.05, ballast_kg=-0.15),
    ),
    # in moving water, rows on no grid, a command at nearly every row
    "uneven_in_current": Manoeuvre(
        tuple(
            (0.7 * k, 0.8 * np.round(np.sin(0.3 * k), 3), -0.02 + 0.01 * np.round(np.cos(0.5 * k), 3), 0.1)
            for k in range(45)
        ),
        _uneven(30.0, 71),
        GLIDING,
        water=(-0.08, 0.15),
    ),
}  # fmt: skip


def fly_manoeuvre(manoeuvre: Manoeuvre) -> np.ndarray:
    """The rows of a manoeuvre's file, (n, 19)."""
    names = HEADER.split(",")[4:]
    start = np.zeros(len(names))
    for name, value in manoeuvre.start.items():
        start[names.index(name)] = value
    water = np.array([*manoeuvre.water, 0.0])
    commands = manoeuvre.commands()
    states = fly(Glider.from_file(VEHICLE), start, manoeuvre.times, commands, lambda t: water)
    return np.column_stack([manoeuvre.times, commands, states])


def write(rows: np.ndarray) -> Iterator[str]:
    """A manoeuvre's file, line by line."""
    yield HEADER
    for row in rows:
        yield ",".join(f"{value + 0.0:.9g}" for value in row)


def main() -> None:
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, manoeuvre in MANOEUVRES.items():
        path = FOLDER / f"{name}.csv"
        path.write_text("\n".join(write(fly_manoeuvre(manoeuvre))) + "\n", encoding="utf-8")
        print(f"{path.relative_to(ROOT)}: {len(manoeuvre.times)} rows, {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
