"""One flight of the fault campaign: a dive and a climb on the simulated board, into which one fault is put.

The real runtime, autopilot and supervisor fly; what breaks is a device's port, the plant, the clock, or what the
controller asks for. The fault begins in a phase of the mission and, unless a case says otherwise, stays.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import msgspec

from glider.firmware.autopilot import Autopilot
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.faults import Reaction
from glider.firmware.model.supervisor_settings import Limits
from glider.firmware.runtime import RESOURCES_S, Ending, Runtime
from glider.firmware.supervisor import Supervisor
from glider.firmware.telemetry import TICK
from glider.hal.recorder.recorder import NullRecorder
from glider.sim_backend.board import SimBoard
from glider.sim_backend.faults import Broken, break_in
from glider.sim_backend.world import World
from glider.tools.flight.compose import Flight, build_flight

PHASES = ("waiting", "descent", "level", "ascent", "surface")
SURFACED_M = 0.5
ADRIFT_S = 300.0  # after the end of the flight, with the board closed: then the vehicle is looked at
LINGER_S = 3.0  # behind a fault's time, before a flight at the surface may end
LONGEST_S = 1200.0
MISSION = """
format = 1
name = "dive"
time_limit_s = {limit}
[site]
name = "pool"
depth_m = 6.0
[[leg]]
depth_m = 3.0
pitch_deg = -20.0
time_limit_s = {limit}
hold_s = {hold}
[[leg]]
depth_m = 1.0
pitch_deg = 20.0
time_limit_s = {limit}
[control]
controller = "{controller}"
"""


@dataclass
class Scene:
    """A flight with its broken-in board. `since`: when the fault began, s; None: not yet."""

    flight: Flight
    broken: Broken
    phase: str
    begin: Callable[["Scene"], None]
    at_s: float | None = None  # begins at this time, whatever the phase
    since: float | None = None
    each_tick: Callable[["Scene", float], None] | None = None
    lateness: Callable[[float], float] | None = None
    deepest: float = 0.0
    left: float | None = None  # m deep ADRIFT_S after the flight's end; after LONGEST_S where that does not come
    cleanup: list[Callable[[], None]] = field(default_factory=list)
    late: bool = False  # the clock may be late
    counted: bool = False  # `since` was set to when the fault shows, later than it began

    @property
    def board(self) -> SimBoard:
        board = self.flight.board
        assert isinstance(board, SimBoard)
        return board

    @property
    def supervisor(self) -> Supervisor:
        return self.flight.supervisor

    @property
    def pilot(self) -> Autopilot:
        return self.flight.autopilot

    @property
    def world(self) -> World:
        return self.board.world

    @property
    def depth(self) -> float:
        """The plant's true depth, m."""
        return float(self.world.x[2])

    def due(self) -> bool:
        """Whether the phase in which the fault begins is reached, or its time."""
        if self.at_s is not None:
            return self.world.time >= self.at_s
        ap, est = self.pilot.ap, self.pilot.est
        mode, leg, depth = ap[ctl.MODE], int(ap[ctl.LEG]), est[ctl.EST_DEPTH]
        return {
            "waiting": True,
            "descent": mode == ctl.FLYING and leg == 0 and depth > 1.2,
            "level": mode == ctl.FLYING and leg == 0 and ap[ctl.REACHED] >= 0.0,
            "ascent": mode == ctl.FLYING and leg == 1 and depth < 2.3,
            "surface": mode == ctl.COMPLETED and depth < 0.8,
        }[self.phase]

    def finish(self) -> None:
        """Give back what a case has taken."""
        while self.cleanup:
            self.cleanup.pop()()

    def step(self, t: float) -> None:
        """Once a tick, as the runtime's extra."""
        self.deepest = max(self.deepest, self.depth)
        if self.since is None and self.due():
            self.since = t
            self.begin(self)
        if self.since is not None and self.each_tick is not None:
            self.each_tick(self, t)


