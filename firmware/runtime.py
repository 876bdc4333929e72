"""The fixed step: read the ports, screen, tick the autopilot, guard, command the actuators, hand over to the recorder.

Deadlines are absolute, so a late tick does not shift those after it. Time comes from the board's clock, real or
simulated; the code is the same. Nothing is allocated inside a tick but a few boxed numbers that live as long as it.
"""

import copy
import gc
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np

from glider.firmware.autopilot import Autopilot
from glider.firmware.core.control import telemetry as record
from glider.firmware.core.jit import freeze_kernels, thaw_kernels
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.faults import Reaction
from glider.firmware.supervisor import Supervisor
from glider.hal.ports import FRAME_SIZE, SLOTS, Hardware, Ports
from glider.hal.usage import open_files, resident_bytes

HISTOGRAM_EDGES = np.array([0.0, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2, np.inf])  # s
SHED = 10  # of so many records one is kept while the loop is late
RESOURCES_S = 10.0  # between two looks at memory and handles


class Ending(IntEnum):
    """Why the loop ended."""

    UNDER_WAY = int(sup.UNDER_WAY)  # it has not
    SURFACED = int(sup.AT_SURFACE)  # floats, by measured depth, ballast measured at its light end
    PUMP_GIVEN_UP = int(sup.PUMP_GIVEN_UP)  # at the surface, ballast not at its light end: another has to hold it there
    NO_WAY_LEFT = int(sup.NO_WAY_LEFT)  # does not rise, and every reaction has been asked for
    HANDED_OVER = 4  # to the out-of-band process, which takes the ports


@dataclass
class Timing:
    """How punctual the loop was."""

    ticks: int = 0
    missed: int = 0
    worst_s: float = 0.0
    counts: np.ndarray = field(default_factory=lambda: np.zeros(len(HISTOGRAM_EDGES) - 1, dtype=np.int64))

    def histogram(self) -> dict[str, int]:
        """Ticks by lateness, keys the upper edges in s."""
        return {f"<{edge:g}": int(n) for edge, n in zip(HISTOGRAM_EDGES[1:], self.counts, strict=True)}


def resources_used() -> tuple[float, int]:
    """Resident memory of this process (MB) and its open handles; zeros where the system does not say."""
    return resident_bytes() / 1e6, open_files()


def rehearse(autopilot: Autopilot, supervisor: Supervisor) -> None:
    """One tick of copies of both, so that every kernel is loaded."""
    pilot, watcher = copy.deepcopy((autopilot, supervisor))
    watcher.screen(0.0)
    pilot.tick(0.0)
    watcher.guard(0.0)
    scratch = np.zeros(record.N_RECORD)
    record.fill_record(pilot.frame, pilot.est, pilot.ap, watcher.G, pilot.commands, 0.0, 0.0, 0.0, scratch)


