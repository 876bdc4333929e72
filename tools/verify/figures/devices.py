"""`python -m glider.tools.verify.figures.devices`: claims about the real drivers, measured against twins, as JSON.

same-flight: a mission at real time through drivers, wires and twins, against the same seed on the simulated board
with the same rates and delays. lateness: the tick's lateness while a device is silent, late, babbling or unplugged,
against the undisturbed run of the same minutes, in turns. timings: each device broken under water, with the fault
timings as shipped (tests on busy machines fly with longer ones).
"""

import json
import math
import os
import tempfile
from pathlib import Path
from typing import Any

import click
import numpy as np

from glider.firmware.core.control.telemetry import REC_LATENESS
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.tools.cli.common import DONE, FAILED, print_json, progress

POSITION_LIMIT_M, ATTITUDE_LIMIT_DEG = 0.10, 2.0
RATIO_LIMIT = 1.5
FAULTS = (
    ("beacon", "silent"), ("beacon", "late 0.2"), ("beacon", "babble"), ("beacon", "unplug"), ("imu", "babble"),
    ("imu", "unplug"), ("servo", "unplug"),
)  # fmt: skip
FIFO_PRIORITY = 50
FIFO = click.option("--fifo", is_flag=True, help="At real-time priority, as a flight should be; needs the right to it.")


def take_priority(fifo: bool) -> None:
    """Real-time priority for this process and those it starts."""
    if fifo:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(FIFO_PRIORITY))


@click.group()
def main() -> None:
    """Measure the drivers against twins."""


# --- same flight ----------------------------------------------------------------------------------------------------
@main.command("same-flight")
@click.option("--mission", default="sawtooth", show_default=True)
@click.option("--seed", default=1, show_default=True)
@FIFO
def same_flight(mission: str, seed: int, fifo: bool) -> None:
    """Fly a mission on the twin at real time and on its simulated board; compare the ends and the attitudes."""
    take_priority(fifo)
    with tempfile.TemporaryDirectory() as folder:
        result = compare_flights(mission, seed, Path(folder))
    print_json(result)
    raise SystemExit(DONE if result["pass"] else FAILED)


def compare_flights(mission: str, seed: int, folder: Path, *, vehicle: str = "roughie") -> dict[str, Any]:
    """Both flights, logged, and how far they are apart."""
    from glider.sim_backend.twins.boardfile import decode_twin_file, simulated_board
    from glider.tools.data.boards import load_board_file
    from glider.tools.data.log.reader import read_log
    from glider.tools.data.tomltext import toml_text

    found = load_board_file("twin")
    board = simulated_board(decode_twin_file(found.text, found.source))
    (folder / "sim.toml").write_text(toml_text(board, inline=("sensors",)))
    twin = fly(mission, vehicle, "twin", seed, folder / "twin.mcap")
    sim = fly(mission, vehicle, str(folder / "sim.toml"), seed, folder / "sim.mcap")
    ticks = {name: read_log(folder / f"{name}.mcap").topics["/tick"] for name in ("sim", "twin")}
    truth = read_log(folder / "sim.mcap").topics["/truth"]
    end = np.array([truth.column(f"true_{axis}_m")[-1] for axis in "xyz"])
    there = np.array([twin["truth"][f"{axis}_m"] for axis in "xyz"])
    apart = float(np.linalg.norm(end - there))
    rms = attitude_rms_deg(ticks["sim"], ticks["twin"])
    return {
        "mission": mission, "seed": seed, "completed": twin["completed"] and sim["completed"],
        "seconds": {name: float(np.ptp(topic.column("t_s"))) for name, topic in ticks.items()},
        "end_apart_m": apart, "end_m": {"sim": end, "twin": there}, "attitude_rms_deg": rms,
        "missed_ticks": twin["missed_ticks"], "ticks": twin["ticks"],
        "pass": bool(apart < POSITION_LIMIT_M and rms["flying"] < ATTITUDE_LIMIT_DEG and twin["completed"]),
    }  # fmt: skip


def fly(mission: str, vehicle: str, board: str, seed: int, log: Path) -> dict[str, Any]:
    """`glider fly`, as a person types it."""
    import subprocess
    import sys

    command = [sys.executable, "-m", "glider.tools.cli.main", "fly", "--mission", mission, "--vehicle", vehicle]
    command += ["--board", board, "--seed", str(seed)]
    done = subprocess.run([*command, "--log", str(log), "--json"], stdout=subprocess.PIPE, check=False)
    return json.loads(done.stdout)


