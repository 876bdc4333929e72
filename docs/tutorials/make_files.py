"""Make the files of the tutorials with the project's simulators: `python -m docs.tutorials.make_files`.

pool-*.csv: three flights with 80 % more drag and a gyro that reads 0.8 of the true rate, written as another logger
would. sea009.4.*: ten dives of a simulated SeaExplorer, in its own files, whose drag grows by 40 % with the seventh.
"""

import gzip
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import gsw
import numpy as np

from glider.tools.data.runs.case import load_case
from glider.tools.data.runs.run import Run
from glider.tools.verify.challenge.ocean_cases import example_mission
from tests.support.ocean_files import LATITUDE, LONGITUDE, START, Flight, seaexplorer

FILES = Path(__file__).parent / "files"
DEG = 180.0 / math.pi
FLIGHTS = 11, 12, 13  # seeds
# the logger's name, the column of run data, how many of its unit are one SI
LOGGED = (
    ("Roll", "roll_rad", DEG), ("Pitch", "pitch_rad", DEG), ("Heading", "yaw_rad", DEG),
    ("gx", "p_rad_s", DEG), ("gy", "q_rad_s", DEG), ("gz", "r_rad_s", DEG), ("depth_cm", "depth_m", 100.0),
    ("mass_mm", "slider_m", 1000.0), ("tank_g", "ballast_kg", 1000.0), ("servo_set", "cmd_servo_rad", DEG),
    ("mass_set", "cmd_slider_m", 1000.0), ("tank_set", "cmd_ballast_kg", 1000.0),
)  # fmt: skip
EFFECTS = ("--effect", "gyro_scale:scale=-0.2", "--effect", "drag:scale=0.8")
ROW_S = 0.05  # of the pool log
DIVES, CHANGE = 10, ("drag", 0.4, 6)  # from the seventh dive on
APART_S = 10_800.0  # from one dive's start to the next


def glider(*words: str, cwd: Path) -> None:
    """Run a command of glider in a folder."""
    subprocess.run([sys.executable, "-m", "glider.tools.cli.main", *words], cwd=cwd, check=True)


def pool_log(run: Run, path: Path) -> None:
    """Write a run as a small logger does: milliseconds since power-on, degrees, centimetres, millimetres, grams."""
    lines = [",".join(["millis", *(name for name, *_ in LOGGED)])]
    rows = np.searchsorted(run.t, np.arange(0.0, run.t[-1], ROW_S))
    for n in rows.tolist():
        values = [run.columns[column][n] * size for _, column, size in LOGGED]
        cells = [f"{value:.2f}" if math.isfinite(value) else "" for value in values]
        lines.append(",".join([f"{5000.0 + 1000.0 * run.t[n]:.0f}", *cells]))
    path.write_text("\n".join(lines) + "\n")


def pool_logs() -> None:
    """Fly with the fault, export, and write the logs."""
    with tempfile.TemporaryDirectory() as folder:
        for n, seed in enumerate(FLIGHTS, start=1):
            words = ("--mission", "spiral", "--seed", str(seed), *EFFECTS)
            glider("fly", *words, "--log", f"{n}.mcap", cwd=Path(folder))
            glider("log", "export", f"{n}.mcap", "--out", f"case{n}", cwd=Path(folder))
            pool_log(load_case(Path(folder) / f"case{n}").runs[0], FILES / f"pool-{n}.csv")


def as_flight(run: Run, start: float) -> Flight:
    """Turn a dive into what the writers of native files take; salinity follows from density and temperature."""
    c = dict(run.columns)
    pressure = gsw.p_from_z(-np.maximum(c["depth_m"], 0.0), LATITUDE)
    absolute = np.full(len(pressure), 35.0)
    for _ in range(4):
        absolute = gsw.SA_from_rho(c["density_kg_m3"], gsw.CT_from_t(absolute, c["temperature_c"], pressure), pressure)
    practical = gsw.SP_from_SA(absolute, pressure, LONGITUDE, LATITUDE)
    conductivity = gsw.C_from_SP(practical, c["temperature_c"], pressure) / 10.0
    for name in ("battery_m", "fin_rad", "pump"):
        c.setdefault(name, np.zeros(run.rows))
    t = start + run.t
    return Flight(t, c, t, pressure, c["temperature_c"], conductivity)


def ocean_files() -> None:
    """Fly the mission in another simulator than the diagnosis uses, and write it as the vehicle would."""
    with tempfile.TemporaryDirectory() as folder:
        example_mission(Path(folder) / "case", "seaexplorer", dives=DIVES, seed=1, change=CHANGE)
        for n, run in enumerate(load_case(Path(folder) / "case").runs):
            for path in seaexplorer(Path(folder), as_flight(run, START + n * APART_S), n + 1):
                (FILES / f"{path.name}.gz").write_bytes(gzip.compress(path.read_bytes(), mtime=0))


if __name__ == "__main__":
    FILES.mkdir(exist_ok=True)
    pool_logs()
    ocean_files()
