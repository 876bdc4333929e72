"""Faults for which no flight is needed: wire, files, ports, processes. Each does the real thing, in simulated time
where there is a wire.

`disabled` takes away what notices the fault: a check sum, the memory of missing replies, strictness, a lock. Then the
row has to fail, which shows that it is this that notices.
"""

import contextlib
import math
import random
import resource
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from firmware.supervisor.settings import Limits
from hal.boardfile import BeaconTable, ImuTable
from hal.drivers.modbus_sensors import Beacon
from hal.drivers.vn100 import Vn100
from hal.ports import Validity
from hal.protocols import modbus, vn100
from hal.protocols.registers import preset, to_registers
from hal.strict import ConfigError
from tools.errors import InputError
from tools.faults.cases import Show
from tools.faults.wire import Line, Stamped, stamp_reply

Came = tuple[float | None, str, str]  # noticed after s, reaction, how it ended
SAFE, DAMAGE = "safe", "damaged"
RATE_HZ = 100.0


def _patched(on: bool, target: str, new: Any) -> Any:
    return mock.patch(target, new) if on else contextlib.nullcontext()


# --- row 7: check sums ----------------------------------------------------------------------------------------------
def damaged_imu(disabled: bool, folder: Path) -> Came:
    """A frame with flipped bits every eight seconds; with the sixth the device is in error, and none is delivered."""
    driver = Vn100(ImuTable(device="vn100", port="p"), 115_200)
    driver.attach(lambda data: True)
    driver.start(0.0)
    wrong, noticed = 0, None
    with _patched(disabled, "hal.protocols.vn100.crc_hqx", lambda data, start: 0):
        for n in range(1, int(60 * RATE_HZ)):
            now = n / RATE_HZ
            good = (0.0, -20.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -9.8)
            frame = bytearray(vn100.encode_binary(vn100.FLIGHT_MASK, n, *good))
            if n % 800 == 0:
                frame[20] ^= 0x40
            driver.feed(bytes(frame), now)
            wrong += driver.validity == Validity.VALID and abs(driver.values[1] - math.radians(-20.0)) > 1e-6
            if noticed is None and driver.validity == Validity.FAULT:
                noticed = now - 8.0
    return noticed, "device in error" if noticed else "none", DAMAGE if wrong else SAFE


def damaged_beacon(disabled: bool, folder: Path) -> Came:
    """Modbus replies with a broken check sum, one in a hundred."""
    values = [*to_registers("f32", 1.2), *to_registers("f32", 18.0)]
    broken: list[float] = []  # when

    def slave(frame: bytes, number: int) -> bytes:
        count = frame[5]
        data = b"".join(word.to_bytes(2, "big") for word in values[:count])
        reply = modbus.with_check_sum(frame[:2] + bytes((2 * count,)) + data)
        if number % 100 == 0:
            broken.append(line.now)
            reply = reply[:4] + bytes((reply[4] ^ 0x10,)) + reply[5:]
        return reply

    line = Line(slave, lambda rng: 0.002, seed=7)
    beacon = Beacon(BeaconTable(device="keller-33x", port="p"), preset("keller-33x"))
    beacon.start(0.0)
    line.bus.add(beacon.poll)
    wrong, noticed = 0, None
    with _patched(disabled, "hal.protocols.modbus.check_sum_holds", lambda frame: True):
        while line.now < 60.0 and noticed is None:
            line.run(line.now + 0.02)
            wrong += beacon.validity == Validity.VALID and abs(beacon.values[0] - 1.2e5) > 1.0
            if beacon.validity == Validity.FAULT and len(broken) >= 6:
                noticed = line.now - broken[0]
    return noticed, "device in error" if noticed else "none", DAMAGE if wrong else SAFE


# --- row 8: replies that answer something else ------------------------------------------------------------------------
def _late(rng: random.Random) -> float:
    luck = rng.random()
    if luck < 0.05:
        return math.inf
    return rng.uniform(0.03, 0.1) if luck < 0.15 else rng.uniform(0.001, 0.03)


