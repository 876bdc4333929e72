"""A log flown again: recorded inputs through screening, tick and guard, and every outcome against the recorded one.

The loop is the runtime's own (`Runtime.step`), on a board whose ports read the log. A tick is a function of its inputs
and of the ticks before, so a replay begins at the first tick and ends where a record is missing.
"""

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from glider.firmware.autopilot import MODES, REASONS, Autopilot, reason_text
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.faults import FAULTS, Reaction
from glider.firmware.guidance.mission import decode_mission
from glider.firmware.model.vehicle import decode_vehicle
from glider.firmware.runtime import Runtime
from glider.firmware.supervisor import Supervisor
from glider.firmware.telemetry import ASKED, RAW, TICK
from glider.hal.ports import ACTUATORS, SLOTS, DropWeight, Hardware, OutOfBand, Slot
from glider.hal.recorder.recorder import NullChannel
from glider.tools.data.errors import InputError
from glider.tools.data.log.reader import Log, Topic
from glider.tools.flight.compose import build_pilot, within

TAKEN = ("cmd_servo_rad", "cmd_slider_m", "cmd_ballast_kg")
FRAME = tuple(name for name, _, _ in RAW)
EXTERNAL = ("recorder", "growth", "stop")
NEEDED = ("t_s", "lateness_s", *FRAME, *EXTERNAL, *ASKED, *TAKEN)
INPUTS = {"t_s", "lateness_s", "duration_s", *FRAME, *EXTERNAL}  # every other number of a record is an outcome
STATES = ("mode", "leg", "reason", "reaction", "fault")
LONGEST_STEP_S = 3600.0  # of a tick after the one before; a loop that is late skips ticks
LONGEST_FLIGHT_S = 1e8
LARGEST_COMMAND = 1e3  # rad, m or kg
CHUNK = 2048  # ticks compared at once
VALIDITIES = [slot.validity for slot in SLOTS.values()]


class RecordedPort:
    """A sensor of a recorded flight."""

    def __init__(self, board: "RecordedBoard", slot: Slot):
        self._board, self._slot = board, slot.all

    def read(self, out: np.ndarray) -> None:
        """Copy the tick's recorded sample into `out`."""
        out[...] = self._board.frame[self._slot]


class RecordedActuator(RecordedPort):
    """An actuator of a recorded flight."""

    def __init__(self, board: "RecordedBoard", slot: Slot, index: int, limits: tuple[float, float]):
        super().__init__(board, slot)
        self._index, self.limits = index, limits

    def command(self, value: float) -> float:
        """Return what the device took: its own value where it did not take what the flight asked for, else `value`."""
        asked, taken = self._board.asked[self._index], self._board.taken[self._index]
        return value if asked == taken else taken


class RecordedClock:
    """The recorded flight's clock."""

    def __init__(self) -> None:
        self.time = 0.0

    def now(self) -> float:
        return self.time

    def sleep_until(self, deadline: float) -> None:
        return


class RecordedBoard:
    """The ports of a recorded flight: `frame`, `asked` and `taken` are those of the tick being replayed."""

    def __init__(self, loop_hz: float, limits: dict[str, tuple[float, float]]):
        self.loop_hz, self.clock = loop_hz, RecordedClock()
        self.hardware = Hardware.NONE
        self.out_of_band: OutOfBand | None = None  # what it and the drop weight did is in the samples
        self.drop_weight: DropWeight | None = None
        self.frame = np.zeros(len(FRAME))
        self.asked, self.taken = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
        self.imu, self.beacon = RecordedPort(self, SLOTS["imu"]), RecordedPort(self, SLOTS["beacon"])
        self.slider_wire = RecordedPort(self, SLOTS["slider_wire"])
        self.plunger_wire = RecordedPort(self, SLOTS["plunger_wire"])
        self.leak, self.battery = RecordedPort(self, SLOTS["leak"]), RecordedPort(self, SLOTS["battery"])
        self.servo, self.slider, self.ballast = (
            RecordedActuator(self, SLOTS[name], index, limits[name]) for index, name in enumerate(ACTUATORS)
        )


@dataclass(frozen=True)
class Difference:
    """A tick with another outcome than the recorded one. `fields`: name -> (recorded, now)."""

    tick: int  # from 1
    time_s: float
    fields: dict[str, tuple[float, float]]


@dataclass(frozen=True)
class Abort:
    """The first tick in which a flight was given up, or its supervisor asked for ABORT or more."""

    tick: int  # from 1
    time_s: float
    reaction: str
    row: int  # of the fault table; 0: none
    reason: str


@dataclass
class Replay:
    """Outcome of a replay. `validity`: of the frame's slots as screening left them, (replayed, len(SLOTS))."""

    log: Log
    tick: Topic
    replayed: int = 0
    ends: str = ""  # why not all ticks were replayed; empty: they were
    differing: int = 0  # ticks
    first: Difference | None = None
    first_state: Difference | None = None  # in mode, leg, reason, reaction or row
    largest: dict[str, float] = field(default_factory=dict)  # difference of a command; NaN against a number: inf
    abort: Abort | None = None  # as recorded
    abort_now: Abort | None = None  # as replayed
    validity: np.ndarray = field(default_factory=lambda: np.zeros((0, len(SLOTS))))

    @property
    def same(self) -> bool:
        """Whether every outcome of every replayed tick is the recorded one, to the bit."""
        return self.differing == 0


