"""The composition root: the one place that builds a flight out of vehicle, mission, board and recorder."""

import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from glider.firmware.autopilot import Autopilot, configuration
from glider.firmware.core.layouts.control_layout import SURFACE_PRESSURE
from glider.firmware.core.layouts.supervisor_layout import RESTARTED
from glider.firmware.core.vehicle.seawater import water_density
from glider.firmware.faults import Reaction
from glider.firmware.guidance.mission import Mission
from glider.firmware.model.gains import Control
from glider.firmware.model.k2_margin import K2Margin, k2_margins
from glider.firmware.model.vehicle import Vehicle
from glider.firmware.runtime import Runtime
from glider.firmware.supervisor import Supervisor
from glider.firmware.telemetry import TICK
from glider.hal.board import BoardRequest, board_builder
from glider.hal.ports import ACTUATORS, Board, Hardware
from glider.hal.recorder.recorder import Recorder
from glider.hal.recorder.schema import DEBUG, ERROR, FATAL, INFO, WARN
from glider.hal.strict import ConfigError
from glider.tools.data.boards import load_board_file
from glider.tools.data.errors import InputError
from glider.tools.data.sources import load_mission, load_vehicle, name_or_path
from glider.tools.data.version import software

LEAST_REACH = 0.5  # of an end of an actuator's range, which the board has to leave the vehicle
SEVERITIES = dict(zip(Reaction, (DEBUG, INFO, WARN, WARN, ERROR, FATAL, FATAL), strict=True))


@dataclass
class Flight:
    """All that flies: ready to be armed."""

    vehicle: Vehicle
    mission: Mission
    board: Board
    autopilot: Autopilot
    supervisor: Supervisor
    texts: dict[str, str]

    @property
    def k2_margins(self) -> tuple[K2Margin, K2Margin]:
        """The law's k2 of pitch and depth against what this vehicle's [uncertainty] asks for."""
        return k2_margins(self.vehicle, self.control)

    @property
    def control(self) -> Control:
        """The gains that count: the mission's, else the vehicle's, else the defaults."""
        return self.mission.control or self.vehicle.control or Control()

    def count_depth_from(self, pressure: float) -> None:
        """Set the pressure (Pa, absolute) at which depth is zero, for board and autopilot."""
        self.board.surface_pressure = self.autopilot.C[SURFACE_PRESSURE] = pressure

    @property
    def twinned(self) -> bool:
        """Whether the devices are twins that the board itself starts: nothing real moves."""
        return self.board.hardware is Hardware.TWINNED


def parse_effects(items: tuple[str, ...]) -> dict[str, dict[str, float]]:
    """`label:parameter=value,...` items as a dictionary; InputError says which item is wrong.

    A label alone has 1 sigma of its prior.
    """
    from glider.sim_backend.core.effects.base import EffectError
    from glider.sim_backend.core.effects.catalogue import catalogue, check_flown

    effects: dict[str, dict[str, float]] = {}
    for item in items:
        label, _, rest = item.partition(":")
        values = {}
        for pair in filter(None, rest.split(",")):
            name, _, number = pair.partition("=")
            try:
                values[name.strip()] = float(number)
            except ValueError:
                raise InputError(f"expected label:parameter=number, got '{item}'", source="--effect") from None
        if not values and label in catalogue():
            values = catalogue()[label].usual
        try:
            check_flown(label, values)
        except EffectError as error:
            raise InputError(str(error), source="--effect") from None
        effects[label] = values
    return effects


def build_flight(
    *,
    mission: str,
    vehicle: str = "roughie",
    board: str = "sim",
    seed: int = 0,
    realtime: bool = False,
    effects: dict[str, dict[str, float]] | None = None,
) -> Flight:
    """Vehicle, mission, board and autopilot by name or path; raises ConfigError, InputError or BoardError."""
    vehicle_text, the_vehicle = load_vehicle_text(vehicle)
    mission_text, mission_source, the_mission = load_mission(mission)
    board_file = load_board_file(board)
    request = BoardRequest(
        text=board_file.text, source=board_file.source, vehicle=the_vehicle, seed=seed, realtime=realtime,
        site_depth=the_mission.site.depth_m, water_density=water_density(0.0, 20.0, the_mission.site.salinity),
        effects=effects or {},
    )  # fmt: skip
    the_board = board_builder(board_file.kind)(request)
    limits = {name: getattr(the_board, name).limits for name in ACTUATORS}
    the_vehicle = within(the_vehicle, limits, board_file.source)
    autopilot, supervisor = build_pilot(
        the_vehicle, the_mission, mission_source, loop_hz=the_board.loop_hz, periods=the_board.periods,
        surface_pressure=the_board.surface_pressure,
    )  # fmt: skip
    texts = {"vehicle.toml": vehicle_text, "mission.toml": mission_text, "board.toml": board_file.text}
    return Flight(the_vehicle, the_mission, the_board, autopilot, supervisor, texts)