def attitude_rms_deg(sim: Any, twin: Any) -> dict[str, float]:
    """Rms of the angle between both attitudes (deg), at equal times since the first tick: flying, and to the end."""
    times = sim.column("t_s")
    own = twin.column("t_s") - twin.column("t_s")[0]
    angles = np.array([np.interp(times, own, np.unwrap(twin.column(f"est_{axis}_rad"))) for axis in AXES]).T
    both = [_quaternions(angles), _quaternions(np.array([sim.column(f"est_{axis}_rad") for axis in AXES]).T)]
    turned = 2.0 * np.arccos(np.clip(np.abs((both[0] * both[1]).sum(axis=1)), 0.0, 1.0))
    flying = (sim.column("mode") == 1.0) & (times < own[-1])
    return {
        "flying": math.degrees(math.sqrt(float(np.mean(turned[flying] ** 2)))),
        "with_ascent": math.degrees(math.sqrt(float(np.mean(turned**2)))),
    }


AXES = ("roll", "pitch", "yaw")


def _quaternions(angles: np.ndarray) -> np.ndarray:
    """Unit quaternions (n, 4) of roll, pitch and yaw (n, 3)."""
    from glider.firmware.core.maths.rotations import quaternion_from_euler

    return np.array([quaternion_from_euler(*row) for row in angles])


# --- lateness -------------------------------------------------------------------------------------------------------
@main.command("lateness")
@click.option("--block", default=0.6, show_default=True, help="Seconds of a block; disturbed and not take turns.")
@click.option("--turns", default=40, show_default=True, help="Blocks of each kind for each fault.")
@FIFO
def lateness(block: float, turns: int, fifo: bool) -> None:
    """The tick's lateness with one device disturbed over that of the undisturbed blocks between."""
    take_priority(fifo)
    rows = measure_lateness(block, turns, FAULTS)
    result = {"fifo": fifo, "faults": rows, "ratio_limit": RATIO_LIMIT, "pass": all(row["pass"] for row in rows)}
    print_json(result)
    raise SystemExit(DONE if result["pass"] else FAILED)


def measure_lateness(block: float, turns: int, faults: Any) -> list[dict[str, Any]]:
    """One flight of the real runtime on twins; in turns, each fault comes and goes."""
    from glider.firmware.runtime import Runtime
    from glider.firmware.telemetry import TICK
    from glider.hal.recorder.recorder import NullRecorder
    from glider.tools.flight.compose import build_flight
    from glider.tools.verify.benchmark.tick import ENDLESS

    with tempfile.TemporaryDirectory() as folder:
        mission = Path(folder, "endless.toml")
        mission.write_text(ENDLESS)
        flight = build_flight(mission=str(mission), board="twin")
    flight.board.open()
    channel = NullRecorder((TICK,)).channel("/tick")
    runtime = Runtime(flight.board, flight.autopilot, flight.supervisor, channel)
    runtime.arm()
    try:
        ticks = round(block / runtime.dt)
        _run_ticks(runtime, channel, ticks)
        rows = []
        with progress("turns", turns * len(faults)) as advance:
            for device, fault in faults:
                rows.append(_one_fault(flight.board, runtime, channel, device, fault, ticks, turns, advance))
        return rows
    finally:
        runtime.disarm()
        flight.board.close()


def _run_ticks(runtime: Any, channel: Any, ticks: int) -> np.ndarray:
    late = np.empty(ticks)
    for i in range(ticks):
        runtime.tick()
        late[i] = channel.values[REC_LATENESS]
    return late


def _one_fault(
    board: Any, runtime: Any, channel: Any, device: str, fault: str, ticks: int, turns: int, advance: Any
) -> dict[str, Any]:
    """Lateness (s) of disturbed and undisturbed blocks in turns; the first 0.2 s of each are not counted."""
    late: dict[bool, list[np.ndarray]] = {False: [], True: []}
    settling_ticks = round(0.2 / runtime.dt)
    for _ in range(turns):
        for disturbed in (False, True):
            board.control(f"fault {device} {fault if disturbed else 'none'}")
            _run_ticks(runtime, channel, settling_ticks)
            late[disturbed].append(_run_ticks(runtime, channel, ticks))
        board.control(f"fault {device} none")
        advance(1)
    calm, bad = (np.concatenate(late[key]) for key in (False, True))
    figures = {
        name: {"undisturbed_us": 1e6 * float(of(calm)), "disturbed_us": 1e6 * float(of(bad))}
        for name, of in (("median", np.median), ("p99", lambda x: np.percentile(x, 99)))
    }
    ratios = {name: row["disturbed_us"] / row["undisturbed_us"] for name, row in figures.items()}
    return {
        "device": device, "fault": fault, "ticks": len(bad), **figures, "ratio": ratios,
        "pass": all(ratio <= RATIO_LIMIT for ratio in ratios.values()),
    }  # fmt: skip