def late_replies(disabled: bool, folder: Path) -> Came:
    """20,000 exchanges, one in twenty lost and one in ten late; every reply carries its request's number."""
    memory = {"forget_s": 0.0, "longest_s": 0.0} if disabled else {"forget_s": 0.5, "longest_s": 0.1}
    line = Line(stamp_reply, _late, seed=1, timeout_s=0.03, **memory)
    jobs = [Stamped(line, device, 0.02) for device in (1, 2, 3)]
    while line.requests < 20_000:
        line.run(line.now + 1.0)
    wrong = sum(job.misdelivered for job in jobs)
    seen = line.bus.counts.late > 0 and not wrong
    return 0.03 if seen else None, "never delivered" if not wrong else f"{wrong} delivered", DAMAGE if wrong else SAFE


def foreign_reply(change: Callable[[bytes], bytes]) -> Callable[[bool, Path], Came]:
    """Replies in another's name, of another function, of another length."""

    def show(disabled: bool, folder: Path) -> Came:
        line = Line(lambda frame, number: change(stamp_reply(frame, number)), lambda rng: 0.002, seed=2)
        job = Stamped(line, 1, 0.02, ask=3)
        accept = mock.patch("hal.protocols.modbus._answers", return_value=True)
        anything = mock.patch.object(
            modbus.RtuDecoder, "_size", lambda self, buffer, at, end: end - at if end - at > 6 else 0
        )
        with accept if disabled else contextlib.nullcontext(), anything if disabled else contextlib.nullcontext():
            line.run(2.0)
        counts = line.bus.counts
        if job.delivered:
            return None, f"{job.delivered} delivered", DAMAGE
        return line.bus.timeout_s if counts.timeouts else None, "never delivered", SAFE

    return show


def _wrong_id(reply: bytes) -> bytes:
    return modbus.with_check_sum(b"\x09" + reply[1:-2])


def _wrong_function(reply: bytes) -> bytes:
    return modbus.with_check_sum(reply[:1] + b"\x04" + reply[2:-2])


def _wrong_length(reply: bytes) -> bytes:
    return modbus.with_check_sum(reply[:2] + bytes((reply[2] + 2,)) + reply[3:-2] + b"\0\0")


# --- row 9: exceptions ------------------------------------------------------------------------------------------------
def exception(code: int) -> Callable[[bool, Path], Came]:
    """The beacon answers every request with an exception."""

    def show(disabled: bool, folder: Path) -> Came:
        line = Line(
            lambda frame, number: modbus.with_check_sum(bytes((frame[0], frame[1] | 0x80, code))), lambda rng: 0.002, 3
        )
        beacon = Beacon(BeaconTable(device="keller-33x", port="p"), preset("keller-33x"))
        beacon.start(0.0)
        line.bus.add(beacon.poll)
        if disabled:
            beacon.poll._in_error = None
        noticed = None
        while line.now < 5.0 and noticed is None:
            line.run(line.now + 0.01)
            noticed = line.now if beacon.validity == Validity.FAULT else None
        tries = line.bus.counts.exceptions
        asked = tries == 1 if code <= 3 else tries == 3
        return noticed, "device in error" if noticed and asked else f"{tries} tries", SAFE

    return show


# --- row 12: arming ---------------------------------------------------------------------------------------------------
def arming(kind: str) -> Callable[[bool, Path], Came]:
    """A vehicle that is not fit to arm; calibrations are those of a real board file."""

    def show(disabled: bool, folder: Path) -> Came:
        import msgspec

        from hal.board import BoardRequest, board_builder
        from tools.arming import Arming
        from tools.compose import build_flight, load_board_file

        flight = build_flight(mission="sawtooth")
        flight.board.open()
        limits = None if kind == "limits unset" else Limits(working_depth_m=50.0)
        flight.vehicle = msgspec.structs.replace(flight.vehicle, limits=limits)
        if kind == "depth not zero":
            flight.board.world.x[2] = 3.0
        if kind in ("never calibrated", "wrong hash"):
            file = load_board_file("twin")
            old, new = {
                "never calibrated": ("calibration = ", 'calibration = ""  # '),
                "wrong hash": ("per_m = 80000.0", "per_m = -80000.0"),
            }[kind]
            text = file.text.replace(old, new)
            request = BoardRequest(text=text, source="board.toml", vehicle=flight.vehicle)
            doubtful: Any = board_builder("twin")(request)
            flight.board.check_calibration = doubtful.check_calibration
            doubtful.close()
        checks = Arming(flight, folder=folder, hardware=True).run(disabled)
        refused = any(not check.passed for check in checks)
        return (0.0 if refused else None), "refuse to arm" if refused else "armed", SAFE if refused else "lost"

    return show


