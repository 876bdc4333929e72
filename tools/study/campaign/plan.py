"""What a campaign flies: its strict file, and the files that it names."""

import math
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import msgspec
import numpy as np

from glider.firmware.autopilot import Autopilot, configuration
from glider.firmware.core.control.controller_rows import CONTROLLERS
from glider.firmware.guidance.mission import Mission, decode_mission
from glider.firmware.model.gains import BEST_TUNED, Control
from glider.firmware.model.vehicle import Vehicle
from glider.hal.strict import Table, decode
from glider.sim_backend.board import SimBoardFile
from glider.sim_backend.core.effects.catalogue import check_board
from glider.tools.data.boards import load_board_file
from glider.tools.data.errors import InputError
from glider.tools.data.sources import load_vehicle, name_or_path, read_text

if TYPE_CHECKING:
    Flown = str
else:
    Flown = Literal[(*CONTROLLERS, "pid_tuned")]

Name = Annotated[str, msgspec.Meta(min_length=1, max_length=1000)]
Times = Annotated[float, msgspec.Meta(ge=0.0, le=100.0)]


def _check_range(name: str, pair: tuple[float, float], least: float, most: float) -> None:
    low, high = pair
    if not least <= low <= high <= most:
        raise ValueError(f"{name}: expected [low, high] within {least:g} to {most:g}, got [{low:g}, {high:g}]")


class SpreadTable(Table):
    """[spread]: how far vehicle and sensors are from their file, each in times what the file says."""

    parameters: Times = 1.0  # of [uncertainty]
    sensor_bias: Times = 1.0
    sensor_noise: Times = 1.0


class WaterTable(Table):
    """[environment]: what is drawn for each world, evenly from 0 to the number given or between the two given."""

    current_m_s: Annotated[float, msgspec.Meta(ge=0.0, le=5.0)] = 0.0
    wave_height_m: Annotated[float, msgspec.Meta(ge=0.0, le=20.0)] = 0.0
    wave_period_s: tuple[float, float] = (3.0, 8.0)
    disturbance: tuple[float, float] | None = None  # m/s2 and rad/s2, the same number; None: the vehicle file's

    def __post_init__(self):
        _check_range("wave_period_s", self.wave_period_s, 0.6, 60.0)
        if self.disturbance is not None:
            _check_range("disturbance", self.disturbance, 0.0, 5.0)


class StartTable(Table):
    """[start]: the depth at which flights begin, drawn evenly between the two."""

    depth_m: tuple[float, float] = (0.3, 0.3)

    def __post_init__(self):
        _check_range("depth_m", self.depth_m, 0.0, 1000.0)


class Campaign(Table):
    """A campaign file. Every world is flown by every controller; a mission has `seeds` worlds of its own."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    name: Annotated[str, msgspec.Meta(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$")]
    missions: Annotated[list[Name], msgspec.Meta(min_length=1, max_length=100)]
    controllers: Annotated[list[Flown], msgspec.Meta(min_length=1)]
    seeds: Annotated[int, msgspec.Meta(ge=1, le=1_000_000)]
    first_seed: Annotated[int, msgspec.Meta(ge=0, le=2**31)] = 0
    vehicle: Name = "roughie"
    board: Name = "sim"
    description: str = ""
    spread: SpreadTable = SpreadTable()
    environment: WaterTable = WaterTable()
    start: StartTable = StartTable()

    def __post_init__(self):
        for key in ("missions", "controllers"):
            values = getattr(self, key)
            twice = next((value for value in values if values.count(value) > 1), None)
            if twice is not None:
                raise ValueError(f"{key}: '{twice}' stands there twice")


def shipped_campaigns() -> dict[str, str]:
    """Name -> text of the campaigns that come with the package."""
    folder = files("glider.tools.study.campaign").joinpath("campaigns")
    entries = sorted(folder.iterdir(), key=lambda entry: entry.name)
    return {e.name.removesuffix(".toml"): e.read_text(encoding="utf-8") for e in entries if e.name.endswith(".toml")}


def load_campaign(wanted: str) -> tuple[Campaign, Path | None]:
    """A campaign by shipped name or path, and the folder of its file, to which the files it names are relative."""
    library = shipped_campaigns()
    if wanted in library:
        return decode(library[wanted], Campaign, f"{wanted} (shipped)"), None
    path = Path(wanted)
    if not path.is_file():
        raise InputError(f"no campaign '{wanted}': neither a file nor one of {', '.join(library)}")
    return decode(read_text(path), Campaign, wanted), path.parent


def with_options(campaign: Campaign, options: dict[str, Any]) -> Campaign:
    """The campaign with what the command line says; keys as in the file, `table.key` in a table, None: not given."""
    raw = msgspec.to_builtins(campaign)
    for key, value in options.items():
        if value is None:
            continue
        if any(isinstance(number, float) and not math.isfinite(number) for number in np.atleast_1d(value)):
            raise InputError("expected a finite number", source="options", column=key)
        table, _, name = key.rpartition(".")
        (raw[table] if table else raw)[name] = list(value) if isinstance(value, tuple) else value
    try:
        return msgspec.convert(raw, Campaign, strict=True)
    except msgspec.ValidationError as error:
        raise InputError(str(error), source="options") from None


@dataclass(frozen=True)
class CampaignPlan:
    """A campaign with every file that it names: all that a worker needs, wherever it runs."""

    campaign: Campaign
    vehicle: Vehicle
    missions: tuple[Mission, ...]
    board: SimBoardFile

    @property
    def step(self) -> float:
        """The loop's step, s."""
        return 1.0 / self.board.loop_hz

    @property
    def flights(self) -> int:
        return len(self.missions) * self.campaign.seeds * len(self.campaign.controllers)

    def pilot(self, mission: int, controller: str) -> Autopilot:
        """An autopilot of a mission (by its number) under one of the controllers."""
        the_mission, sensors = self.missions[mission], self.board.sensors
        base = the_mission.control or self.vehicle.control or Control()
        flown = msgspec.structs.replace(the_mission, control=_control(controller, base))
        C = configuration(self.vehicle, flown, dt=self.step, periods=sensors.periods)
        return Autopilot(self.vehicle, flown, C, the_mission.name)


def _control(controller: str, base: Control) -> Control:
    """The [control] table of a controller by its name in a campaign."""
    if controller == "pid_tuned":
        return msgspec.structs.replace(base, controller="pid", pitch=BEST_TUNED.pitch, depth=BEST_TUNED.depth)
    try:
        return msgspec.structs.replace(base, controller=controller)
    except ValueError as error:
        raise InputError(str(error)) from None


def build_plan(campaign: Campaign, base: Path | None = None) -> CampaignPlan:
    """Read what the campaign names; ConfigError or InputError where it cannot be flown."""
    missions = []
    for wanted in campaign.missions:
        text, source = name_or_path(wanted, "mission", "guidance/missions", base)
        missions.append(decode_mission(text, source))
    names = [mission.name for mission in missions]
    if len(set(names)) < len(names):
        raise InputError(f"two missions of one name among {', '.join(names)}: worlds are drawn by name")
    board = load_board_file(campaign.board)
    if board.kind != "sim":
        raise InputError(f"a campaign flies in simulation, board '{campaign.board}' is of kind '{board.kind}'")
    file = decode(board.text, SimBoardFile, board.source)
    check_board(file.effects, board.source)
    plan = CampaignPlan(campaign, load_vehicle(campaign.vehicle, base), tuple(missions), file)
    for number in range(len(missions)):
        for controller in campaign.controllers:
            plan.pilot(number, controller)  # refuses what the vehicle cannot do
    return plan
