"""The host of a flight on devices: its heartbeat, its state across restarts, the out-of-band process, watchdogs."""

import contextlib
import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

from glider.firmware.core.layouts.supervisor_layout import RECORDER
from glider.firmware.core.vehicle.seawater import water_density
from glider.firmware.runtime import Ending, Timing
from glider.hal import heartbeat as hb
from glider.hal.devices import DeviceBoard
from glider.hal.heartbeat import Guard, Heartbeat, HeartbeatHeld
from glider.hal.notify import notify
from glider.hal.outofband.guard import CLOSING_S
from glider.hal.outofband.plan import NAME as PLAN
from glider.hal.outofband.plan import PlanError, read_plan, write_plan
from glider.hal.outofband.rise import AscentStage
from glider.hal.ports import BATTERY, BoardError, Validity
from glider.hal.recorder.condition import RecorderLevel
from glider.hal.recorder.schema import WARN
from glider.hal.sortie import Facts, Party, SortieRefused, SortieState, Trigger, follow
from glider.hal.spawn import module_command, module_environment
from glider.hal.state_file import StateFile, StateRecord
from glider.hal.usage import open_files, resident_bytes
from glider.tools.flight.ascent_plan import make_plan
from glider.tools.flight.compose import Flight
from glider.tools.flight.sortie import FlightHost, Journal

GUARD_START_S = 10.0
GUARD_SILENT_S = 3.0
SERVICE_LOOKS_S = 1.0  # within which a service that runs finds the heartbeat of a flight
WITHOUT_PORTS_S = 5.0  # after which the out-of-band process of a twinned flight has nothing left to bring up
RECORDER_EXPECTED_S = 60.0  # without a recording process, after which the watchdog no longer waits for one


def watch_facts(run_folder: Path) -> Facts:
    """What a heartbeat says of flight and out-of-band process; no facts where there is none."""
    try:
        pulse = Heartbeat.open(run_folder)
    except (OSError, ValueError):
        return Facts()
    try:
        return Facts(flight_under_way=pulse.held(), being_brought_up=being_brought_up(pulse))
    finally:
        pulse.close()


def being_brought_up(pulse: Heartbeat) -> bool:
    """Whether the out-of-band process ascends and has not found the surface."""
    look = pulse.look()
    ascending = look.guard == Guard.ASCENDING and look.guard_age_s < GUARD_SILENT_S
    return ascending and pulse.words[hb.W_GUARD_STAGE] != AscentStage.SURFACED


def acknowledge(state_folder: Path, facts: Facts) -> StateRecord:
    """Set the state back to ashore, as an operator who has looked; returns what it was. Refused while a flight is under
    way, or while the out-of-band process brings the vehicle up."""
    file = StateFile(state_folder)
    before = file.read()
    file.write(follow(before.state, Trigger.ACKNOWLEDGE, Party.OPERATOR, facts), reason="acknowledged")
    return before