# --- rows 25 and 29: processes and the state file ---------------------------------------------------------------------
BEATING = """
import sys, time
from hal import heartbeat as hb
pulse = hb.Heartbeat.create(sys.argv[1], 0.02, "faults")
pulse.beat(0.0)
pulse.say(hb.Status.FLYING)
print("flying", flush=True)
while True:
    pulse.beat(0.0)
    time.sleep(0.02)
"""


@contextlib.contextmanager
def _beating(folder: Path) -> Iterator[subprocess.Popen]:
    flight = subprocess.Popen([sys.executable, "-c", BEATING, str(folder)], stdout=subprocess.PIPE)
    assert flight.stdout is not None
    flight.stdout.readline()
    try:
        yield flight
    finally:
        flight.kill()
        flight.wait()
        flight.stdout.close()


def loop_ends(how: signal.Signals) -> Callable[[bool, Path], Came]:
    """A process that flies is killed, or hangs; the out-of-band process watches its heartbeat, in real time."""

    def show(disabled: bool, folder: Path) -> Came:
        from hal.outofband.guard import Watch

        with _beating(folder) as flight:
            watch = Watch(folder, folder, service=False)
            watch.start()
            end = time.monotonic() + 0.5
            while time.monotonic() < end:
                watch.step()
                time.sleep(0.02)
            begin = time.monotonic()
            flight.send_signal(how)
            noticed = None
            while time.monotonic() - begin < 3.0 and noticed is None:
                if not disabled:
                    watch.step()
                noticed = time.monotonic() - begin if watch._ascent is not None else None
                time.sleep(0.02)
            watch.close()
        return noticed, "OOB" if noticed is not None else "none", SAFE if noticed is not None else "lost"

    return show


def restart(disabled: bool, folder: Path) -> Came:
    """Killed in every phase after arming: the next start only ascends."""
    from hal.state_file import Phase, StateFile
    from tools.unattended import Life

    resumed = 0
    for phase in (Phase.ARMED, Phase.DIVING, Phase.ABORTED):
        StateFile(folder).write(phase, flight="before")
        life = Life(folder, "after")
        ascends = life.ascent_only and not life.file.read().may_start
        resumed += disabled or not ascends
    return (None if resumed else 0.0), "ascent only" if not resumed else "resumed", "lost" if resumed else SAFE


def torn_state(disabled: bool, folder: Path) -> Came:
    """The power goes at every byte of a write of either copy; what is read has to be as bad as the worse of both."""
    from hal import state_file
    from hal.state_file import FlightState, Phase, StateFile

    def trusting(block: bytes) -> Any:
        """Without a check: the phase is the first digit that can be found."""
        digits = [byte for byte in block if 0x30 <= byte <= 0x39]
        return FlightState(Phase(min(digits[1] - 0x30, 5) if len(digits) > 1 else 0))

    believed = 0
    for old, new in ((Phase.ASHORE, Phase.DIVING), (Phase.DIVING, Phase.ASHORE)):
        for copy in (0, 1):
            for cut in range(0, state_file.BLOCK, 7):
                file = StateFile(folder)
                before = file.write(old)
                block = state_file.encode(FlightState(new, sequence=before.sequence + 1))
                for path in file.paths[:copy]:
                    path.write_bytes(block)
                kept = file.paths[copy].read_bytes()
                torn = block[:cut] + (b"" if cut % 2 else kept[cut:])
                file.paths[copy].write_bytes(torn)
                with _patched(disabled, "hal.state_file.decode", trusting):
                    found = file.read()
                untouched = old == Phase.ASHORE and copy == 0 and torn == kept  # nothing of it has changed yet
                finished = new == Phase.ASHORE and copy == 1 and torn == block  # all of it has
                believed += found.phase < Phase.DIVING and not (untouched or finished)
    return (
        (None if believed else 0.0),
        "the worse wins" if not believed else f"{believed} believed",
        ("lost" if believed else SAFE),
    )


