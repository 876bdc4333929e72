"""The first hour with one's own log: flights of the shipped vehicle, written as a stranger's, and how that ends."""

import json
import math
import sys
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from glider.firmware.model.vehicle import Vehicle
from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.data.first_vehicle import QUESTIONS
from glider.tools.data.runs.case import load_case
from glider.tools.data.runs.run import Run
from glider.tools.data.sources import load_vehicle

MISSIONS = ("spiral", "spiral", "circle_to_s")
SCALE = 0.6  # of the drag that comes on after the healthy flights
DEG = 180.0 / math.pi
# the logger's name, the column of run data, its unit, how many of them are one SI
LOGGED = (
    ("Roll", "roll_rad", "deg", DEG), ("Pitch", "pitch_rad", "deg", DEG), ("Heading", "yaw_rad", "deg", DEG),
    ("gx", "p_rad_s", "deg/s", DEG), ("gy", "q_rad_s", "deg/s", DEG), ("gz", "r_rad_s", "deg/s", DEG),
    ("depth_cm", "depth_m", "cm", 100.0), ("mass_mm", "slider_m", "mm", 1000.0), ("tank_g", "ballast_kg", "g", 1000.0),
    ("servo_set", "cmd_servo_rad", "deg", DEG), ("mass_set", "cmd_slider_m", "mm", 1000.0),
    ("tank_set", "cmd_ballast_kg", "g", 1000.0),
)  # fmt: skip
# As a person would weigh and measure the shipped vehicle: masses to 1 %, lengths to 2 %, inertia by swings to 5 %.
APART, WIRES = 0.8, 2.0


def _period(inertia: float, mass: float) -> float:
    return 4.0 * math.pi / APART * math.sqrt(inertia * WIRES / (mass * 9.80665))


MEASURED = {
    "m_t": 13.1, "length": 1.185, "m_r": 1.98, "R_r": 0.0153, "m_s": 2.02, "R_s": 0.0196, "r_sx0": 0.0, "x_b": 0.357,
    "ballast": 0.2, "pump": 0.03, "plunger_area": 0.0062, "travel": 0.06, "slider_rate": 0.02, "servo": 60.0,
    "servo_rate": 57.0, "pitch_period": _period(1.05 * 1.5, 13.0), "roll_period": _period(0.95 * 0.0409, 13.0),
    "pitch_apart": APART, "pitch_wires": WIRES, "roll_apart": APART, "roll_wires": WIRES,
}  # fmt: skip


def glider(*words: object, typed: str = "") -> int:
    """The command line's exit code; `typed`: what comes on standard input."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["glider", *map(str, words)])
        patch.setattr(sys, "stdin", StringIO(typed))
        return report_errors(cli)


def own_log(run: Run, path: Path, rng: np.random.Generator) -> None:
    """A run as a small logger writes it: 10 Hz with jitter, milliseconds, degrees, cm, mm, g; empty where not read."""
    at = np.arange(0.0, run.t[-1], 0.1)
    at = at + rng.uniform(-0.004, 0.004, len(at))
    rows = np.unique(np.clip(np.searchsorted(run.t, at), 0, run.rows - 1))
    lines = [",".join(["millis", *(name for name, *_ in LOGGED)])]
    for n in rows.tolist():
        values = [run.columns[column][n] * size for _, column, _, size in LOGGED]
        cells = [f"{value:.3f}" if math.isfinite(value) else "" for value in values]
        lines.append(",".join([f"{5000.0 + 1000.0 * run.t[n]:.0f}", *cells]))
    path.write_text("\n".join(lines) + "\n")


def mapping() -> str:
    """The mapping of such a log, for a vehicle file beside it."""
    head = 'format = 1\nvehicle = "mine.toml"\nsite = "pool"\nwater_density_kg_m3 = 998.2\n'
    time = '\n[time]\ncolumn = "millis"\nunit = "ms"\n'
    return (
        head + time + "".join(f'\n[columns.{to}]\nsource = "{name}"\nunit = "{unit}"\n' for name, to, unit, _ in LOGGED)
    )


@dataclass
class Story:
    """What the first hour came to."""

    vehicle: Vehicle  # as `glider vehicle new` wrote it
    identified: Vehicle
    answer: dict  # of the diagnosis by the identified file

    @property
    def drag(self) -> dict:
        return self.answer["causes"][0]["parameters"]["scale"]


def told(folder: Path, answers: dict[str, float]) -> Story:
    """Healthy flights, then some with more drag; imported, `vehicle new`, identified, diagnosed."""
    rng = np.random.default_rng(7)
    typed = "".join(
        f"{answers[one.key]:.6g}\n" if one.key in answers else "\n"
        for one in QUESTIONS if one.key in answers or not one.key.endswith(("apart", "wires"))
    )  # fmt: skip
    assert glider("vehicle", "new", folder / "mine.toml", typed=typed) == 0
    (folder / "map.toml").write_text(mapping())
    for kind, effects in (("healthy", []), ("drag", ["--effect", f"drag:scale={SCALE}"])):
        files = []
        for n, mission in enumerate(MISSIONS):
            log, flown = folder / f"{kind}{n}.mcap", folder / f"{kind}{n}"
            seed = 10 * n + len(kind)
            assert glider("fly", "--mission", mission, "--seed", seed, "--log", log, *effects) == 0
            assert glider("log", "export", log, "--out", flown) == 0
            files.append(folder / f"{kind}{n}.csv")
            own_log(load_case(flown).runs[0], files[-1], rng)
        assert glider("import", "csv", *files, "--map", folder / "map.toml", "--out", folder / kind) == 0
    assert glider("identify", folder / "healthy", "--out", folder / "found") == 0
    file = folder / "found" / "identified.toml"
    held = "--vehicle", file, "--reference", folder / "healthy"
    assert glider("gap", "diagnose", folder / "drag", *held, "--out", folder / "answer") == 0
    answer = json.loads((folder / "answer" / "diagnosis.json").read_text())
    return Story(load_vehicle(str(folder / "mine.toml")), load_vehicle(str(file)), answer)


def ends_right(story: Story) -> None:
    """Drag first, its size within its interval, nothing of what was identified assumed, a floor that says something."""
    assert story.answer["verdict"] == "cause"
    assert story.answer["causes"][0]["label"] == "drag"
    low, high = story.drag["ci90"]
    assert low <= SCALE <= high
    assert high - low < SCALE
    assert story.identified.identified is not None
    assert not set(story.identified.assumed) & set(story.identified.identified.parameters)
    assert story.identified.form is not None
    assert story.identified.form.noise < 1.0
