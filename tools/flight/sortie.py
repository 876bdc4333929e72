"""The procedure of one flight, from arming to its end: the only place that opens a board, flies and closes it again.

`glider fly`, the endurance flight and the trial of kills differ in their `FlightHost` (what stands around the flight)
and in their loop. Which state follows which is said by hal/sortie; this module moves it for the flight.
"""

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts.supervisor_layout import RECORDER, RESTARTED
from glider.firmware.faults import Reaction
from glider.firmware.runtime import Ending, Runtime, Timing
from glider.hal.ports import BoardError
from glider.hal.sortie import Facts, Party, SortieRefused, SortieState, Trigger, follow
from glider.hal.state_file import StateFile
from glider.tools.flight.arming import arm
from glider.tools.flight.compose import Flight, build_runtime
from glider.tools.flight.device_counts import DeviceCounts

RING_ROOM = 512  # records on their way to the disk, past which a simulated flight waits


class Journal:
    """The sortie's state as this flight moves it. `move` follows glider.hal.sortie.TRANSITIONS for the flight."""

    def __init__(self, folder: Path | str | None, flight: str):
        """folder: of the state file; None: nothing outlives the flight."""
        self.file, self.flight = None if folder is None else StateFile(folder), flight
        self.before = StateFile.unwritten if self.file is None else self.file.read()
        self.state = self.before.state
        self.recovering = False  # an ascent after a flight that broke off
        self.reason = self.before.reason

    def arm(self, facts: Facts) -> None:
        """Arm for the mission, or for an ascent alone after a flight that broke off. BoardError: neither may be."""
        self.recovering = self.state.must_ascend
        try:
            self.move(Trigger.RECOVER if self.recovering else Trigger.ARM, facts, self.before.reason)
        except SortieRefused as refused:
            looked = "; look at the vehicle, then `glider acknowledge`" if self.state == SortieState.HELD else ""
            raise BoardError(f"{self.before.describe() if looked else refused}{looked}") from None

    def move(
        self, trigger: Trigger, facts: Facts | None = None, reason: str = "", *, durable: bool = True
    ) -> SortieState:
        """Take a transition; `durable`: bring it to the disk before this returns (OSError where it refuses)."""
        state = follow(self.state, trigger, Party.FLIGHT, facts or Facts())
        if durable and self.file is not None:
            self.file.write(state, flight=self.flight, reason=reason)
        self.state = state
        return state


class FlightHost:
    """What stands around a flight. This one: nothing but a journal; `keeper.Keeper` is the host of a flight on devices.

    A context: left by an exception, it leaves the sortie in a state from which the right party goes on.
    """

    def __init__(self, flight: Flight, *, name: str, folder: Path | None = None):
        self._flight = flight
        self._recorder: Any = None
        self.journal = Journal(folder, name)

    @property
    def ascent_only(self) -> bool:
        """Whether the flight before left the vehicle under way: it is brought up, whatever was planned."""
        return self.journal.recovering

    def facts(self) -> Facts:
        """What may block arming."""
        return Facts()

    def prepare(self) -> None:
        """Before the board opens: actuators may become live from here on."""
        self.journal.arm(self.facts())

    def armed(self) -> None:
        """The arming checks have passed."""

    def begin(self, recorder: Any) -> None:
        """Before the first tick."""
        self._recorder = recorder
        self.journal.move(Trigger.START, reason=self.journal.before.reason)

    def flying(self) -> None:
        """The first tick comes next."""

    def beat(self, t: float) -> None:
        """Every tick."""

    def second(self, timing: Timing) -> None:
        """Once a second, between two ticks."""
        self._flight.supervisor.G[RECORDER] = float(self._recorder.watch().level)

    def closing(self, ending: Ending) -> None:
        """The loop is over: the vehicle floats, or the out-of-band process is to bring it up."""
        journal = self.journal
        if journal.state == SortieState.DIVING:
            journal.move(Trigger.FINISH, durable=False)
        if ending == Ending.SURFACED:
            journal.move(Trigger.SURFACE, durable=False)
        else:
            with contextlib.suppress(OSError):  # a disk that refuses changes nothing about who brings it up
                journal.move(Trigger.HAND_OVER, reason=self._flight.autopilot.reason)

    def end(self) -> SortieState:
        """The board is closed; returns the state in which the sortie is left."""
        if self.journal.state == SortieState.SURFACED:
            with contextlib.suppress(OSError):
                self.journal.move(Trigger.END, Facts(fault=self._faulty()), self._flight.autopilot.reason)
        return self.journal.state

    def _faulty(self) -> bool:
        """Whether a person has to look before the next sortie: anything but a mission completed or given up by its
        operator, or a fault on the way up from one."""
        autopilot, supervisor = self._flight.autopilot, self._flight.supervisor
        in_order = autopilot.mode == "completed" or autopilot.ap[ctl.REASON] == ctl.REASON_OPERATOR
        return self.ascent_only or not in_order or supervisor.reaction >= Reaction.ABORT

    def __enter__(self) -> "FlightHost":
        return self

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        """A flight that broke off before its first tick has left nothing behind."""
        if self.journal.state == SortieState.ARMED:
            with contextlib.suppress(OSError):
                self.journal.move(Trigger.DISARM, reason=self.journal.before.reason)