# --- row 26: the wall clock -------------------------------------------------------------------------------------------
def wall_clock(disabled: bool, folder: Path) -> Came:
    """The wall clock is set an hour on and back while the board's clock runs."""
    from hal.clocks import MonotonicClock

    class WallClock(MonotonicClock):
        def __init__(self) -> None:
            self._start = time.time()

        def now(self) -> float:
            return time.time() - self._start

        def sleep_until(self, deadline: float) -> None:
            time.sleep(min(max(deadline - self.now(), 0.0), 0.05))

    clock = WallClock() if disabled else MonotonicClock()
    honest, worst = time.time, 0.0
    for shift in (3600.0, -3600.0, 0.0):
        before = clock.now()
        with mock.patch("time.time", lambda shift=shift: honest() + shift):
            begin = time.monotonic()
            clock.sleep_until(before + 0.01)
            worst = max(worst, abs(clock.now() - before - (time.monotonic() - begin)))
    steady = worst < 0.5
    return (0.0 if steady else None), "no effect" if steady else f"{worst:.0f} s", SAFE if steady else "lost"


# --- rows 27 and 28: recorder and log ---------------------------------------------------------------------------------
def full_disk(disabled: bool, folder: Path) -> Came:
    """The disk takes no more (a limit on file size) while records come; flying and recording go on."""
    from firmware.telemetry import TICK
    from hal.recorder.recorder import Recorder

    path = folder / "full.mcap"
    recorder = Recorder(path, (TICK,))
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, hard))
    try:
        recorder.start()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    channel, noticed, refused, committed = recorder.channel("/tick"), None, None, 0
    begin = time.monotonic()
    while time.monotonic() - begin < 8.0 and noticed is None:
        for _ in range(20):
            channel.values[:] = committed
            committed += channel.commit(0.02 * committed)
        time.sleep(0.01)
        if refused is None and path.stat().st_size > 150_000:
            refused = time.monotonic()
        if not disabled and recorder.watch().level > 0 and refused is not None:
            noticed = time.monotonic() - refused
    recorder.close()
    return noticed, "LOG" if noticed is not None else "none", SAFE


def cut_log(disabled: bool, folder: Path) -> Came:
    """A log with a torn sector at 300 places: what is read has to be what was written, all of it up to there."""
    from firmware.telemetry import TICK
    from hal.recorder import disk
    from hal.recorder.logfile import LogFile
    from tools.log.reader import read_log

    path = folder / "whole.mcap"
    fd = disk.create(str(path))
    file, rows = disk.DiskFile(fd), 2000
    log = LogFile(file, [TICK], attachments={}, metadata={})
    for number in range(rows):
        log.record(0, number + 1, 0.02 * number, np.full(TICK.width, float(number)).tobytes())
        if number % 25 == 24:
            log.flush()
    log.finish({})
    file.sync()
    disk.close(fd, str(path), keep=True)
    whole, rng, wrong, lost = path.read_bytes(), random.Random(5), 0, 0.0
    torn = folder / "torn.mcap"
    for cut in np.linspace(400, len(whole), 300).astype(int):
        tail = bytearray(whole[cut : cut + 40_000])
        for _ in range(3):
            if tail:
                tail[rng.randrange(min(512, len(tail)))] ^= 1 << rng.randrange(8)
        torn.write_bytes(whole[:cut] + tail)
        with _patched(disabled, "tools.log.framing._chunk", _unchecked):
            topic = _ticks(read_log, torn)
        data = np.zeros((0, TICK.width)) if topic is None else topic.data
        first = data[:, 0]
        wrong += int(np.any(data != np.round(data[:, :1])) or np.any(np.diff(first) <= 0.0))
        there = 25 * int(np.searchsorted(_ends(whole), cut, side="right"))
        lost = max(lost, 0.02 * (there - int(np.sum(first < there))))
    good = wrong == 0 and lost <= 1.0
    return (
        (0.0 if good else None),
        f"{wrong} damaged, {lost:.1f} s lost" if not good else "valid prefix",
        (SAFE if good else DAMAGE),
    )


def _ticks(read_log: Any, path: Path) -> Any:
    """The log's ticks; None where nothing of them is there."""
    try:
        topic = read_log(path).topics.get("/tick")
    except InputError:  # cut before anything of it was there
        return None
    return topic if topic is not None and topic.data is not None else None


