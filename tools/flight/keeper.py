"""What stands around a flight on devices: its state across restarts, its heartbeat, the out-of-band process, watchdogs.

`Life` is the rule by which nothing is resumed: what the state file says decides whether a mission may begin, and every
step of a flight is on the disk before it is taken. `Keeper` does the rest, once a second beside every tick's stamp.
"""

import contextlib
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from firmware.core.layouts.supervisor_layout import RECORDER
from firmware.core.vehicle.seawater import water_density
from hal import heartbeat as hb
from hal.devices import DeviceBoard
from hal.heartbeat import Guard, Heartbeat, Held, Status
from hal.notify import notify
from hal.outofband.plan import NAME as PLAN
from hal.outofband.plan import write_plan
from hal.ports import BATTERY, BoardError, Validity
from hal.recorder.condition import Level
from hal.state_file import FlightState, Phase, StateFile
from tools.flight.ascent_plan import make_plan
from tools.flight.compose import Flight

GUARD_START_S = 10.0
GUARD_SILENT_S = 3.0
WITHOUT_PORTS_S = 5.0  # after which the out-of-band process of a twinned flight has nothing left to bring up
RECORDER_EXPECTED_S = 60.0  # without a recording process, after which the watchdog no longer waits for one


class Life:
    """A flight's steps in the state file."""

    def __init__(self, folder: Path | str, flight: str):
        self.file, self.flight = StateFile(folder), flight
        self.before = self.file.read()

    @property
    def ascent_only(self) -> bool:
        """Whether the flight before left the vehicle under way: it is brought up, whatever was planned."""
        return self.before.must_ascend

    @property
    def reason(self) -> str:
        """Why a mission may not begin, empty where it may."""
        return "" if self.before.may_start else told(self.before)

    def armed(self) -> None:
        """Before the first actuator is live."""
        self._write(Phase.ABORTED if self.ascent_only else Phase.ARMED, self.before.reason)

    def diving(self) -> None:
        """Before the first tick."""
        self._write(Phase.ABORTED if self.ascent_only else Phase.DIVING, self.before.reason)

    def ended(self, *, surfaced: bool, orderly: bool, reason: str) -> None:
        """After the last tick. Orderly: the mission completed, or a person gave it up."""
        if not surfaced:
            self._write(Phase.ABORTED, reason)
        elif orderly and not self.ascent_only:
            self._write(Phase.ASHORE, reason)
        else:
            self._write(Phase.HELD, reason)

    def _write(self, phase: Phase, reason: str) -> None:
        self.file.write(phase, flight=self.flight, reason=reason)


def told(state: FlightState) -> str:
    """A state in words."""
    words = {
        Phase.ASHORE: "ashore", Phase.HELD: "given up, and ended at the surface",
        Phase.ARMED: "armed when it broke off",
        Phase.DIVING: "under way when it broke off", Phase.ABORTED: "given up and not known to have surfaced",
        Phase.UNKNOWN: "not known",
    }  # fmt: skip
    parts = [f"the flight before{f' ({state.flight})' if state.flight else ''}: {words[state.phase]}"]
    return "; ".join([*parts, *filter(None, (state.reason, state.trouble))])