def build_from_log(log: Log) -> tuple[Autopilot, Supervisor, RecordedBoard]:
    """Build what flew, from a log's texts and metadata; InputError or ConfigError where they are not there or wrong."""
    texts, facts = log.attachments, log.metadata
    for name in ("vehicle.toml", "mission.toml"):
        if name not in texts:
            raise InputError(f"holds no {name}: nothing to replay with", source=log.path)
    values: dict[str, Any] = {}
    for key, read in (
        ("loop_hz", _positive), ("periods_s", _periods), ("surface_pressure_pa", _positive), ("restarted", _flag),
        ("actuator_limits", _limits),
    ):  # fmt: skip
        if key not in facts:
            raise InputError(f"its metadata have no {key}: nothing to replay with", source=log.path)
        try:
            values[key] = read(facts[key])
        except (ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError):
            raise InputError(f"its metadata give {key} as {facts[key][:40]!r}", source=log.path) from None
    vehicle = decode_vehicle(texts["vehicle.toml"], f"{log.path}: vehicle.toml")
    vehicle = within(vehicle, values["actuator_limits"], f"{log.path}: actuator_limits")
    source = f"{log.path}: mission.toml"
    pilot, supervisor = build_pilot(
        vehicle, decode_mission(texts["mission.toml"], source), source, loop_hz=values["loop_hz"],
        periods=values["periods_s"], surface_pressure=values["surface_pressure_pa"], restarted=values["restarted"],
    )  # fmt: skip
    return pilot, supervisor, RecordedBoard(values["loop_hz"], values["actuator_limits"])


def _positive(text: str) -> float:
    value = float(text)
    if not (math.isfinite(value) and value > 0.0):
        raise ValueError(text)
    return value


def _periods(text: str) -> dict[str, float]:
    found = {name: _positive(period) for name, period in json.loads(text).items()}
    return {name: found[name] for name in ("imu", "beacon", "wires")} | found


def _flag(text: str) -> bool:
    return {"true": True, "false": False}[text]


def _limits(text: str) -> dict[str, tuple[float, float]]:
    found = json.loads(text)
    return {name: (float(found[name][0]), float(found[name][1])) for name in ACTUATORS}


def replay_log(log: Log, advance: Callable[[int], None] = lambda _: None) -> Replay:
    """Replay a log and compare; advance(n) is called as n ticks more are done.

    InputError or ConfigError where the log has no inputs, or not those of its first tick.
    """
    tick = log.topics.get(TICK.topic)
    if tick is None or tick.data is None or not tick.count:
        raise InputError(f"holds no {TICK.topic} records: nothing to replay", source=log.path)
    missing = set(NEEDED) - {item.name for item in tick.fields if not item.count}
    if missing:
        by = log.metadata.get("software", "another program")
        raise InputError(f"no inputs recorded ({min(missing)} and others are not in it); by {by}", source=log.path)
    if tick.sequences[0] != 1:
        raise InputError(
            f"its first {int(tick.sequences[0]) - 1} ticks are missing: a replay begins at the first", source=log.path
        )
    _check_times(log, tick.column("t_s"))
    _check_taken(log, tick)
    result = Replay(log, tick)
    whole = tick.sequences == np.arange(1, tick.count + 1)
    result.replayed = tick.count if whole.all() else int(np.argmin(whole))
    if not whole.all():
        after = int(tick.sequences[result.replayed])
        result.ends = f"ticks {result.replayed + 1} to {after - 1} are not in the log"
    pilot, supervisor, board = build_from_log(log)
    legs = pilot.legs
    recorded = {name: tick.column(name) for name in STATES}
    _check_states(log, recorded, legs)
    names = [item.name for item in TICK.fields if item.name not in INPUTS and _has(tick, item.name)]
    outcomes = _fly(result, pilot, supervisor, board, names, advance)
    result.abort = first_abort(tick.column("t_s"), recorded, legs)
    result.abort_now = first_abort(tick.column("t_s"), outcomes, legs)
    return result


def _check_times(log: Log, t: np.ndarray) -> None:
    """InputError where the ticks' times do not go on as those of one flight: the filter steps from each to the next."""
    steps = np.diff(t, prepend=t[0] - 1.0)
    strange = ~((steps > 0.0) & (steps < LONGEST_STEP_S) & (np.abs(t) < LONGEST_FLIGHT_S))
    if strange.any():
        i = int(np.argmax(strange))
        raise InputError(f"tick {i + 1}: t_s is {t[i]:g}, which is no time of this flight", source=log.path)