def _unchecked(body: bytes) -> tuple[bytes | None, str]:
    """A chunk's content, whatever its check sum says."""
    from tools.log.framing import _CHUNK

    return (body[_CHUNK.size + 8 :], "") if len(body) > _CHUNK.size + 8 else (None, "short")


def _ends(whole: bytes) -> np.ndarray:
    """Where the chunks of a whole log end."""
    ends, place = [], 8
    while place + 9 < len(whole):
        length = int.from_bytes(whole[place + 1 : place + 9], "little")
        place += 9 + length
        if whole[place - 9 - length] == 0x06:
            ends.append(place)
    return np.array(ends)


# --- row 30: files ----------------------------------------------------------------------------------------------------
def bad_files(disabled: bool, folder: Path) -> Came:
    """Files with an unknown key, a wrong type, NaN, out of limits, too deep, no end."""
    from firmware.guidance.mission import decode_mission
    from firmware.model.library import shipped
    from firmware.model.vehicle import decode_vehicle
    from hal.boardfile import decode_device_file
    from tools.compose import load_board_file

    vehicle, mission = shipped("model/vehicles")["roughie"], shipped("guidance/missions")["sawtooth"]
    board = load_board_file("roughie").text
    bad = [
        (decode_vehicle, vehicle.replace("K_D0 =", "K_D00 ="), "K_D00"),
        (decode_vehicle, vehicle.replace("m_t = 13.0", 'm_t = "heavy"'), "m_t"),
        (decode_vehicle, vehicle.replace("K_q = -8.0", "K_q = nan"), "K_q"),
        (decode_vehicle, vehicle.replace("m_t = 13.0", "m_t = 1e9"), "m_t"),
        (decode_mission, mission.replace("depth_m = 4.0", "depth_m = 40.0"), "depth_m"),
        (decode_mission, mission.replace("time_limit_s = 120.0", "", 1), "time_limit_s"),
        (decode_mission, mission.replace("time_limit_s = 600.0", "time_limit_s = inf"), "time_limit_s"),
        (decode_mission, mission + "\n[a.b.c.d.e.f.g.h.i]\nj = 1\n", "a"),
        (decode_device_file, board.replace("per_m", "per_mm"), "per_mm"),
        (decode_device_file, board.replace('port = "imu"', "port = 5", 1), "port"),
    ]
    refused = 0
    for decode, text, key in bad:
        try:
            tomllib.loads(text) if disabled else decode(text, "file.toml")
        except ConfigError as error:
            refused += "file.toml:" in str(error) and key in str(error) and "\n" not in str(error)
    good = refused == len(bad)
    return (
        (0.0 if good else None),
        "refused" if good else f"{len(bad) - refused} of {len(bad)} read",
        (SAFE if good else "lost"),
    )


# --- row 31: hostile bytes --------------------------------------------------------------------------------------------
def hostile_bytes(disabled: bool, folder: Path) -> Came:
    """Damage through every codec: back in step within a longest frame, no exception, nothing made up, little kept."""
    from tools.figures.codecs import codecs, run_codec

    bad, made_up = 0, 0
    crc = _patched(disabled, "hal.protocols.vn100.crc_hqx", lambda data, start: 0)
    check = _patched(disabled, "hal.protocols.modbus.check_sum_holds", lambda frame: True)
    with crc, check:
        for codec in codecs():
            outcome = run_codec(codec, 100_000, random.Random(f"31 {codec.name}"), lambda n: None)
            bad += not outcome.passed or outcome.most_kept > codec.longest
            if codec.name in ("vn100", "modbus expected reply"):
                decoder, rng = codec.make(), random.Random(31)
                made_up += sum(len(decoder.feed(rng.randbytes(512))) for _ in range(400))
    good = not bad and not made_up
    longest_s = 256 * 10 / 9600
    return (longest_s if good else None), "back in step" if good else f"{made_up} made up", SAFE if good else DAMAGE