@dataclass(frozen=True)
class Setting:
    """What a case flies in."""

    controller: str = "pid"
    hold_s: float = 12.0
    mission_s: float = 300.0
    limits: Limits | None = None
    effects: dict[str, dict[str, float]] = field(default_factory=dict)
    restarted: bool = False


@dataclass(frozen=True)
class SceneResult:
    """Outcome of a case."""

    noticed_s: float | None
    reaction: Reaction
    ended: str  # surfaced, safe, lost, or what kept the fault from beginning


class LateClock:
    """The simulated clock, read late where the scene says so."""

    def __init__(self, clock: Any, scene: Scene):
        self._clock, self._scene, self._late = clock, scene, 0.0

    def now(self) -> float:
        return self._clock.now() + self._late

    def sleep_until(self, deadline: float) -> None:
        scene = self._scene
        self._clock.sleep_until(deadline)
        self._late = scene.lateness(deadline) if scene.lateness is not None else 0.0


def build_scene(phase: str, begin: Callable[[Scene], None], setting: Setting, seed: int, mission_file: Any) -> Scene:
    """Everything but the first tick."""
    mission_file.write_text(MISSION.format(limit=setting.mission_s, hold=setting.hold_s, controller=setting.controller))
    flight = build_flight(mission=str(mission_file), seed=seed, effects=setting.effects)
    scene = set_scene(flight, phase, begin, setting)
    if phase == "waiting":
        scene.since = 0.0
        begin(scene)
    return scene


def set_scene(
    flight: Flight, phase: str, begin: Callable[[Scene], None], setting: Setting, at_s: float | None = None
) -> Scene:
    """A flight, its board broken in, under a case's setting."""
    flight.vehicle = msgspec.structs.replace(flight.vehicle, limits=setting.limits)
    assert isinstance(flight.board, SimBoard)
    broken = break_in(flight.board)
    flight.supervisor = Supervisor(
        flight.autopilot, flight.vehicle, flight.mission, dt=1.0 / flight.board.loop_hz, periods=flight.board.periods,
        restarted=setting.restarted,
    )  # fmt: skip
    return Scene(flight, broken, phase, begin, at_s)


def fly(scene: Scene, row: int, *, allowed_s: float, disabled: int | None = None) -> SceneResult:
    """Fly it to its end, and a little on; what `row` made of the fault."""
    board, supervisor, pilot = scene.board, scene.supervisor, scene.pilot
    if disabled is not None:
        supervisor.disable(disabled)
    board.open()
    if scene.lateness is not None or scene.late:
        board.clock = LateClock(board.clock, scene)
    channel = NullRecorder((TICK,)).channel("/tick")
    runtime = Runtime(board, pilot, supervisor, channel, extras=(scene.step,))
    runtime.arm()
    try:
        _run(runtime, scene, allowed_s)
    finally:
        runtime.disarm()
    noticed = supervisor.noticed(row)
    since = scene.since
    return SceneResult(
        None if noticed is None or since is None else noticed - since,
        supervisor.worst(row),
        "never begun" if since is None else ended(scene),
    )


def _run(runtime: Runtime, scene: Scene, allowed_s: float) -> None:
    """Fly to the flight's end, from where the plant is looked at later, and on for as long as the row may take."""
    looked = 0.0
    while runtime.deadline < LONGEST_S:
        runtime.tick()
        now = runtime.deadline
        if now - looked >= RESOURCES_S:
            runtime.look_at_resources(now)
            looked = now
        if scene.left is None and runtime.ended() != Ending.UNDER_WAY:
            scene.left = scene.world.adrift(ADRIFT_S)
        waited = scene.since is None or now - scene.since > allowed_s + LINGER_S
        if scene.left is not None and waited:
            return
    if scene.left is None:  # it holds on to the vehicle
        scene.left = scene.depth


def ended(scene: Scene) -> str:
    """How the flight ended, by the plant's truth: ADRIFT_S later, nobody at the controls."""
    assert scene.left is not None
    if scene.left >= SURFACED_M:
        return "lost"
    return "safe" if scene.deepest < SURFACED_M else "surfaced"  # safe: never left the surface
