"""`glider fly`: one mission, in simulation or on a board."""

import contextlib
import math
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from glider.tools.cli.common import DONE, FAILED, fail, json_option, print_json, progress, say, say_assumed
from glider.tools.data.errors import InputError

ENDINGS = {
    "SURFACED": "", "PUMP_GIVEN_UP": "at the surface, but the pump did not bring the ballast to its light end",
    "NO_WAY_LEFT": "not at the surface after the mission",
    "HANDED_OVER": "handed over to the out-of-band process, which brings the vehicle up",
}  # fmt: skip


def next_log(mission: str) -> Path:
    """The first name <mission>-NNN.mcap that is free in the working directory."""
    for number in range(1, 100_000):
        path = Path(f"{mission}-{number:03d}.mcap")
        if not path.exists():
            return path
    raise FileExistsError(f"{mission}-NNN.mcap: no number left")


def live_socket(folder: Path | None) -> Path:
    """Where onlookers find a flight: beside its heartbeat."""
    from glider.hal.heartbeat import run_folder
    from glider.tools.flight.live_view import NAME

    folder = folder or run_folder()
    folder.mkdir(parents=True, exist_ok=True, mode=0o750)
    return folder / NAME


@click.command()
@click.option("--mission", default="sawtooth", show_default=True, help="Mission: shipped name or file.")
@click.option("--vehicle", default="roughie", show_default=True, help="Vehicle: shipped name or file.")
@click.option("--board", default="sim", show_default=True, help="Board: sim, twin or a board file.")
@click.option("--log", "log_file", type=click.Path(path_type=Path), help="Log to write.  [default: MISSION-NNN.mcap]")
@click.option("--no-log", is_flag=True, help="Record nothing.")
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0), help="Seed of everything random.")
@click.option("--realtime", is_flag=True, help="Fly the simulated board at the speed of the clock on the wall.")
@click.option(
    "--state",
    "state_folder",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder of the vehicle's state and heartbeat, on devices.",
)
@click.option("--live", "live", is_flag=True, help="Let `glider live` look on, through a local socket.")
@click.option("--acknowledge", is_flag=True, help="A person has looked after a flight that was given up or broke off.")
@click.option("--yes", is_flag=True, help="Arm without asking the person at the terminal, on devices.")
@click.option("--priority", type=click.IntRange(1, 90), help="Real-time priority (SCHED_FIFO); 50 is usual.")
@click.option("--lock-memory", is_flag=True, help="Keep all memory resident (mlockall).")
@click.option("--core", type=click.IntRange(0, 255), help="Keep the loop on one processor core.")
@click.option(
    "--effect", "effects", multiple=True, metavar="LABEL:NAME=VALUE",
    help="Add an effect to the plant; LABEL alone: 1 sigma of its prior (glider effects).",
)  # fmt: skip
@json_option
def fly(
    mission, vehicle, board, log_file, no_log, seed, realtime, state_folder, live, acknowledge, yes, priority,
    lock_memory, core, effects, as_json,
) -> None:  # fmt: skip
    """Fly a mission and record it.

    With --realtime and on devices a status line shows time, depth, pitch, leg and what is left of it. The first Ctrl-C
    gives the dive up and surfaces, the second stops at once. On devices, arming is confirmed at the terminal, a second
    Ctrl-C under water wants a third, and a flight that broke off is never resumed: the next start only brings the
    vehicle up. Exit code 1: the flight, or its log, is not complete.
    """
    from glider.firmware.core.layouts.control_layout import LEG
    from glider.hal.ports import BoardError, Hardware
    from glider.hal.recorder.recorder import NullRecorder, Recorder
    from glider.tools.flight import sortie
    from glider.tools.flight.compose import build_flight, build_recorder, record_specs
    from glider.tools.flight.display import Display
    from glider.tools.flight.precompile import FLIGHT, ensure_compiled
    from glider.tools.flight.terminal import Stop, terminal_detached

    wanted = wanted_effects(effects)
    try:
        flight = build_flight(
            mission=mission, vehicle=vehicle, board=board, seed=seed, realtime=realtime, effects=wanted
        )
    except BoardError as error:
        raise InputError(str(error), source=board) from None
    path = None if no_log else (log_file or next_log(flight.mission.name))
    if path is not None and path.exists():
        raise InputError("is there already; a log is never written over", source=path)

    def make_recorder() -> Recorder | NullRecorder:
        if path is None:
            return NullRecorder(record_specs(flight))
        live_stream = live_socket(state_folder) if live else None
        return build_recorder(flight, path, seed=seed, effects=wanted, live_stream=live_stream)

    ensure_compiled(FLIGHT, say, progress)
    warn_of_margins(flight)
    name = flight.mission.name if path is None else path.stem
    simulated = flight.board.hardware is Hardware.NONE
    host: sortie.FlightHost = sortie.SimulatedHost(flight, name=name, paced=realtime)
    if not simulated:
        say_assumed(vehicle, flight.vehicle.assumed)
        host = keep(flight, name, state_folder, acknowledge, yes, board)
    options, supervisor = RealTimeOptions(priority, lock_memory, core), flight.supervisor
    legs, done = len(flight.mission.leg), 0
    hurried = simulated and not realtime
    display = Display(flight, muted=hurried)
    stop = Stop(
        flight.autopilot.give_up, supervisor.surface_depth, None if simulated else supervisor.measured_depth,
        tell=display.tell,
    )  # fmt: skip
    before = signal.signal(signal.SIGINT, stop)
    try:
        with contextlib.nullcontext() if simulated else terminal_detached(), contextlib.ExitStack() as stack:
            advance: Callable[[int], None] | None = None

            def before_loop() -> None:
                nonlocal advance
                if hurried:
                    advance = stack.enter_context(progress(f"flying {flight.mission.name}", legs))
                options.apply()

            def on_second(t: float) -> None:
                nonlocal done
                display.second(t)
                leg = legs if flight.autopilot.mode == "completed" else int(flight.autopilot.ap[LEG])
                if leg > done and advance is not None:
                    advance(leg - done)
                    done = leg

            flown = sortie.fly(flight, host, make_recorder, log=path, before_loop=before_loop, on_second=on_second)
            if advance is not None:
                advance(legs - done if flight.autopilot.mode == "completed" else 0)
    except KeyboardInterrupt:
        display.end()
        if path is not None and path.exists():
            say(f"the log up to here: {path}")
        raise click.Abort from None
    except BoardError as error:
        fail(f"glider: {board}: not armed: {error}")
    finally:
        display.end()
        signal.signal(signal.SIGINT, before)
    result = summary(flight, host, flown, path, options.said)
    if as_json:
        print_json(result)
    else:
        _tell(result)
    report = flown.report
    # A recording process that was replaced has left a log in parts, and half a second missing.
    recorded = report.complete or (report.parts > 1 and not report.error)
    raise SystemExit(DONE if result["completed"] and recorded else FAILED)


