"""`glider check`: are the files of a flight fit to fly with?"""

import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any, NoReturn

import click

from glider.tools.cli.common import DONE, FAILED, json_option, print_json, say, say_assumed
from glider.tools.data.errors import InputError


@click.command()
@click.option("--vehicle", default="roughie", show_default=True, help="Vehicle: shipped name or file.")
@click.option("--mission", default="sawtooth", show_default=True, help="Mission: shipped name or file.")
@click.option("--board", default="sim", show_default=True, help="Board: shipped name or file.")
@click.option("--signs", is_flag=True, help="Lead through signs and axes of a board's devices, step by step.")
@click.option("--live", is_flag=True, hidden=True)
@click.option("--compile", "compile_", is_flag=True, hidden=True)
@click.option("--acknowledge", is_flag=True, hidden=True)
@click.option("--state", type=click.Path(path_type=Path, file_okay=False), hidden=True)
@json_option
@click.pass_context
def check(
    context: click.Context, vehicle: str, mission: str, board: str, signs: bool, as_json: bool, **moved: Any
) -> None:  # fmt: skip
    """Check vehicle, mission and board files, and that they go together.

    A board of devices (or of their twins) is talked to: every device says what it has, and its calibration is the one
    that was accepted. With --signs a person helps: nose up, roll to starboard, mass forward, pump in. Of the law it
    says whether its k2 covers the vehicle's [uncertainty] and [disturbance]; that it does not is a warning.

    Exit code 0: all fit to fly with; 1: something is not; each finding in a line of its own.
    """
    if moved["live"] or moved["compile_"] or moved["acknowledge"]:
        _moved(context, as_json=as_json, **moved)
    from glider.firmware.core.jit import CACHE_DIR
    from glider.firmware.model.k2_margin import K2Margin
    from glider.hal.ports import BoardError
    from glider.hal.strict import ConfigError
    from glider.tools.data.boards import load_board_file
    from glider.tools.data.sources import load_mission, load_vehicle
    from glider.tools.flight.compose import build_flight

    findings: list[dict] = []
    covers: list[K2Margin] = []

    def look(name: str, work) -> bool:
        try:
            said = work()
        except (ConfigError, InputError, BoardError) as error:
            findings.append({"check": name, "pass": False, "message": str(error)})
            return False
        findings.append({"check": name, "pass": True, "message": said})
        return True

    def see_vehicle() -> str:
        found = load_vehicle(vehicle)
        say_assumed(vehicle, found.assumed)
        return f"{found.name}: {found.mass.m_t:g} kg, ballast {found.actuators.ballast.range[0]:+g} to " + (
            f"{found.actuators.ballast.range[1]:+g} kg"
        )

    def see_mission() -> str:
        _, _, found = load_mission(mission)
        return f"{found.name}: {len(found.leg)} legs, site {found.site.name}, {found.site.depth_m:g} m deep"

    def see_board() -> str:
        found = load_board_file(board)
        return f"{found.source}: kind {found.kind}"

    def see_all() -> str:
        flight = build_flight(mission=mission, vehicle=vehicle, board=board)
        covers.extend(flight.k2_margins)
        return f"a loop of {flight.board.loop_hz:g} Hz, controller {flight.control.controller}"

    good = [look("vehicle", see_vehicle), look("mission", see_mission), look("board", see_board)]
    if all(good):
        good.append(look("together", see_all))
    for cover in covers:  # a warning at most: the law flies all the same, only that V falls is then not guaranteed
        finding = {"check": "law", "pass": True, "warning": not cover.covered, "message": str(cover)}
        findings.append({**finding, **asdict(cover)})
    if all(good) and load_board_file(board).kind != "sim":
        found = talk(board, vehicle, signs)
        found += arming_list(mission, vehicle, board)
        findings += found
        good += [finding["pass"] for finding in found]
    kernels = "plain Python (GLIDER_JIT=0)" if CACHE_DIR is None else str(CACHE_DIR)
    findings.append({"check": "kernels", "pass": True, "message": f"compiled into {kernels}"})
    if as_json:
        print_json({"pass": all(good), "findings": findings})
    else:
        for finding in findings:
            word = "FAIL" if not finding["pass"] else "warn" if finding.get("warning") else "ok  "
            click.echo(f"{word}  {finding['check']:<20} {finding['message']}")
    raise SystemExit(DONE if all(good) else FAILED)


def _moved(context: click.Context, **asked: Any) -> NoReturn:
    """What were options of `check` and are commands now: named, then done."""
    from glider.tools.cli.acknowledge import acknowledge
    from glider.tools.cli.compile_ import compile_
    from glider.tools.cli.status import status

    state = asked["state"]
    for option, command, given in (
        ("compile_", compile_, {"as_json": asked["as_json"]}), ("acknowledge", acknowledge, {"state": state}),
        ("live", status, {"state": state, "as_json": asked["as_json"]}),
    ):  # fmt: skip
        if asked[option]:
            say(f"`glider check --{option.rstrip('_')}` is now `glider {command.name}`")
            context.invoke(command, **given)
    raise SystemExit(DONE)


def arming_list(mission: str, vehicle: str, board: str) -> list[dict]:
    """Findings of the arming list, as `glider fly` would have them; the board is opened and given back."""
    import contextlib

    from glider.hal.ports import BoardError
    from glider.tools.flight.arming import Arming
    from glider.tools.flight.compose import build_flight

    flight = build_flight(mission=mission, vehicle=vehicle, board=board)
    try:
        flight.board.open()
    except BoardError as error:
        return [{"check": "arming", "pass": False, "message": str(error)}]
    with contextlib.closing(flight.board):
        checks = Arming(flight, folder=Path.cwd(), hardware=not flight.twinned).run()
    return [{"check": f"arming: {item.name}", "pass": item.passed, "message": item.reason} for item in checks]


def talk(board: str, vehicle: str, signs: bool) -> list[dict]:
    """Findings of a board's devices; ports are given back and actuators stopped before this returns."""
    from glider.hal.boardfile import DeviceFile, calibration_hash, decode_device_file
    from glider.sim_backend.twins.boardfile import decode_twin_file
    from glider.tools.bench.client import Bench, BenchError
    from glider.tools.bench.signs import SignFinding, Signs, look
    from glider.tools.data.boards import load_board_file

    found = load_board_file(board)
    read = decode_twin_file if found.kind == "twin" else decode_device_file
    file: DeviceFile = read(found.text, found.source)
    accepted = file.calibration == calibration_hash(file)
    said = "as accepted" if accepted else "not the one accepted, or never accepted; see glider bench, `accept`"
    items = [SignFinding("calibration", accepted, said)]
    try:
        with Bench(found.text, found.source, found.kind, vehicle, None) as bench:
            items += look(bench)
            if signs:
                items += Signs(bench, _ask).run()
    except BenchError as error:
        items.append(SignFinding("devices", False, str(error)))
    return [{"check": item.check, "pass": item.passed, "message": item.message} for item in items]


def _ask(question: str) -> str:
    """A person's answer, or the next line of a pipe."""
    click.echo(question, err=True, nl=sys.stdin.isatty() is False)
    return sys.stdin.readline().strip()
