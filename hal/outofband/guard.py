"""The out-of-band process: watches the flight's heartbeat, and brings the vehicle up when that stops.

`python -m glider.hal.outofband` with --run and --state (folders). It needs the standard library and pyserial, and
nothing of the flight's code but the places in two small files (heartbeat, state). Unless --service is given it ends
when the flight ends in order. As a service it goes on, and at its start looks at the state first: a vehicle that was
under way when the power went is brought up, whatever has become of its flight.

It feeds the hardware watchdog and systemd's, only while every part answers: the loop, the recorder where one is
expected, and itself; on the way up, the pump. Where the vehicle does not rise (rise.py) the hardware's is fed no more.
The hardware watchdog is stopped at an end in order alone: a crash leaves it running, so that it resets the computer
unless a new process feeds it in time.
"""

import argparse
import contextlib
import os
import signal
import threading
import time
from pathlib import Path

from glider.hal import heartbeat as hb
from glider.hal.heartbeat import Guard, Heartbeat
from glider.hal.notify import notify
from glider.hal.outofband.ascent import Ascent
from glider.hal.outofband.plan import BEAT_LIMIT_S, NAME, AscentPlan, PlanError, read_plan
from glider.hal.outofband.rise import AscentStage
from glider.hal.realtime import leave_real_time, lock_memory, take_priority
from glider.hal.sortie import Facts, Party, SortieRefused, SortieState, Trigger, follow
from glider.hal.state_file import StateFile

POLL_S = 0.05
STEP_S = 0.5  # between two rounds of the way up
FEED_S = 0.5
PUMP_SILENT_S = 60.0  # on the way up; then the watchdog is left to do what it does
RECORDER_SILENT_S = 30.0  # longer than it takes the flight to notice and replace it
KILL_S = 2.0  # for a killed process to let go of its ports
CLOSING_S = 60.0  # at the surface, for a flight to bring log and state to the disk
PRIORITY = 60  # above the flight's


def say(message: str) -> None:
    """A line for the journal or the terminal; either may be gone."""
    with contextlib.suppress(OSError):
        os.write(2, f"glider out of band: {message}\n".encode())


class Feeder:
    """The hardware watchdog (a device file) and systemd's, fed together."""

    def __init__(self) -> None:
        self._fd = -1
        self._missing = ""  # the path that could not be opened, named once
        self._next = 0.0

    def feed(self, path: str = "", *, hardware: bool = True) -> None:
        """Hold both off for one more of their periods, or systemd's alone; the hardware's (`path`) starts with the
        first feeding."""
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + FEED_S
        notify("WATCHDOG=1")
        if self._fd < 0 and path and path != self._missing:
            self._open(path)
        if self._fd >= 0 and hardware:
            with contextlib.suppress(OSError):
                os.write(self._fd, b"\0")

    def _open(self, path: str) -> None:
        try:
            self._fd = os.open(path, os.O_WRONLY | os.O_CLOEXEC)
        except OSError as error:
            self._missing = path
            say(f"{path}: {error.strerror}: no hardware watchdog")

    def stop(self) -> None:
        """Stop the hardware watchdog (the magic close): for ends in order alone."""
        if self._fd >= 0:
            with contextlib.suppress(OSError):
                os.write(self._fd, b"V")
        self.leave()

    def leave(self) -> None:
        """Close the descriptor and nothing else: a hardware watchdog runs on."""
        if self._fd >= 0:
            os.close(self._fd)
        self._fd = -1