def wanted_effects(effects: tuple[str, ...]) -> dict[str, dict[str, float]]:
    """The effects of --effect; what a label alone stands for is said."""
    from glider.tools.flight.compose import parse_effects

    wanted = parse_effects(effects)
    for label in (item for item in effects if item in wanted):
        values = ",".join(f"{name}={value:g}" for name, value in wanted[label].items())
        say(f"effect {label}:{values}, 1 sigma of its prior")
    return wanted


def warn_of_margins(flight) -> None:
    """Say which axis of the law its gains do not cover."""
    for axis in flight.k2_margins if flight.control.controller != "pid" else ():
        if not axis.covered:
            say(f"warning: {axis}")


def summary(flight, host, flown, path: Path | None, real_time: list[str]) -> dict[str, Any]:
    """What `glider fly --json` prints of a flight that has ended; real_time: what the system was asked for."""
    from glider.firmware.runtime import Ending
    from glider.hal.usage import peak_resident_bytes

    surfaced = flown.ending == Ending.SURFACED
    completed = flight.autopilot.mode == "completed" and surfaced and not host.ascent_only
    reason = (
        (host.journal.before.describe() if host.ascent_only else "")
        or flight.autopilot.reason
        or ("" if completed else ENDINGS[flown.ending.name])
    )
    timing, report = flown.timing, flown.report
    return {
        "completed": completed,
        "seconds": flown.seconds,
        "reason": reason,
        "log": None if path is None else str(path),
        "rms_error": flight.autopilot.rms_errors(),
        "faults": faults_noticed(flight.supervisor),
        "surfaced": surfaced,
        "ended": {"by": flown.ending.name.lower(), "state": flown.state.name.lower()},
        "ticks": timing.ticks,
        "missed_ticks": timing.missed,
        "lateness": timing.histogram(),
        "peak_rss_mb": peak_resident_bytes() / 1e6 or None,
        "records": {
            "written": report.written,
            "dropped": report.dropped,
            "complete": report.complete,
            "parts": report.parts,
            "error": report.error,
            "readable_s": None if path is None or report.complete else readable_s(path),
        },
        "real_time": real_time,
        "devices": flight.board.health(),
        "truth": flight.board.state(),
    }