# --- row 34: ports ----------------------------------------------------------------------------------------------------
def two_programs(disabled: bool, folder: Path) -> Came:
    """A port that another program holds."""
    import os

    from hal.transport.port import Busy, SerialPort
    from sim_backend.twins.line import open_pty

    master, slave, path = open_pty()
    first = SerialPort(path, 115_200)
    first.open()
    held = [sys.executable, "-c", f"from hal.transport.port import SerialPort as S; S({path!r}, 9600).open()"]
    try:
        if disabled:
            with mock.patch("serial.serialposix.fcntl.flock", return_value=None):
                SerialPort(path, 115_200).open()
            return None, "opened twice", "lost"
        second = subprocess.run(held, capture_output=True, text=True, check=False)
        refused = "Busy" in second.stderr
        with contextlib.suppress(Busy):
            SerialPort(path, 115_200).open()
            refused = False
        return (0.0 if refused else None), "refused" if refused else "opened twice", SAFE if refused else "lost"
    finally:
        first.close()
        for fd in (master, slave):
            os.close(fd)


# --- row 32: the console ----------------------------------------------------------------------------------------------
def console(disabled: bool, folder: Path) -> Came:
    """Garbage typed at the bench of a twinned board: nothing is enabled, nothing moves, the console goes on."""
    from tools.bench.client import Bench, BenchError
    from tools.bench.commands import Commands
    from tools.compose import load_board_file

    file, rng = load_board_file("twin"), random.Random(32)
    said: list[str] = []
    with Bench(file.text, file.source, file.kind, "roughie", None) as bench:
        commands = Commands(bench, said.append, lambda question: "", lambda: True, lambda *a: None, folder)
        if disabled:
            bench.ask("enable", on=True)
        survived = 0
        words = [*Commands.names(), "slider", "servo", "0.01", "nan", "-1e9", "\x00", "ü", "#", "'", "$(x)"]
        words = [word for word in words if word not in ("enable", "quit", "exit", "accept")]
        for _ in range(150):
            line = "".join(map(chr, (rng.randrange(1, 0x250) for _ in range(12))))
            if rng.random() < 0.5:
                line = " ".join(rng.choice(words[-9:]) for _ in range(rng.randrange(1, 5)))
            with contextlib.suppress(BenchError):
                commands.run(line)
            survived += 1
        for line in ("jog slider 5", "goto ballast 20", "sweep servo"):
            with contextlib.suppress(BenchError):
                commands.run(line)
        state = bench.snapshot()
    moved = any(item["target"] is not None for item in state["actuators"].values())
    good = not state["enabled"] and not moved and survived == 150
    return (0.0 if good else None), "no effect" if good else "actuators moved", SAFE if good else "lost"


def shows() -> list[Show]:
    """Every fault that needs no flight."""
    never = "never delivered"
    return [
        Show(7, "damaged IMU frames", damaged_imu, "device in error", 60.0),
        Show(7, "damaged Modbus replies", damaged_beacon, "device in error", 60.0),
        Show(8, "late and lost replies", late_replies, never, 0.1),
        Show(8, "reply in another's name", foreign_reply(_wrong_id), never, 0.1),
        Show(8, "reply of another function", foreign_reply(_wrong_function), never, 0.1),
        Show(8, "reply of another length", foreign_reply(_wrong_length), never, 0.1),
        *(Show(9, f"exception {code}", exception(code), "device in error", 0.1 if code <= 3 else 1.0)
          for code in range(1, 7)),
        *(Show(12, kind, arming(kind), "refuse to arm", 1.0)
          for kind in ("depth not zero", "limits unset", "never calibrated", "wrong hash")),
        Show(25, "process killed", loop_ends(signal.SIGKILL), "OOB", 2.0),
        Show(25, "loop hung", loop_ends(signal.SIGSTOP), "OOB", 2.0),
        Show(25, "restart", restart, "ascent only", 2.0),
        Show(26, "an hour on and back", wall_clock, "no effect", 0.0),
        Show(27, "disk full", full_disk, "LOG", 1.0),
        Show(28, "torn at 300 places", cut_log, "valid prefix", 0.0),
        Show(29, "torn at every seventh byte", torn_state, "the worse wins", 0.0),
        Show(30, "files", bad_files, "refused", 0.0),
        Show(31, "random and mutated bytes", hostile_bytes, "back in step", 1.0),
        Show(32, "garbage", console, "no effect", 0.0),
        Show(34, "a second program", two_programs, "refused", 0.0),
    ]  # fmt: skip
