"""Steps of the nominal plant in a second on one core: one flight, and many at once, beside the same flight in plain C.

The C program (plant.c here, or another of the same protocol) is compiled for this machine, once by the rules of IEEE
and once with -ffast-math, and all are run in turns.
Start, commands and step are the program's: 1 m deep, 0.2 m/s, servo 0.6 rad, slider -0.02 m, ballast 0.1 kg, 0.01 s.
"""

import math
import shutil
import subprocess
from collections.abc import Callable
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np

from glider.firmware.core.maths.rotations import euler_from_quaternion, wrap_angle
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.flight import nominal_run
from glider.firmware.model.library import shipped
from glider.firmware.model.vehicle import decode_vehicle
from glider.tools.data.errors import InputError
from glider.tools.verify.benchmark.c_program import compiled
from glider.tools.verify.benchmark.plant_batch import VEHICLES, Fleet
from glider.tools.verify.benchmark.registry import Settings
from glider.tools.verify.benchmark.timing import alternate, median, seconds

STEPS = 2_000_000
DT = 0.01  # s
COMMANDS = (0.6, -0.02, 0.1)  # rad, m, kg
STILL_WATER = (0.0, 0.0, 0.0)
FAST = "-ffast-math"
HEADING_STRIDE = 50  # steps between looks at the heading, which turns by much less than half a circle in them
C_TIMEOUT_S = 600.0


def start() -> np.ndarray:
    """The kernels' state at the beginning, shape (N_X,)."""
    x = np.zeros(layout.N_X)
    x[2], x[layout.X_QUAT], x[layout.X_NU] = 1.0, 1.0, 0.2
    return x


def final_state(P: np.ndarray, steps: int) -> list[float]:
    """eta (psi continuous), nu, servo, slider, ballast after `steps` steps: 15 numbers."""
    x, work, psi, done = start(), np.zeros((5, layout.N_X)), 0.0, 0
    while done < steps:
        count = min(HEADING_STRIDE, steps - done)
        nominal_run(P, x, *COMMANDS, *STILL_WATER, DT, count, work)
        done += count
        psi += wrap_angle(euler_from_quaternion(*x[layout.X_QUAT : layout.X_NU])[2] - psi)
    phi, theta, _ = euler_from_quaternion(*x[layout.X_QUAT : layout.X_NU])
    return [float(value) for value in (*x[:3], phi, theta, psi, *x[layout.X_NU :])]


def run_c(program: Path, source: Path, steps: int) -> tuple[float, list[float]]:
    """Steps per second and final state of the C program."""
    try:
        done = subprocess.run(
            [str(program), str(steps)], capture_output=True, text=True, timeout=C_TIMEOUT_S, check=True
        )
        speed, *state = (float(number) for number in done.stdout.split())
    except subprocess.TimeoutExpired:
        raise InputError(f"still flying after {C_TIMEOUT_S:g} s", source=source) from None
    except subprocess.CalledProcessError as error:
        raise InputError(f"the program ended with exit code {error.returncode}", source=source) from None
    except ValueError:
        raise InputError("expected a speed and 15 states on standard output", source=source) from None
    if len(state) != 15 or not (speed > 0.0 and all(math.isfinite(value) for value in state)):
        message = f"expected a speed and 15 states on standard output, got {len(state) + 1} numbers"
        raise InputError(message, source=source)
    return speed, state


def kernel_speed(P: np.ndarray, steps: int) -> float:
    """Steps per second of the compiled kernel."""
    x, work = start(), np.zeros((5, layout.N_X))
    return steps / seconds(lambda: nominal_run(P, x, *COMMANDS, *STILL_WATER, DT, steps, work))


def measure(settings: Settings, steps: int = STEPS) -> dict[str, Any]:
    """steps_per_s, c_steps_per_s and ratio (medians, taken in turns), final_state and its distance from C's; `batch`:
    the same of VEHICLES vehicles at once, beside C and beside C with -ffast-math (ratio_fast).

    Where there is no C to compare with, its figures are null and `note` says why.
    """
    P = decode_vehicle(shipped("model/vehicles")["roughie"], "roughie").vector()
    state, fleet = final_state(P, steps), Fleet(P, COMMANDS, start(), DT)  # compiles the kernel, too
    each = -(-steps // VEHICLES)
    result: dict[str, Any] = {"steps": steps, "final_state": state}
    batch = fleet.found(each)
    ours = (lambda: kernel_speed(P, steps), lambda: fleet.speed(each))
    compiler = shutil.which("cc")
    note = "no C compiler (cc) to compare with"
    with as_file(files("glider.tools.verify.benchmark") / "plant.c") as own:
        source = settings.plant_c or own
        try:
            if compiler is not None:
                return {**against_c(ours, source, compiler, state, batch, settings.repeats, steps), **result}
        except InputError as error:
            if settings.plant_c is not None:
                raise
            note = str(error)
    speed, together = (median(speeds) for speeds in alternate(settings.repeats, *ours))
    nothing = {"c_steps_per_s": None, "ratio": None, "max_state_difference": None}
    none = {"c_fast_steps_per_s": None, "ratio": None, "ratio_fast": None}
    return {
        "steps_per_s": speed, **nothing, "batch": {"steps_per_s": together, **none, **batch}, **result, "note": note
    }  # fmt: skip


def against_c(
    ours: tuple[Callable[[], float], Callable[[], float]], source: Path, compiler: str, state: list[float],
    batch: dict[str, Any], repeats: int, steps: int,
) -> dict[str, Any]:  # fmt: skip
    """Kernel, batch and both Cs in turns: speeds, their ratios, the largest difference of `state` from where C ends."""
    with compiled(source, compiler) as program, compiled(source, compiler, FAST) as fast:
        speeds, together, flights, fast_flights = alternate(
            repeats, *ours, lambda: run_c(program, source, steps), lambda: run_c(fast, source, steps)
        )
    speed, batch_speed = median(speeds), median(together)
    c_speed, c_fast = median([speed for speed, _ in flights]), median([speed for speed, _ in fast_flights])
    compared = {"ratio": batch_speed / c_speed, "ratio_fast": batch_speed / c_fast}
    return {
        "steps_per_s": speed,
        "c_steps_per_s": c_speed,
        "ratio": speed / c_speed,
        "max_state_difference": max(abs(a - b) for a, b in zip(state, flights[0][1], strict=True)),
        "batch": {"steps_per_s": batch_speed, "c_fast_steps_per_s": c_fast, **compared, **batch},
        "c_source": source.name,
    }