class SimulatedHost(FlightHost):
    """The host of a simulated flight: time waits for the disk instead of the other way round."""

    def __init__(self, flight: Flight, *, name: str, paced: bool):
        super().__init__(flight, name=name)
        self._paced = paced

    def second(self, timing: Timing) -> None:
        super().second(timing)
        recorder = self._recorder
        while not self._paced and recorder.health().pending > RING_ROOM and recorder.health().alive:
            time.sleep(0.001)


@dataclass(frozen=True)
class FlightResult:
    """How a flight went. `state`: the sortie's, as it was left; `seconds`: of the loop; `report`: the recorder's."""

    ending: Ending
    state: SortieState
    timing: Timing
    seconds: float
    report: Any


def fly(
    flight: Flight, host: FlightHost, make_recorder: Callable[[], Any], *, log: Path | None = None,
    loop: Callable[[Runtime], Ending] | None = None, on_second: Callable[[float], None] | None = None,
    before_loop: Callable[[], None] | None = None,
) -> FlightResult:  # fmt: skip
    """Fly a flight from arming to its end and return how it went.

    make_recorder(): called once the vehicle is armed, so that what does not arm leaves no log (`log`: its path, for the
    arming checks). loop(runtime): flies instead of Runtime.run; on_second(t): once a second; before_loop(): just before
    the first tick. BoardError where the flight does not arm. KeyboardInterrupt (a person stops at once) stops the
    drives where they stand; any other end leaves them at, or on the way to, where they were sent last.
    """
    board = flight.board
    with host, contextlib.ExitStack() as stack:
        host.prepare()
        board.open()
        stack.callback(board.close)
        if host.ascent_only:
            flight.autopilot.give_up()
            flight.supervisor.G[RESTARTED] = 1.0
        else:
            arm(flight, log=log)
        host.armed()
        recorder = stack.enter_context(make_recorder())
        runtime = build_runtime(flight, recorder)
        counts = DeviceCounts(board, recorder)
        host.begin(recorder)
        runtime.extras = (*runtime.extras, host.beat)

        def second(t: float) -> None:
            if on_second is not None:
                on_second(t)
            host.second(runtime.timing)
            counts.look(t)

        try:
            if before_loop is not None:
                before_loop()
            runtime.arm()
            host.flying()
            began = runtime.deadline
            ending = runtime.run(on_second=second) if loop is None else loop(runtime)
            seconds = board.clock.now() - began
        except KeyboardInterrupt:
            board.close(stop=True)
            raise
        finally:
            runtime.disarm()
        host.closing(ending)
        board.close()
        state = host.end()
        said = {"ended": flight.autopilot.mode, "reason": flight.autopilot.reason, **counts.ending()}
        report = recorder.close(ending=said)
    return FlightResult(ending, state, runtime.timing, seconds, report)
