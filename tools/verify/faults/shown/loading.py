"""Faults that are refused before anything moves: a vehicle not fit to arm, files that hold what they may not."""

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from glider.firmware.model.supervisor_settings import Limits
from glider.hal.strict import ConfigError
from glider.tools.verify.faults.cases import GroundOutcome, observed

UNFIT = (
    "depth not zero", "no weather's pressure", "limits unset", "never calibrated", "wrong hash", "wet hull",
    "flat battery", "drive in alarm", "gyro turns", "wire out of range", "tank cannot be emptied",
)  # fmt: skip


def arming(kind: str) -> Callable[[bool, Path], GroundOutcome]:
    """A vehicle that is not fit to arm; calibrations are those of a real board file."""

    def show(disabled: bool, folder: Path) -> GroundOutcome:
        import msgspec

        from glider.hal.board import BoardRequest, board_builder
        from glider.sim_backend.board import SimBoard
        from glider.sim_backend.faults import break_in
        from glider.tools.data.boards import load_board_file
        from glider.tools.flight.arming import Arming
        from glider.tools.flight.compose import build_flight

        flight = build_flight(mission="sawtooth")
        board = flight.board
        assert isinstance(board, SimBoard)
        broken = break_in(board)
        board.open()
        limits = None if kind == "limits unset" else Limits(working_depth_m=50.0, low_voltage=12.0)
        flight.vehicle = msgspec.structs.replace(flight.vehicle, limits=limits)
        if kind == "depth not zero":
            board.world.x[2] = 3.0
        elif kind == "no weather's pressure":
            board.surface_pressure += 8_000.0
        elif kind == "wet hull":
            broken.leak.value = 1.0
        elif kind == "flat battery":
            broken.battery.value = 11.0
        elif kind == "drive in alarm":
            broken.pump.begin("alarm_kept")
        elif kind == "gyro turns":
            board.imu.begin("jump", drift=(0.0, 0.0, 0.0, 2.0, 0.0, 0.0))  # type: ignore[attr-defined]
        elif kind == "wire out of range":
            board.slider_wire.begin("jump", drift=(0.1,))  # type: ignore[attr-defined]
        elif kind == "tank cannot be emptied":
            return _narrow_tank(disabled, flight.vehicle)
        if kind in ("never calibrated", "wrong hash"):
            file = load_board_file("twin")
            old, new = {
                "never calibrated": ("calibration = ", 'calibration = ""  # '),
                "wrong hash": ("per_m = 80000.0", "per_m = -80000.0"),
            }[kind]
            text = file.text.replace(old, new)
            request = BoardRequest(text=text, source="board.toml", vehicle=flight.vehicle)
            doubtful = board_builder("twin")(request)
            board.check_calibration = doubtful.check_calibration  # type: ignore[method-assign]
            doubtful.close()
        checks = Arming(flight, folder=folder, hardware=True).run(disabled)
        refused = any(not check.passed for check in checks)
        return observed(refused, "refuse to arm", "armed")

    return show


def _narrow_tank(disabled: bool, vehicle: Any) -> GroundOutcome:
    """A board file whose drive empties less than half of the tank."""
    from glider.tools.flight.compose import within

    low, high = vehicle.actuators.ballast.range
    limits = {name: getattr(vehicle.actuators, name).range for name in ("servo", "slider", "ballast")}
    limits["ballast"] = (low if disabled else 0.1 * low, high)
    try:
        within(vehicle, limits, "board.toml")
    except ConfigError as error:
        return observed("board.toml: ballast.limits" in str(error), "refuse to arm", str(error))
    return observed(False, "refuse to arm", "armed")


def bad_files(disabled: bool, folder: Path) -> GroundOutcome:
    """Files with an unknown key, a wrong type, NaN, out of limits, too deep, no end."""
    from glider.firmware.guidance.mission import decode_mission
    from glider.firmware.model.library import shipped
    from glider.firmware.model.vehicle import decode_vehicle
    from glider.hal.boardfile import decode_device_file
    from glider.tools.data.boards import load_board_file

    vehicle, mission = shipped("model/vehicles")["roughie"], shipped("guidance/missions")["sawtooth"]
    board = load_board_file("roughie").text
    bad = [
        (decode_vehicle, vehicle.replace("K_D0 =", "K_D00 ="), "K_D00"),
        (decode_vehicle, vehicle.replace("m_t = 13.0", 'm_t = "heavy"'), "m_t"),
        (decode_vehicle, vehicle.replace("K_q = -8.0", "K_q = nan"), "K_q"),
        (decode_vehicle, vehicle.replace("m_t = 13.0", "m_t = 1e9"), "m_t"),
        (decode_mission, mission.replace("depth_m = 4.0", "depth_m = 40.0"), "depth_m"),
        (decode_mission, mission.replace("time_limit_s = 120.0", "", 1), "time_limit_s"),
        (decode_mission, mission.replace("time_limit_s = 600.0", "time_limit_s = inf"), "time_limit_s"),
        (decode_mission, mission + "\n[a.b.c.d.e.f.g.h.i]\nj = 1\n", "a"),
        (decode_device_file, board.replace("per_m", "per_mm"), "per_mm"),
        (decode_device_file, board.replace('port = "imu"', "port = 5", 1), "port"),
    ]
    refused = 0
    for decode, text, key in bad:
        try:
            tomllib.loads(text) if disabled else decode(text, "file.toml")
        except ConfigError as error:
            refused += "file.toml:" in str(error) and key in str(error) and "\n" not in str(error)
    return observed(refused == len(bad), "refused", f"{len(bad) - refused} of {len(bad)} read")