def within(vehicle: Vehicle, limits: dict[str, tuple[float, float]], source: str) -> Vehicle:
    """The vehicle with its actuators' ranges narrowed to what a board lets them do; limits: by actuator, in its unit.

    ConfigError where less than LEAST_REACH of an end is left: what lifts, trims and steers the vehicle is not there.
    """
    tables = {}
    for name, (low, high) in limits.items():
        table = getattr(vehicle.actuators, name)
        for end, own, left in (("low", table.range[0], low), ("high", table.range[1], high)):
            if left / own < LEAST_REACH:
                message = f"the {name}'s {end} end is {left:.4g}, of the vehicle's {own:.4g}: too little to fly with"
                raise ConfigError(source, message, key=f"{name}.limits")
        tables[name] = msgspec.structs.replace(table, range=(low, high))
    return msgspec.structs.replace(vehicle, actuators=msgspec.structs.replace(vehicle.actuators, **tables))


def build_pilot(
    vehicle: Vehicle, mission: Mission, source: str, *, loop_hz: float, periods: dict[str, float],
    surface_pressure: float, restarted: bool = False,
) -> tuple[Autopilot, Supervisor]:  # fmt: skip
    """Build the autopilot and the supervisor that watches it, for a flight or for its replay.

    source: of the mission, for errors; periods: of the sensors' samples, s; surface_pressure: Pa; restarted: an earlier
    flight did not end in order.
    """
    dt = 1.0 / loop_hz
    C = configuration(vehicle, mission, dt=dt, periods=periods, surface_pressure=surface_pressure)
    autopilot = Autopilot(vehicle, mission, C, source)
    return autopilot, Supervisor(autopilot, vehicle, mission, dt=dt, periods=periods, restarted=restarted)


def load_vehicle_text(wanted: str) -> tuple[str, Vehicle]:
    """A vehicle's text and the vehicle."""
    vehicle = load_vehicle(wanted)  # first: it says of another kind of vehicle that it is one
    text, _ = name_or_path(wanted, "vehicle", "model/vehicles")
    return text, vehicle


def log_metadata(flight: Flight, *, seed: int, effects: dict[str, dict[str, float]]) -> dict[str, str]:
    """What a log says of itself; what the simulation hides from the vehicle is not in it, but for the seed.

    Called once the vehicle is armed: the entries that a replay needs are those that the flight begins with.
    """
    site = flight.mission.site
    return {
        "software": software(),
        "vehicle": flight.vehicle.name,
        "mission": flight.mission.name,
        "board": flight.board.name,
        "site": site.name,
        "log_rate_hz": f"{flight.board.loop_hz:g}",
        "water_density_kg_m3": f"{water_density(0.0, 20.0, site.salinity):.2f}",
        "seed": str(seed),
        "effects": ", ".join(effects),
        "loop_hz": repr(float(flight.board.loop_hz)),
        "periods_s": json.dumps(flight.board.periods),
        "surface_pressure_pa": repr(float(flight.autopilot.C[SURFACE_PRESSURE])),
        "restarted": "true" if flight.supervisor.G[RESTARTED] == 1.0 else "false",
        "actuator_limits": json.dumps({name: getattr(flight.board, name).limits for name in ACTUATORS}),
    }


def record_specs(flight: Flight) -> tuple:
    """What this flight records: the ticks, and the plant's truth where there is a plant."""
    return (TICK, *flight.board.records)


def build_recorder(
    flight: Flight, path: Path, *, seed: int = 0, effects: dict[str, dict[str, float]] | None = None,
    live_stream: Path | None = None,
) -> Recorder:  # fmt: skip
    """Build the recorder of an armed flight, with all that its log says of it; the board is open.

    Its log times are Unix time: the wall clock is read here, once, and the board's clock counts on from it.
    """
    return Recorder(
        path, record_specs(flight), attachments=flight.texts,
        metadata=log_metadata(flight, seed=seed, effects=effects or {}),
        epoch_ns=time.time_ns() - round(1e9 * flight.board.clock.now()), live_stream=live_stream,
    )  # fmt: skip


def build_runtime(flight: Flight, recorder: Any) -> Runtime:
    """The loop, recording into `recorder`; the board is open, for that is when a real clock starts."""

    def on_news(t: float, reaction: Reaction, text: str) -> None:
        recorder.event(t, SEVERITIES[reaction], text)

    return Runtime(
        flight.board, flight.autopilot, flight.supervisor, recorder.channel("/tick"),
        extras=flight.board.recording(recorder.channel), on_news=on_news,
    )  # fmt: skip