class Keeper:
    """A context around one flight on devices. `beat` is an extra of the runtime, `second` for once a second."""

    def __init__(self, flight: Flight, recorder: Any, *, name: str, folder: Path | None, twin: bool):
        """`folder` takes state and heartbeat; None: the vehicle's own folders, or one for a twin that goes with it."""
        self._flight, self._recorder, self._twin = flight, recorder, twin
        self._own = Path(tempfile.mkdtemp(prefix="glider-run-")) if twin and folder is None else None
        folder = folder or self._own
        self.run_folder, self.state_folder = (folder, folder) if folder else (hb.run_folder(), hb.state_folder())
        self._name = name
        self.life: Life
        self._pulse: Heartbeat | None = None
        self._guard: subprocess.Popen[bytes] | None = None
        self._recorder_seen = time.monotonic()

    # --- steps of a flight ------------------------------------------------------------------------------------------
    def claim(self) -> None:
        """First of all: be the vehicle's one flight, and read the state before it. BoardError where another flies."""
        try:
            self._pulse = Heartbeat.create(self.run_folder, 1.0 / self._flight.board.loop_hz, self._name)
        except (Held, OSError) as error:
            raise BoardError(str(error)) from None
        self.life = Life(self.state_folder, self._name)

    def prepare(self) -> None:
        """Before the board opens: plan, out-of-band process, state. BoardError says what is missing."""
        assert self._pulse is not None
        board = self._flight.board
        if not isinstance(board, DeviceBoard):
            raise BoardError(f"board '{board.name}' has no devices to bring up")
        density = float(water_density(0.0, 20.0, self._flight.mission.site.salinity))
        plan = make_plan(
            board, flight=self._name, settings=self._flight.vehicle.supervisor, water_density=density,
            watchdog=os.environ.get("GLIDER_WATCHDOG", ""), give_up_s=WITHOUT_PORTS_S if self._twin else 0.0,
        )  # fmt: skip
        write_plan(self.state_folder / PLAN, plan)
        self._start_guard(GUARD_START_S)
        self._pulse.say(Status.STARTING)
        self.life.armed()

    def begin(self) -> None:
        """The board is open; the first tick comes next."""
        self.life.diving()

    def flying(self) -> None:
        """Armed to the last: from here on a heartbeat is expected."""
        assert self._pulse is not None
        self._flight.board.out_of_band = self
        self._pulse.beat(0.0)
        self._pulse.say(Status.FLYING)
        notify("READY=1")

    def beat(self, t: float) -> None:
        """Every tick."""
        self._pulse.beat(t)  # type: ignore[union-attr]

    def ascend(self) -> None:
        """The supervisor gives the pump away: the out-of-band process takes over."""
        if self._pulse is not None:
            self._pulse.say(Status.TAKE_OVER)

    def second(self, timing: Any) -> None:
        """Once a second, between two ticks: tell who looks on, see to recorder and out-of-band process."""
        pulse = self._pulse
        assert pulse is not None
        self._tell_flight(pulse, timing)
        self._tell_recorder(pulse)
        if self._guard is not None and self._guard.poll() is not None:
            self._launch_guard()
        notify("WATCHDOG=1")

    def end(self, *, surfaced: bool, orderly: bool, reason: str) -> None:
        """The loop is over, the board closed: at the surface all is done, else the out-of-band process goes on."""
        with contextlib.suppress(OSError):  # a disk that refuses changes nothing about who brings it up
            self.life.ended(surfaced=surfaced, orderly=orderly, reason=reason)
        self._close(Status.DONE if surfaced or self._twin else Status.TAKE_OVER)

    # --- parts ------------------------------------------------------------------------------------------------------
    def _tell_flight(self, pulse: Heartbeat, timing: Any) -> None:
        from firmware.core.layouts import control_layout as ctl

        words, values, autopilot = pulse.words, pulse.values, self._flight.autopilot
        words[hb.W_MISSED], words[hb.W_WORST_NS] = timing.missed, int(1e9 * timing.worst_s)
        words[hb.W_MODE], words[hb.W_LEG] = int(autopilot.ap[ctl.MODE]), int(autopilot.ap[ctl.LEG])
        words[hb.W_LEGS], words[hb.W_PHASE] = len(self._flight.mission.leg), int(Phase.DIVING)
        values[hb.V_DEPTH_M] = autopilot.est[ctl.EST_DEPTH]
        values[hb.V_PITCH_RAD], values[hb.V_ROLL_RAD] = autopilot.est[ctl.EST_PITCH], autopilot.est[ctl.EST_ROLL]
        values[hb.V_SLIDER_M], values[hb.V_BALLAST_KG] = autopilot.commands[1], autopilot.commands[2]
        frame = autopilot.frame
        values[hb.V_BATTERY_V] = frame[BATTERY + 2] if frame[BATTERY + 1] == Validity.VALID else float("nan")
        words[hb.W_RSS_BYTES], words[hb.W_FILES] = resident_bytes(), open_files()

    def _tell_recorder(self, pulse: Heartbeat) -> None:
        words, condition, now = pulse.words, self._recorder.watch(), time.monotonic()
        if condition.level != Level.FAILED:
            self._recorder_seen = now
        words[hb.W_RECORDER_NS], words[hb.W_RECORDER_LEVEL] = condition.beat_ns, condition.level
        words[hb.W_WRITTEN], words[hb.W_DROPPED] = condition.written, condition.dropped
        words[hb.W_DISK_ERRORS] = condition.disk_errors
        self._flight.supervisor.G[RECORDER] = float(condition.level)
        expected = condition.beat_ns and now - self._recorder_seen < RECORDER_EXPECTED_S
        words[hb.W_RECORDER_EXPECTED] = 1 if expected else 0

    def _start_guard(self, seconds: float) -> None:
        """Have an out-of-band process watch: the service's if it does already, else one of our own."""
        pulse = self._pulse
        assert pulse is not None
        look = pulse.look()
        if look.guard == Guard.ASCENDING and look.guard_age_s < GUARD_SILENT_S:
            raise BoardError("the out-of-band process is bringing the vehicle up")
        if look.guard == Guard.ABSENT or look.guard_age_s > GUARD_SILENT_S:
            self._launch_guard()
        end = time.monotonic() + seconds
        while pulse.look().guard_age_s > GUARD_SILENT_S:
            if time.monotonic() > end or (self._guard is not None and self._guard.poll() is not None):
                raise BoardError("the out-of-band process did not start")
            time.sleep(0.01)

    def _launch_guard(self) -> None:
        root = Path(__file__).resolve().parents[2]
        paths = [str(root), *filter(None, [os.environ.get("PYTHONPATH")])]
        self._guard = subprocess.Popen(
            [sys.executable, "-P", "-m", "hal.outofband", "--run", str(self.run_folder), "--state",
             str(self.state_folder)],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, start_new_session=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        )  # fmt: skip

    def _close(self, status: Status) -> None:
        if self._pulse is None:
            return
        self._pulse.say(status)
        self._pulse.close()
        self._pulse = None
        if self._guard is not None and status == Status.DONE:
            try:
                self._guard.wait(5.0)
            except subprocess.TimeoutExpired:
                self._guard.kill()
                self._guard.wait()
        if self._own is not None:
            shutil.rmtree(self._own, ignore_errors=True)

    def __enter__(self) -> "Keeper":
        return self

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        """A flight that broke off before its first tick has left nothing behind; later it is for others to bring up."""
        if self._pulse is None:
            return
        dived = self.life.file.read().phase >= Phase.DIVING
        person = kind is not None and issubclass(kind, KeyboardInterrupt)
        if not dived:
            with contextlib.suppress(OSError):
                self.life.file.write(self.life.before.phase, flight=self._name, reason=self.life.before.reason)
        self._close(Status.DONE if self._twin or person or not dived else Status.TAKE_OVER)


def resident_bytes(pid: int | str = "self") -> int:
    """Resident memory of a process; 0 where the system does not say."""
    try:
        with open(f"/proc/{pid}/statm", "rb") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return 0


def open_files() -> int:
    """Descriptors that this process has open; 0 where the system does not say."""
    try:
        return len(os.listdir("/proc/self/fd"))
    except OSError:
        return 0