def _check_taken(log: Log, tick: Topic) -> None:
    """InputError where an actuator took what is no command: the filter reckons with it unscreened."""
    for name, wanted in zip(TAKEN, ASKED, strict=True):
        values = tick.column(name)
        left_alone = np.isnan(values) & np.isnan(tick.column(wanted))
        strange = ~(np.abs(values) <= LARGEST_COMMAND) & ~left_alone
        if strange.any():
            i = int(np.argmax(strange))
            raise InputError(f"tick {i + 1}: {name} is {values[i]:g}, which no actuator takes", source=log.path)


def _check_states(log: Log, states: dict[str, np.ndarray], legs: np.ndarray) -> None:
    """InputError where a recorded state is none that a flight of this mission can be in."""
    known = {
        "mode": list(MODES), "leg": range(len(legs)), "reaction": list(map(int, Reaction)), "fault": range(sup.N_ROWS),
        "reason": [*REASONS, *(ctl.REASON_FAULT + row for row in FAULTS)],
    }  # fmt: skip
    for name, values in states.items():
        strange = ~np.isin(values, list(known[name]))
        if strange.any():
            i = int(np.argmax(strange))
            raise InputError(f"tick {i + 1}: {name} is {values[i]:g}, which no flight has", source=log.path)


def _has(topic: Topic, name: str) -> bool:
    return any(item.name == name and not item.count for item in topic.fields)


def _fly(
    result: Replay, pilot: Autopilot, supervisor: Supervisor, board: RecordedBoard, names: list[str],
    advance: Callable[[int], None],
) -> dict[str, np.ndarray]:  # fmt: skip
    """Fly the recorded inputs and note what differs; returns the replayed STATES, an array each."""
    channel = NullChannel(TICK)
    runtime = Runtime(board, pilot, supervisor, channel)
    places = [TICK.index(name) for name in names]
    states = [names.index(name) for name in STATES]
    kept, validity = np.zeros((result.replayed, len(STATES))), np.zeros((result.replayed, len(SLOTS)))
    columns = {name: result.tick.column(name) for name in {*NEEDED, *names}}
    for begin in range(0, result.replayed, CHUNK):
        rows = slice(begin, min(begin + CHUNK, result.replayed))
        frames = np.column_stack([columns[name][rows] for name in FRAME])
        external = np.column_stack([columns[name][rows] for name in ("t_s", "lateness_s", *EXTERNAL)]).tolist()
        asked = np.column_stack([columns[name][rows] for name in ASKED]).tolist()
        taken = np.column_stack([columns[name][rows] for name in TAKEN]).tolist()
        now = np.empty((len(frames), len(names)))
        for i, (t, lateness, recorder, growth, stop) in enumerate(external):
            board.frame, board.asked, board.taken, board.clock.time = frames[i], asked[i], taken[i], t
            supervisor.G[sup.RECORDER], supervisor.G[sup.GROWTH] = recorder, growth
            pilot.ap[ctl.STOP_REQUESTED] = stop
            runtime.step(t, lateness)
            now[i] = channel.values[places]
            validity[begin + i] = pilot.frame[VALIDITIES]
        kept[rows] = now[:, states]
        _compare(result, begin, np.column_stack([columns[name][rows] for name in names]), now, names)
        advance(len(frames))
    result.validity = validity
    return {name: kept[:, i] for i, name in enumerate(STATES)}


def _compare(result: Replay, begin: int, recorded: np.ndarray, now: np.ndarray, names: list[str]) -> None:
    """Note the differences of ticks `begin` and those after it; a NaN is the same as any other NaN."""
    differs = (recorded.view(np.int64) != now.view(np.int64)) & ~(np.isnan(recorded) & np.isnan(now))
    result.differing += int(differs.any(axis=1).sum())
    t = result.tick.column("t_s")

    def first(among: list[int]) -> Difference | None:
        rows = np.flatnonzero(differs[:, among].any(axis=1))
        if not len(rows):
            return None
        row = int(rows[0])
        fields = {names[i]: (float(recorded[row, i]), float(now[row, i])) for i in np.flatnonzero(differs[row])}
        return Difference(begin + row + 1, float(t[begin + row]), fields)

    result.first = result.first or first(list(range(len(names))))
    result.first_state = result.first_state or first([names.index(name) for name in STATES])
    for name in ASKED:
        i = names.index(name)
        apart = np.abs(recorded[:, i] - now[:, i])[differs[:, i]]
        if len(apart):
            largest = float(np.max(np.where(np.isnan(apart), math.inf, apart)))
            result.largest[name] = max(result.largest.get(name, 0.0), largest)


def first_abort(t: np.ndarray, states: dict[str, np.ndarray], legs: np.ndarray) -> Abort | None:
    """Find where a flight was given up in the STATES of its ticks; None where it was not."""
    given_up = np.flatnonzero((states["mode"] == ctl.ABORTED) | (states["reaction"] >= sup.ABORT))
    if not len(given_up):
        return None
    i = int(given_up[0])
    reaction, row = Reaction(int(states["reaction"][i])), int(states["fault"][i])
    code, leg = float(states["reason"][i]), int(states["leg"][i])
    reason = reason_text(code, leg, legs) or (f"fault {row}: {FAULTS[row]}" if row in FAULTS else "")
    return Abort(i + 1, float(t[i]), reaction.name, row, reason)
