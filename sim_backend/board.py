"""The simulated board: the ports of a real one, moved by the plant. Its `world` is the way in for tests and physics."""

from collections.abc import Callable
from typing import Annotated, Any

import msgspec
import numpy as np

from glider.firmware.core.vehicle.layout import X_ACT
from glider.hal import ports
from glider.hal.board import BoardRequest
from glider.hal.clocks import MonotonicClock
from glider.hal.recorder.schema import Field, RecordSpec
from glider.hal.strict import Table, decode
from glider.sim_backend.core import layout as wl
from glider.sim_backend.core.effects.catalogue import check_board
from glider.sim_backend.core.world import write_truth
from glider.sim_backend.world import Environment, SampledSensors, Start, World, build_world

TRUTH = RecordSpec(
    "/truth",
    "glider/msg/Truth",
    tuple(
        Field(name, unit=unit, description=text)
        for name, unit, text in (
            ("t_s", "s", "time of the simulated world"),
            ("true_x_m", "m", "north"),
            ("true_y_m", "m", "east"),
            ("true_z_m", "m", "down"),
            ("true_roll_rad", "rad", "roll"),
            ("true_pitch_rad", "rad", "pitch"),
            ("true_yaw_rad", "rad", "yaw"),
            ("true_u_m_s", "m/s", "surge through the water"),
            ("true_v_m_s", "m/s", "sway through the water"),
            ("true_w_m_s", "m/s", "heave through the water"),
            ("true_p_rad_s", "rad/s", "roll rate"),
            ("true_q_rad_s", "rad/s", "pitch rate"),
            ("true_r_rad_s", "rad/s", "yaw rate"),
            ("true_servo_rad", "rad", "servo angle"),
            ("true_slider_m", "m", "slider position"),
            ("true_ballast_kg", "kg", "net ballast mass"),
        )
    ),
    spare=True,
)


class SimBoardFile(Table):
    """A board file of kind "sim"."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    kind: str
    loop_hz: Annotated[float, msgspec.Meta(gt=0.0, le=100.0)] = 50.0
    sensors: SampledSensors = SampledSensors()
    environment: Environment = Environment()
    start: Start = Start()
    effects: dict[str, dict[str, float]] = msgspec.field(default_factory=dict)


class SimulatedSensor:
    """A sensor whose newest delivered sample the world keeps in its frame."""

    def __init__(self, slot: np.ndarray):
        self._slot = slot

    def read(self, out: np.ndarray) -> None:
        out[...] = self._slot  # [:] would make a view


class SimulatedActuator:
    """An actuator of the plant: takes a command within its range and says what it took, and that it is well."""

    def __init__(self, world: World, index: int, limits: tuple[float, float]):
        self._world, self._commands, self._index = world, world.cmd, index
        self.limits = self._low, self._high = limits

    def read(self, out: np.ndarray) -> None:
        out[0], out[1], out[2] = self._world.time, ports.Validity.VALID, ports.Condition.WELL

    def command(self, value: float) -> float:
        if value != value:
            value = self._commands[self._index]
        elif value < self._low:
            value = self._low
        elif value > self._high:
            value = self._high
        self._commands[self._index] = value
        return value


class SimulatedClock:
    """Time is the plant's: waiting moves the world."""

    def __init__(self, world: World):
        self._world = world
        self._now = 0.0

    def now(self) -> float:
        return self._now

    def sleep_until(self, deadline: float) -> None:
        if deadline > self._now:
            self._now = self._world.advance(deadline)


class PacedClock(MonotonicClock):
    """Real time that takes the simulated world with it; a late tick finds the present, as with real devices.

    The world moves in whole steps, to the nearest: half a step is taken off, so that no sample is of the future.
    """

    def __init__(self, world: World):
        super().__init__()
        self._world = world

    def sleep_until(self, deadline: float) -> None:
        super().sleep_until(deadline)
        self._world.advance(max(deadline, self.now()) - 0.5 * self._world.dt)


class SimBoard:
    """All devices of the nominal vehicle, simulated. Leak, battery, drop weight and the like are not fitted."""

    hardware = ports.Hardware.NONE
    records: tuple[RecordSpec, ...] = (TRUTH,)
    imu: ports.SensorPort
    beacon: ports.SensorPort
    slider_wire: ports.SensorPort
    plunger_wire: ports.SensorPort
    servo: ports.ActuatorPort
    slider: ports.ActuatorPort
    ballast: ports.ActuatorPort
    watchdog = None

    def __init__(self, file: SimBoardFile, world: World, vehicle: Any, *, realtime: bool):
        self.name = "sim"
        self.file, self.world, self.loop_hz = file, world, file.loop_hz
        self.periods = file.sensors.periods
        self.surface_pressure = float(world.E[wl.ENV_SURFACE_PRESSURE])
        self.armed_depth = file.start.depth_m
        self.realtime = realtime
        self.clock: ports.Clock = SimulatedClock(world)
        self.leak: ports.SensorPort | None = None
        self.battery: ports.SensorPort | None = None
        self.drop_weight: ports.DropWeight | None = None
        self.out_of_band: ports.OutOfBand | None = None
        for name in ("imu", "beacon", "slider_wire", "plunger_wire"):
            setattr(self, name, SimulatedSensor(world.frame[ports.SLOTS[name].all]))
        for index, name in enumerate(("servo", "slider", "ballast")):
            setattr(self, name, SimulatedActuator(world, index, getattr(vehicle.actuators, name).range))

    def open(self) -> None:
        """Load the world's kernels and start the clock."""
        self.world.advance(0.0)
        if self.realtime:
            self.clock = PacedClock(self.world)

    def close(self, *, stop: bool = False) -> None:
        """Actuators go on to where they were sent, as the plant's, or `stop` where they stand."""
        if stop:
            self.world.cmd[:] = self.world.x[X_ACT : X_ACT + 3]

    def check_calibration(self) -> str:
        """Nothing to calibrate."""
        return "simulated: none"

    def silent(self) -> list[str]:
        """No devices, so none that is silent."""
        return []

    def health(self) -> dict[str, dict[str, Any]]:
        """No devices."""
        return {}

    def state(self) -> dict[str, float]:
        """Where the plant is."""
        return self.world.truth()

    def recording(self, channel: Callable[[str], Any]) -> tuple[Callable[[float], None], ...]:
        """The plant's true state into the channel of TRUTH."""
        truth = channel(TRUTH.topic)
        x, values = self.world.x, truth.values

        def record(t: float) -> None:
            write_truth(t, x, values)
            truth.commit(t)

        record(0.0)
        return (record,)


def world_of(board: ports.Board) -> World:
    """The world behind a simulated board; BoardError where there is none."""
    if not isinstance(board, SimBoard):
        raise ports.BoardError(f"board '{board.name}' is not simulated")
    return board.world


def build_board(request: BoardRequest) -> ports.Board:
    """A simulated board from its file's text; floor and salinity are the mission site's where the file has none."""
    file = decode(request.text, SimBoardFile, request.source)
    check_board(file.effects, request.source)
    environment = file.environment
    if environment.floor_m == 0.0 and request.site_depth:
        environment = msgspec.structs.replace(environment, floor_m=request.site_depth)
    effects = {**file.effects, **request.effects}
    world = build_world(request.vehicle, environment, file.sensors, file.start, request.seed, effects)
    return SimBoard(file, world, request.vehicle, realtime=request.realtime)