def readable_s(log: Path) -> float:
    """Seconds of a flight that can be read from its log, parts included; 0 where it is no log."""
    from glider.tools.data.log.parts import read_flight

    try:
        return read_flight(log).duration_s
    except (InputError, OSError):
        return 0.0


class RealTimeOptions:
    """What the flight asks of the system to be punctual, and its outcome."""

    def __init__(self, priority: int | None, lock_memory: bool, core: int | None):
        self._priority, self._lock_memory, self._core = priority, lock_memory, core
        self.said: list[str] = []

    def apply(self) -> None:
        """Ask, just before the loop: what the flight has started keeps its own ways. Said where anything was asked."""
        from glider.hal import realtime

        if self._core is not None:
            self.said.append(realtime.pin_to_core(self._core))
        if self._priority is not None:
            self.said.append(realtime.take_priority(self._priority))
        if self._lock_memory:
            self.said.append(realtime.lock_memory())
        if self.said:
            with contextlib.suppress(OSError):
                say(f"{', '.join(self.said)}, collector frozen")


def faults_noticed(supervisor) -> list[dict]:
    """Rows of the fault table that asked for something: when first, and for what at most."""
    from glider.firmware.faults import FAULTS

    return [
        {"number": row, "name": FAULTS[row], "noticed_s": at, "reaction": supervisor.worst(row).name}
        for row in FAULTS
        if (at := supervisor.noticed(row)) is not None
    ]


def keep(flight, name: str, folder: Path | None, acknowledge: bool, yes: bool, board: str):
    """The host of a flight on devices (flight/keeper): claimed, and the person asked. Ends with exit code 1 where the
    vehicle is not to be armed."""
    from glider.hal.ports import BoardError
    from glider.hal.sortie import SortieState
    from glider.tools.flight.keeper import FlightSupervision
    from glider.tools.flight.terminal import confirm_arming

    keeper = FlightSupervision(flight, name=name, folder=folder, twin=flight.twinned)
    try:
        acknowledged = keeper.claim(acknowledged=acknowledge)
    except BoardError as error:
        fail(f"glider: {board}: not armed: {error}")
    if acknowledged is not None:
        say(f"acknowledged: {acknowledged.describe()}")
    before = keeper.journal.before
    if before.state == SortieState.HELD:
        fail(f"glider: not armed: {before.describe()}; look at the vehicle, then `glider acknowledge`")
    if before.state.must_ascend:
        say(f"ascending only: {before.describe()}")
    elif not (yes or flight.twinned or confirm_arming(f"{board}, {flight.mission.name}")):
        fail("glider: not armed: not confirmed (without a terminal: --yes)")
    return keeper


def _tell(result: dict) -> None:
    """The flight in a few lines, for a person."""
    ended = "completed" if result["completed"] else f"NOT completed: {result['reason']}"
    say(f"{ended} after {result['seconds']:.1f} s")
    errors = result["rms_error"]
    parts = []
    if errors["depth_m"] is not None:
        parts.append(f"depth {100 * errors['depth_m']:.1f} cm")
    for name in ("pitch_rad", "roll_rad"):
        if errors[name] is not None:
            parts.append(f"{name[:-4]} {math.degrees(errors[name]):.2f} deg")
    say(f"rms against the reference: {', '.join(parts)}")
    if result["missed_ticks"]:
        say(f"{result['missed_ticks']} of {result['ticks']} ticks missed")
    for fault in result["faults"]:
        say(f"fault {fault['number']}, {fault['name']}: {fault['reaction']}, first at {fault['noticed_s']:.1f} s")
    for name, device in result.get("devices", {}).items():
        if device["notes"]:
            say(f"{name}: {'; '.join(device['notes'])}")
    records = result["records"]
    if records["parts"] > 1:
        say(f"the recording process was replaced: the log goes on in part {records['parts']} (`glider log info`)")
        if records["dropped"]:
            say(f"{records['dropped']} records dropped")
    elif not records["complete"]:
        why = f" ({records['error']})" if records["error"] else ""
        say(
            f"the log is not complete{why}: {records['readable_s']:.1f} of {result['seconds']:.1f} s can be read from "
            f"it, {records['dropped']} records were dropped"
        )
    if result["log"]:
        click.echo(result["log"])