class Runtime:
    """Runs an autopilot on a board. `tick` waits and does one `step`; `run` ticks until the mission ends."""

    def __init__(
        self, board: Ports, autopilot: Autopilot, supervisor: Supervisor, channel: Any, *,
        extras: tuple[Callable[[float], None], ...] = (), on_news: Callable[[float, Reaction, str], Any] | None = None,
        resources: Callable[[], tuple[float, int]] = resources_used,
    ):  # fmt: skip
        """channel: where ticks are recorded; extras: called with the time once a tick; on_news(t, reaction, text): a
        row of the fault table asks for more than before; resources(): resident memory (MB) and open handles."""
        self.board, self.autopilot, self.supervisor, self.channel = board, autopilot, supervisor, channel
        self.dt = 1.0 / board.loop_hz
        self.timing = Timing()
        self.extras = extras
        self._on_news, self._resources = on_news, resources
        self._at_arming = (0.0, 0)
        self._looked_at = -math.inf
        self._shed = 0
        self._hardware_called = False
        self._G = supervisor.G
        self._clock = board.clock
        frame = autopilot.frame
        self._reads = tuple(
            (port.read, frame[slot.all]) for name, slot in SLOTS.items() if (port := getattr(board, name)) is not None
        )
        self._send = (board.servo.command, board.slider.command, board.ballast.command)
        self._raw = channel.values[record.REC_FRAME : record.REC_FRAME + FRAME_SIZE]
        self._asked = channel.values[record.REC_ASKED : record.REC_ASKED + 3]
        self._edges = HISTOGRAM_EDGES[1:-1].tolist()
        self._counts = self.timing.counts
        self._deadline = 0.0
        self._last_duration = 0.0

    def arm(self) -> None:
        """Make everything that a flight needs exist: kernels loaded, collector off, no compilation from here on."""
        rehearse(self.autopilot, self.supervisor)
        freeze_kernels()
        gc.collect()
        gc.freeze()
        gc.disable()
        self._at_arming = self._resources()
        self._deadline = self._clock.now()

    def disarm(self) -> None:
        """Give the process back its collector and compiler."""
        gc.enable()
        gc.unfreeze()
        thaw_kernels()

    @property
    def deadline(self) -> float:
        """When the next tick is due, s on the board's clock."""
        return self._deadline

    def tick(self) -> None:
        """Wait for the deadline, then do one step."""
        clock, deadline = self._clock, self._deadline
        clock.sleep_until(deadline)
        t = clock.now()
        lateness = t - deadline
        self.step(t, lateness)
        self._count(lateness)
        self._last_duration = clock.now() - t
        self._deadline = deadline + self.dt
        if lateness > self.dt:
            self._skip(t)

    def step(self, t: float, lateness: float) -> None:
        """One step at time t (s), `lateness` (s) after its deadline: ports to samples, to commands, to ports.

        Its result depends on t, lateness, the samples read, the commands taken, RECORDER, GROWTH, STOP_REQUESTED and
        the steps before. All of these are recorded, so that a log can be replayed (tools/flight/replay).
        """
        autopilot, supervisor, channel = self.autopilot, self.supervisor, self.channel
        for read, slot in self._reads:
            read(slot)
        G = self._G
        G[sup.LATENESS] = lateness
        self._raw[...] = autopilot.frame
        supervisor.screen(t)
        commands = autopilot.tick(t)
        supervisor.guard(t)
        self._asked[...] = commands
        for i in (0, 1, 2):
            commands[i] = self._take_back(i, commands[i])
        record.fill_record(
            autopilot.frame, autopilot.est, autopilot.ap, G, commands, t, lateness, self._last_duration, channel.values
        )
        self._shed = (self._shed + 1) % SHED if G[sup.ASKED + sup.FAULT_OVERRUN] >= sup.HOLD else 0
        if not self._shed:
            channel.commit(t)
        for extra in self.extras:
            extra(t)
        if G[sup.CHANGED]:
            self._react(t)

    def _take_back(self, i: int, wanted: float) -> float:
        """Command actuator i; what its device took, after limits of its own, is what filter, anti-windup and stall
        detector go on from."""
        taken = self._send[i](wanted)
        if taken != wanted and wanted == wanted:
            self._G[sup.SENT + i] = self.autopilot.ap[ctl.SENT_SERVO + i] = taken
        return taken

    def _react(self, t: float) -> None:
        """What is rare: say what is new, call on the out-of-band process and on the hardware."""
        supervisor, board = self.supervisor, self.board
        if self._on_news is not None:
            for reaction, text in supervisor.news():
                self._on_news(t, reaction, text)
        if supervisor.reaction >= Reaction.OOB and board.out_of_band is not None:
            board.out_of_band.ascend()
        if supervisor.reaction >= Reaction.HW and board.drop_weight is not None and not self._hardware_called:
            self._hardware_called = True
            board.drop_weight.release()

    def look_at_resources(self, t: float) -> None:
        """Row 33, between two ticks: how much memory and how many handles were taken since arming."""
        self._looked_at = t
        megabytes, handles = self._resources()
        table = self.supervisor.table
        share = max((megabytes - self._at_arming[0]) / table.memory_mb, (handles - self._at_arming[1]) / table.handles)
        self._G[sup.GROWTH] = 2.0 if share >= 1.0 else 1.0 if share >= 0.5 else 0.0

    def _count(self, lateness: float) -> None:
        timing = self.timing
        timing.ticks += 1
        if lateness > timing.worst_s:
            timing.worst_s = lateness
        bin_ = 0
        for edge in self._edges:
            if lateness < edge:
                break
            bin_ += 1
        self._counts[bin_] += 1

    def _skip(self, t: float) -> None:
        """Pass over the deadlines that are gone, and count them as missed."""
        behind = int((t - self._deadline) / self.dt) + 1
        if behind > 0:
            self.timing.missed += behind
            self._deadline += behind * self.dt

    def ended(self) -> Ending:
        """Return whether and why the loop is to end; a pump that was given up at the surface is handed over.

        A drop weight is this process's to release: where there is one, the flight goes on beside the ascent.
        """
        ending = Ending(int(self._G[sup.ENDING]))
        out_of_band, last_hope = self.board.out_of_band, self.board.drop_weight is not None
        if ending == Ending.PUMP_GIVEN_UP:
            if out_of_band is not None:
                out_of_band.ascend()
            return Ending.UNDER_WAY if last_hope else ending
        handed_over = out_of_band is not None and self.supervisor.reaction >= Reaction.OOB
        if handed_over and self.board.hardware is not Hardware.NONE and not last_hope:
            return Ending.HANDED_OVER
        return ending

    def run(self, *, on_second: Callable[[float], None] | None = None) -> Ending:
        """Tick until the mission has ended, well or not, and the vehicle floats or is another's to bring up.

        on_second(t) is called once a second.
        """
        shown = 0.0
        while True:
            self.tick()
            now = self._deadline
            if now - self._looked_at >= RESOURCES_S:
                self.look_at_resources(now)
            if self._G[sup.HIGHEST] >= sup.OOB or self._G[sup.ENDING] != sup.UNDER_WAY:
                ending = self.ended()
                if ending != Ending.UNDER_WAY:
                    return ending
            if on_second is not None and now >= shown:
                on_second(now)
                shown = math.floor(now) + 1.0