class FlightSupervision(FlightHost):
    """The host of a flight on devices: `claim` first, then a context around the flight."""

    def __init__(self, flight: Flight, *, name: str, folder: Path | None, twin: bool):
        """`folder` takes state and heartbeat; None: the vehicle's own folders, or one for a twin that goes with it."""
        super().__init__(flight, name=name)
        self._name, self._twin = name, twin
        self._own = Path(tempfile.mkdtemp(prefix="glider-run-")) if twin and folder is None else None
        folder = folder or self._own
        self.run_folder, self.state_folder = (folder, folder) if folder else (hb.run_folder(), hb.state_folder())
        self._pulse: Heartbeat | None = None
        self._guard: subprocess.Popen[bytes] | None = None
        self._recorder_seen = time.monotonic()

    # --- steps of a flight ------------------------------------------------------------------------------------------
    def claim(self, *, acknowledged: bool = False) -> StateRecord | None:
        """Become the vehicle's one flight and read the state before it; with `acknowledged`, set it back first.

        Returns the record that was set back, if one was. BoardError where another flight or an ascent is under way.
        """
        try:
            self._pulse = Heartbeat.create(self.run_folder, 1.0 / self._flight.board.loop_hz, self._name)
        except (HeartbeatHeld, OSError) as error:
            raise BoardError(str(error)) from None
        found = None
        if acknowledged and not StateFile(self.state_folder).read().state.may_arm:
            try:
                found = acknowledge(self.state_folder, self.facts())
            except SortieRefused as refused:
                self._release(SortieState.ASHORE)
                raise BoardError(str(refused)) from None
        self.journal = Journal(self.state_folder, self._name)
        return found

    def facts(self) -> Facts:
        return Facts(being_brought_up=self._pulse is not None and being_brought_up(self._pulse))

    def prepare(self) -> None:
        """Before the board opens: plan, out-of-band process, state. BoardError says what is missing."""
        assert self._pulse is not None
        if not isinstance(self._flight.board, DeviceBoard):
            raise BoardError(f"board '{self._flight.board.name}' has no devices to bring up")
        if self.journal.state.must_ascend:  # nothing can be measured now: the surface is where the flight before had it
            with contextlib.suppress(PlanError):
                pressure = read_plan(self.state_folder / PLAN).pressure
                self._flight.count_depth_from(pressure.surface_pa if pressure else self._flight.board.surface_pressure)
        self._write_plan(self._flight.board)
        self._start_guard(GUARD_START_S)
        super().prepare()
        self._pulse.publish(SortieState.ARMED)  # before an ascent alone too: nothing beats yet

    def armed(self) -> None:
        """The plan again, with the surface pressure as measured."""
        assert isinstance(self._flight.board, DeviceBoard)
        self._write_plan(self._flight.board)

    def flying(self) -> None:
        """Armed to the last: from here on a heartbeat is expected."""
        assert self._pulse is not None
        self._flight.board.out_of_band = self
        self._pulse.beat(0.0)
        self._pulse.publish(self.journal.state)
        notify("READY=1")

    def beat(self, t: float) -> None:
        """Every tick."""
        self._pulse.beat(t)  # type: ignore[union-attr]

    def ascend(self) -> None:
        """The supervisor gives the pump away: the out-of-band process takes over."""
        if self._pulse is not None:
            self._pulse.publish(SortieState.ABORTED)

    def second(self, timing: Timing) -> None:
        """Once a second, between two ticks: publish, see to recorder and out-of-band process."""
        pulse = self._pulse
        assert pulse is not None
        if self.journal.state == SortieState.DIVING and self._flight.autopilot.finished:
            pulse.publish(self.journal.move(Trigger.FINISH, durable=False))
        self._publish_flight(pulse, timing)
        self._publish_recorder(pulse)
        stopped = self._guard is not None and self._guard.poll() is not None
        if stopped or (self._guard is None and pulse.look().guard_age_s > GUARD_SILENT_S):
            self._recorder.event(self._flight.board.clock.now(), WARN, "the out-of-band process was gone: started anew")
            self._launch_guard()
        notify("WATCHDOG=1")

    def closing(self, ending: Ending) -> None:
        """The loop is over: bringing state and log to a slow disk may take longer than a watch waits for a tick."""
        assert self._pulse is not None
        notify(f"WATCHDOG_USEC={round(1e6 * CLOSING_S)}")
        notify("WATCHDOG=1")
        self._pulse.publish(SortieState.SURFACED if ending == Ending.SURFACED else SortieState.ABORTED)
        super().closing(ending)

    def end(self) -> SortieState:
        """The board is closed: at the surface all is done, else the out-of-band process goes on."""
        state = super().end()
        self._release(SortieState.ASHORE if self._twin and state.must_ascend else state)
        return state

    # --- parts ------------------------------------------------------------------------------------------------------
    def _publish_flight(self, pulse: Heartbeat, timing: Any) -> None:
        from glider.firmware.core.layouts import control_layout as ctl

        words, values, autopilot = pulse.words, pulse.values, self._flight.autopilot
        words[hb.W_MISSED], words[hb.W_WORST_NS] = timing.missed, int(1e9 * timing.worst_s)
        words[hb.W_MODE], words[hb.W_LEG] = int(autopilot.ap[ctl.MODE]), int(autopilot.ap[ctl.LEG])
        words[hb.W_LEGS] = len(self._flight.mission.leg)
        values[hb.V_DEPTH_M] = autopilot.est[ctl.EST_DEPTH]
        values[hb.V_PITCH_RAD], values[hb.V_ROLL_RAD] = autopilot.est[ctl.EST_PITCH], autopilot.est[ctl.EST_ROLL]
        values[hb.V_SLIDER_M], values[hb.V_BALLAST_KG] = autopilot.commands[1], autopilot.commands[2]
        frame = autopilot.frame
        values[hb.V_BATTERY_V] = frame[BATTERY + 2] if frame[BATTERY + 1] == Validity.VALID else float("nan")
        words[hb.W_RSS_BYTES], words[hb.W_FILES] = resident_bytes(), open_files()

    def _publish_recorder(self, pulse: Heartbeat) -> None:
        words, condition, now = pulse.words, self._recorder.watch(), time.monotonic()
        if condition.level != RecorderLevel.FAILED:
            self._recorder_seen = now
        words[hb.W_RECORDER_NS], words[hb.W_RECORDER_LEVEL] = condition.beat_ns, condition.level
        words[hb.W_WRITTEN], words[hb.W_DROPPED] = condition.written, condition.dropped
        words[hb.W_DISK_ERRORS] = condition.disk_errors
        self._flight.supervisor.G[RECORDER] = float(condition.level)
        expected = condition.beat_ns and now - self._recorder_seen < RECORDER_EXPECTED_S
        words[hb.W_RECORDER_EXPECTED] = 1 if expected else 0

    def _write_plan(self, board: DeviceBoard) -> None:
        density = float(water_density(0.0, 20.0, self._flight.mission.site.salinity))
        plan = make_plan(
            board, flight=self._name, settings=self._flight.vehicle.supervisor, water_density=density,
            watchdog=os.environ.get("GLIDER_WATCHDOG", ""), give_up_s=WITHOUT_PORTS_S if self._twin else 0.0,
        )  # fmt: skip
        write_plan(self.state_folder / PLAN, plan)

    def _start_guard(self, seconds: float) -> None:
        """Have an out-of-band process watch: the service's if it does already, else one of our own."""
        pulse = self._pulse
        assert pulse is not None
        end = time.monotonic() + seconds
        while (look := pulse.look()).guard == Guard.ASCENDING and look.guard_age_s < GUARD_SILENT_S:
            if time.monotonic() > end or being_brought_up(pulse):
                raise BoardError("the out-of-band process is bringing the vehicle up")
            time.sleep(0.01)  # at the surface, and acknowledged: it rests in a moment
        patience = time.monotonic() + (0.0 if self._twin else SERVICE_LOOKS_S)
        while (absent := pulse.look().guard_age_s > GUARD_SILENT_S) and time.monotonic() < patience:
            time.sleep(0.01)
        if absent:
            self._launch_guard()
        while pulse.look().guard_age_s > GUARD_SILENT_S:
            if time.monotonic() > end or (self._guard is not None and self._guard.poll() is not None):
                raise BoardError("the out-of-band process did not start")
            time.sleep(0.01)

    def _launch_guard(self) -> None:
        self._guard = subprocess.Popen(
            module_command("glider.hal.outofband", "--run", str(self.run_folder), "--state", str(self.state_folder)),
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, start_new_session=True, env=module_environment(),
        )  # fmt: skip

    def _release(self, state: SortieState) -> None:
        """Publish the last state and let go of the heartbeat; an out-of-band process of our own ends by it."""
        if self._pulse is None:
            return
        self._pulse.publish(state)
        self._pulse.close()
        self._pulse = None
        if self._guard is not None and state.at_rest:
            try:
                self._guard.wait(5.0)
            except subprocess.TimeoutExpired:
                self._guard.kill()
                self._guard.wait()
        if self._own is not None:
            shutil.rmtree(self._own, ignore_errors=True)

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        """A flight that broke off before its first tick has left nothing behind; later it is for others to bring up."""
        if self._pulse is None:
            return
        super().__exit__(kind, error, trace)
        person = kind is not None and issubclass(kind, KeyboardInterrupt)
        under_way = self.journal.state.must_ascend and not (self._twin or person)
        self._release(SortieState.ABORTED if under_way else SortieState.ASHORE)