# --- the shipped timings --------------------------------------------------------------------------------------------
ROWS = (
    ("fault imu unplug", sup.FAULT_IMU_LOST), ("fault beacon silent", sup.FAULT_PRESSURE_LOST),
    ("fault ballast silent", sup.FAULT_BUS_LOST), ("fault slider_wire silent", sup.FAULT_WIRE_LOST),
    ("fault servo unplug", sup.FAULT_SERVO_LOST), ("fault beacon stuck", sup.FAULT_STUCK_SENSOR),
    ("fault ballast stuck", sup.FAULT_STALL), ("leak 1", sup.FAULT_LEAK), ("battery 10", sup.FAULT_VOLTAGE),
)  # fmt: skip
DIVE_M, WIRES_S, LINGER_S = 0.6, 0.3, 25.0
JAMMED_S = 1.5 * (0.4 / 0.03 + 0.3)  # s, of a ballast sent over its whole way


@main.command("timings")
@FIFO
def timings(fifo: bool) -> None:
    """Break a device of a twinned flight with the shipped fault timings: when is it noticed, where does it end?

    A row passes if it is noticed within its time, a line's round trip and two ticks, and the plant floats five minutes
    after the end.
    """
    take_priority(fifo)
    with progress("faults", len(ROWS)) as advance:
        rows = []
        for command, row in ROWS:
            rows.append(time_fault(command, row))
            advance(1)
    result = {"fifo": fifo, "faults": rows, "pass": all(row["pass"] for row in rows)}
    print_json(result)
    raise SystemExit(DONE if result["pass"] else FAILED)


def time_fault(command: str, row: int) -> dict[str, Any]:
    """One flight of the shipped vehicle, with voltages, on twins; a command to the twins breaks it under water."""
    import msgspec

    from glider.firmware.faults import FAULT_TABLE
    from glider.firmware.model.supervisor_settings import Limits
    from glider.firmware.supervisor import Supervisor
    from glider.hal.recorder.recorder import NullRecorder
    from glider.tools.flight import sortie
    from glider.tools.flight.compose import build_flight, record_specs

    flight = build_flight(mission="sawtooth", board="twin")
    board: Any = flight.board
    limits = Limits(working_depth_m=50.0, low_voltage=12.0, least_voltage=11.0)
    flight.vehicle = msgspec.structs.replace(flight.vehicle, limits=limits)
    flight.supervisor = Supervisor(
        flight.autopilot, flight.vehicle, flight.mission, dt=1.0 / board.loop_hz, periods=board.periods
    )
    supervisor, begun, adrift = flight.supervisor, float("nan"), float("nan")

    def loop(runtime: Any) -> Any:
        nonlocal begun, adrift
        while not (supervisor.measured_depth() > DIVE_M or flight.autopilot.finished):
            runtime.tick()
        begun = board.clock.now()
        board.control(command)
        end = begun + LINGER_S
        while supervisor.noticed(row) is None and runtime.deadline < end:
            runtime.tick()
        board.control(command.replace(command.split()[-1], "none") if command.startswith("fault") else command)
        flight.autopilot.give_up()
        ending = runtime.run()
        adrift = json.loads(board.control("adrift 300"))["z_m"]
        return ending

    host = sortie.FlightHost(flight, name="timings")
    flown = sortie.fly(flight, host, lambda: NullRecorder(record_specs(flight)), loop=loop)
    noticed = supervisor.noticed(row)
    after = None if noticed is None else noticed - begun
    allowed = JAMMED_S if row == sup.FAULT_STALL else FAULT_TABLE[row].within_s or 0.0
    good = after is not None and after <= allowed + WIRES_S and adrift < 0.5
    return {
        "fault": command, "row": row, "noticed_s": after, "allowed_s": allowed, "reaction": supervisor.worst(row).name,
        "missed_ticks": flown.timing.missed, "ended": flown.ending.name.lower(), "adrift_m": adrift, "pass": good,
    }  # fmt: skip


if __name__ == "__main__":
    main()