class GuardWatch:
    """One process. `step` looks once; it is True until there is nothing left to watch."""

    def __init__(self, run: Path, state: Path, *, service: bool):
        self.run_folder, self.state_folder, self.service = run, state, service
        self.feeder = Feeder()
        self.plan: AscentPlan | None = None
        self._pulse: Heartbeat | None = None
        self._seen_alive = False
        self._ascent: Ascent | None = None
        self._ascent_began = 0.0
        self._said = ""
        self._next_step = self._next_look = self._next_state = 0.0
        self.stopping = False

    # --- watching ---------------------------------------------------------------------------------------------------
    def start(self) -> None:
        """At the start of a service: bring up whoever was under way."""
        self._read_plan()
        if self.service and not self._flight_lives():
            found = StateFile(self.state_folder).read()
            if found.state.must_ascend:
                why = found.trouble or found.reason
                self.ascend(f"at the start: {found.state.name.lower()}{f' ({why})' if why else ''}")

    def step(self) -> bool:
        """Look once, act, feed."""
        if self._ascent is not None:
            return self._go_up(self._ascent)
        pulse = self._look_for_pulse()
        if pulse is None:
            self.feeder.feed()
            return True
        self._stamp(Guard.WATCHING)
        alive, look = pulse.held(), pulse.look()
        if look.state.at_rest:
            self._seen_alive = False
            self.feeder.stop()
            self.feeder.feed()
            return alive or self.service
        if not alive and not self._seen_alive:
            return self._ascend_if_abandoned()
        self._seen_alive = True
        if not alive:
            return self._process_gone(look.state)
        if look.state == SortieState.ABORTED:
            self.ascend("the flight hands over")
        elif look.state.beats and look.age_s > self._beat_limit:
            self.ascend(f"no heartbeat for {look.age_s:.1f} s")
        elif look.state == SortieState.SURFACED and look.age_s > CLOSING_S:
            self.ascend(f"at the surface, and not closed within {CLOSING_S:g} s")
        elif not look.recorder_expected or look.recorder_age_s < RECORDER_SILENT_S:
            self.feeder.feed(self._watchdog)
        return True

    @property
    def _beat_limit(self) -> float:
        return self.plan.beat_limit_s if self.plan is not None else BEAT_LIMIT_S

    @property
    def _watchdog(self) -> str:
        return self.plan.watchdog if self.plan is not None else ""

    def _process_gone(self, published: SortieState) -> bool:
        """The flight's process ended without a last word; one that died closing may have left the state in order."""
        if published == SortieState.SURFACED and StateFile(self.state_folder).read().state.at_rest:
            self._seen_alive = False
            self.feeder.stop()
            return self.service
        self.ascend("the flight's process is gone")
        return True

    def _ascend_if_abandoned(self) -> bool:
        """Judge a heartbeat whose flight was never seen alive by the state on the disk."""
        self.feeder.feed()
        now = time.monotonic()
        if now >= self._next_state:
            self._next_state = now + 1.0
            found = StateFile(self.state_folder).read()
            if found.state.must_ascend:
                self.ascend(f"left behind: {found.state.name.lower()}")
        return self.service or self._ascent is not None

    def _look_for_pulse(self) -> Heartbeat | None:
        """The heartbeat of the flight under way; a new plan comes with a new flight."""
        now = time.monotonic()
        if self._pulse is None and now >= self._next_look:
            self._next_look = now + 0.25
            with contextlib.suppress(OSError, ValueError):
                self._pulse = Heartbeat.open(self.run_folder)
                self._seen_alive = False
        if self._pulse is not None and (self.plan is None or now >= self._next_look):
            self._next_look = now + 1.0
            self._read_plan()
        return self._pulse

    def _read_plan(self) -> None:
        try:
            self.plan = read_plan(self.state_folder / NAME)
        except PlanError as error:
            if self._said != str(error):
                self._said = str(error)
                say(str(error))

    def _flight_lives(self) -> bool:
        """Whether a process holds the heartbeat: the system lets go of it when the process ends, however it does."""
        if self._pulse is None:
            with contextlib.suppress(OSError, ValueError):
                self._pulse = Heartbeat.open(self.run_folder)
        return self._pulse is not None and self._pulse.held()

    def _stamp(self, status: Guard) -> None:
        if self._pulse is not None:
            words = self._pulse.words
            words[hb.W_GUARD_PID], words[hb.W_GUARD_STATUS] = os.getpid(), status
            words[hb.W_GUARD_NS] = time.monotonic_ns()
            if self._ascent is not None:
                words[hb.W_GUARD_STAGE] = self._ascent.stage
                self._pulse.values[hb.V_GUARD_DEPTH_M] = self._ascent.depth

    # --- the way up -------------------------------------------------------------------------------------------------
    def ascend(self, why: str) -> None:
        """End the flight's process, take its ports, and go up."""
        say(f"bringing the vehicle up: {why}")
        self._stamp(Guard.ASCENDING)
        self._end_flight()
        if self.plan is None:
            self._read_plan()
        if self.plan is None:
            self.plan = AscentPlan("", (), None)  # nothing to go up with; asked for again at every round
        self._ascent, self._ascent_began = Ascent(self.plan), time.monotonic()
        self._next_step = 0.0
        self._record_abort(why)

    def _end_flight(self) -> None:
        """Kill the process that holds the heartbeat, and wait until the system has given its ports back."""
        end = time.monotonic() + KILL_S
        while self._pulse is not None and self._pulse.held() and time.monotonic() < end:
            pid = self._pulse.words[hb.W_PID]
            if self._pulse.words[hb.W_STATE] != SortieState.ABORTED or time.monotonic() > end - KILL_S / 2:
                with contextlib.suppress(OSError, OverflowError):
                    if pid > 1:
                        os.kill(pid, signal.SIGKILL)
            time.sleep(0.01)

    def _record_abort(self, why: str) -> None:
        """Bring the state to the disk in a thread: a disk that hangs must not hold this process up."""
        threading.Thread(target=self._write_state, args=(why,), daemon=True).start()

    def _write_state(self, why: str) -> None:
        with contextlib.suppress(OSError, SortieRefused):
            file = StateFile(self.state_folder)
            # A flight that was seen under way and left the state at rest (a disk that refused, say) was still lost.
            state = max(file.read().state, SortieState.DIVING)
            aborted = follow(state, Trigger.LOSE, Party.WATCH, Facts())
            file.write(aborted, flight=self.plan.flight if self.plan else "", reason=why)

    def _go_up(self, ascent: Ascent) -> bool:
        now = time.monotonic()
        able = bool(ascent.plan.axes)
        self._stamp(Guard.ASCENDING if able else Guard.WATCHING)
        if now >= self._next_step:
            self._next_step = now + STEP_S
            if not able:
                self._read_plan()
                if self.plan is not None and self.plan.axes:
                    self._ascent = ascent = Ascent(self.plan)
            before = ascent.stage
            said = ascent.step()
            if ascent.stage == AscentStage.HARDWARE != before:
                self._record_abort("fault 18: no ascent out of band")
            if said != self._said:
                self._said = said
                say(said)
                notify(f"STATUS={said}")
            if self.service and self._acknowledged():
                if ascent.stage == AscentStage.SURFACED or not able:
                    say("a person has looked: at rest")
                    ascent.close()
                    self._ascent, self._pulse = None, None
                    return True
                self._record_abort("acknowledged before it was at the surface: the ascent goes on")
        heard = max(ascent.pump_heard_at, self._ascent_began)
        if time.monotonic() - heard < PUMP_SILENT_S:
            self.feeder.feed(ascent.plan.watchdog, hardware=ascent.stage != AscentStage.HARDWARE)
        give_up = ascent.plan.give_up_s
        if give_up and time.monotonic() - ascent.reached_port_at > give_up:
            say(f"no port for {give_up:g} s: nothing is left to bring up")
            return False
        return True

    def _acknowledged(self) -> bool:
        """Whether the state was set back since the way up began."""
        if time.monotonic() - self._ascent_began < 5.0:
            return False
        try:
            return StateFile(self.state_folder).read().state.may_arm
        except OSError:
            return False

    def close(self, *, in_order: bool) -> None:
        """Let go of everything; in order, the hardware watchdog is stopped, after a crash it runs on."""
        if in_order:
            self.feeder.stop()
        self.feeder.leave()
        if self._ascent is not None:
            self._ascent.close()
        self._stamp(Guard.ABSENT)


def main() -> int:
    """Exit 0 when the flight ended in order, or asked to stop."""
    parser = argparse.ArgumentParser(prog="python -m glider.hal.outofband", description=__doc__)
    parser.add_argument("--run", type=Path, default=None, help="folder of the heartbeat")
    parser.add_argument("--state", type=Path, default=None, help="folder of state and plan")
    parser.add_argument("--service", action="store_true", help="go on after a flight, and look at the state first")
    options = parser.parse_args()
    watch = GuardWatch(options.run or hb.run_folder(), options.state or hb.state_folder(), service=options.service)

    def stop(*_: object) -> None:
        watch.stopping = True

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, stop)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    leave_real_time()
    requests = f"{take_priority(PRIORITY)}, {lock_memory()}"
    if options.service:
        say(requests)
    in_order = False
    try:
        watch.start()
        notify("READY=1")
        while not watch.stopping and watch.step():
            time.sleep(POLL_S)
        in_order = True
    finally:
        watch.close(in_order=in_order)
    return 0
