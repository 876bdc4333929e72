"""The recorder with its real process: the file, its independent decoding, signals, a full disk, sudden ends."""

import json
import os
import resource
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from glider.hal.recorder.condition import RecorderLevel
from glider.hal.recorder.recorder import NullRecorder, Recorder
from glider.hal.recorder.schema import ERROR, INFO, Field, RecordSpec
from glider.tools.data.log.reader import read_log

TICK = RecordSpec(
    "/tick",
    "glider/msg/Tick",
    (Field("t_s", "s", "time"), Field("depth_m", "m", "depth"), Field("force_n", "N", "body axes", 3)),
)
TRUTH = RecordSpec("/truth", "glider/msg/Truth", (Field("x_m", "m", "north"),), spare=True)


def _fly(recorder, ticks, start=0):
    channel = recorder.channel("/tick")
    for number in range(start, start + ticks):
        channel.values[:] = (number / 50, np.sin(number), number, -number, np.nan)
        channel.commit(number / 50)


def _await(condition, seconds=30.0):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def test_another_program_decodes_what_was_recorded(tmp_path):
    path = tmp_path / "x.mcap"
    with Recorder(
        path, [TICK, TRUTH], attachments={"vehicle.toml": "name = 1\n"}, metadata={"seed": "3"}, epoch_ns=10**18
    ) as recorder:
        _fly(recorder, 300)
        recorder.channel("/truth").values[0] = 4.0
        recorder.channel("/truth").commit(6.0)
        recorder.event(6.5, ERROR, "pump stalls: äöü")
        report = recorder.close({"reason": "done"})
    assert (report.written, report.dropped, report.damaged, report.complete) == (302, 0, 0, True)
    assert report.bytes == path.stat().st_size
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        seen = [(c.topic, m.log_time, m.sequence, d) for _, c, m, d in reader.iter_decoded_messages()]
        texts = {item.name: item.data for item in reader.iter_attachments()}
        facts = {item.name: item.metadata for item in reader.iter_metadata()}
        assert reader.get_summary().statistics.message_count == 302
    ticks = [item for item in seen if item[0] == "/tick"]
    for number, (_, log_time, sequence, message) in enumerate(ticks):
        assert log_time == 10**18 + round(number / 50 * 1e9)
        assert sequence == number + 1
        assert message.t_s == number / 50
        assert message.depth_m == np.sin(number)
        assert list(message.force_n[:2]) == [number, -number]
        assert np.isnan(message.force_n[2])
    truth = next(item for item in seen if item[0] == "/truth")
    assert truth[3].x_m == 4.0
    event = next(item for item in seen if item[0] == "/events")[3]
    assert (event.level, event.msg, event.stamp.sec) == (ERROR, "pump stalls: äöü", 10**9 + 6)
    assert texts["vehicle.toml"] == b"name = 1\n"
    assert facts["glider"]["seed"] == "3"
    assert facts["glider_end"]["reason"] == "done"


def test_files_that_cannot_be_written_are_refused_at_the_start(tmp_path):
    path = tmp_path / "x.mcap"
    path.write_text("precious")
    with pytest.raises(FileExistsError):
        Recorder(path, [TICK]).start()
    assert path.read_text() == "precious"
    with pytest.raises(FileNotFoundError) as error:
        Recorder(tmp_path / "no" / "x.mcap", [TICK]).start()
    assert error.value.filename.endswith("x.mcap")


def test_a_disk_that_is_full_at_the_start_is_an_error_and_leaves_no_file(tmp_path):
    recorder = Recorder(tmp_path / "x.mcap", [TICK])
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, hard))  # the recording process inherits it
    try:
        with pytest.raises(OSError, match="too large"):
            recorder.start()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert list(tmp_path.iterdir()) == []


def test_an_exception_in_flight_still_closes_the_log(tmp_path):
    def crash():
        with Recorder(tmp_path / "x.mcap", [TICK]) as recorder:
            _fly(recorder, 10)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        crash()
    log = read_log(tmp_path / "x.mcap")
    assert log.whole
    assert log.topics["/tick"].count == 10


def test_starting_may_go_on_while_other_things_are_done(tmp_path):
    recorder = Recorder(tmp_path / "x.mcap", [TICK])
    recorder.start(wait=False)
    _fly(recorder, 5)
    recorder.wait_ready()
    assert recorder.close().written == 5
    assert recorder.close().written == 5  # asked again, answered the same


def test_a_time_that_is_none_does_not_stop_the_recording(tmp_path):
    with Recorder(tmp_path / "x.mcap", [TICK]) as recorder:
        for time_s in (1.0, float("nan"), float("inf"), -5.0, 1e30, 2.0):
            recorder.channel("/tick").commit(time_s)
        assert recorder.close().written == 6
    assert read_log(tmp_path / "x.mcap").whole


def test_stop_signals_do_not_reach_the_recording(tmp_path):
    with Recorder(tmp_path / "x.mcap", [TICK]) as recorder:
        pid = recorder._process.pid
        assert os.getpgid(pid) != os.getpgid(0)
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            os.kill(pid, number)
        _fly(recorder, 50)
        _await(lambda: recorder.health().written == 50)
        assert recorder.health().alive
        assert recorder.close().complete


def test_a_full_disk_is_said_once_and_loses_nothing_once_it_has_room(tmp_path, capfd):
    path = tmp_path / "x.mcap"
    with Recorder(path, [TICK], sync_period_s=0.05) as recorder:
        _fly(recorder, 100)
        _await(lambda: recorder.health().written == 100)
        pid = recorder._process.pid
        _, hard = resource.prlimit(pid, resource.RLIMIT_FSIZE)
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (path.stat().st_size + 100, hard))
        _fly(recorder, 400, start=100)
        _await(lambda: recorder.health().disk_errors >= 3)
        health = recorder.health()
        assert health.alive
        assert health.errno != 0
        assert health.written == 500  # taken out of the ring all the same
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (hard, hard))
        _await(lambda: recorder.health().errno == 0)
        report = recorder.close()
    assert report.complete
    assert report.disk_errors >= 3
    said = capfd.readouterr().err.splitlines()
    assert [("too large" in line.lower(), "again" in line) for line in said] == [(True, False), (False, True)]
    assert read_log(path).topics["/tick"].count == 500


def test_a_recording_process_that_dies_does_not_stop_the_flight(tmp_path):
    recorder = Recorder(tmp_path / "x.mcap", [TICK], slots=64)
    recorder.start()
    _fly(recorder, 30)
    _await(lambda: recorder.health().written == 30)
    recorder._process.kill()
    _await(lambda: not recorder.health().alive)
    _fly(recorder, 200)
    report = recorder.close()
    assert not report.complete
    assert report.dropped == 200
    assert "died" in report.error


FLIGHT = """
import sys, time, json
from glider.hal.recorder.condition import RecorderLevel
from glider.hal.recorder.recorder import Recorder
from glider.hal.recorder.schema import Field, RecordSpec
spec = RecordSpec("/tick", "glider/msg/Tick", (Field("t_s", "s", "time"), Field("n", "1", "number")))
recorder = Recorder(sys.argv[1], [spec], metadata={"vehicle": "roughie"})
recorder.start()
print(recorder._process.pid, flush=True)
channel, start, number = recorder.channel("/tick"), time.monotonic(), 0
while True:
    channel.values[:] = number / 100, number
    channel.commit(number / 100)
    number += 1
    print(number, flush=True)
    time.sleep(max(0.0, start + number / 100 - time.monotonic()))
"""


def _fly_and_kill(path, seconds, *, both):
    """A flight in a process of its own, killed; the number of records it had committed for sure."""
    with subprocess.Popen([sys.executable, "-c", FLIGHT, str(path)], stdout=subprocess.PIPE) as flight:
        pid = int(flight.stdout.readline())
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            committed = int(flight.stdout.readline())
        if both:  # the power goes: nobody gets to finish anything
            os.kill(pid, signal.SIGKILL)
        flight.kill()
    return committed


def _check_numbers(log, at_least):
    tick = log.topics["/tick"]
    np.testing.assert_array_equal(tick.column("n"), np.arange(tick.count))
    assert tick.count >= at_least


def test_a_killed_flight_is_recorded_to_its_last_tick(tmp_path):
    path = tmp_path / "x.mcap"
    committed = _fly_and_kill(path, 1.0, both=False)
    _await(lambda: read_log(path).complete)
    log = read_log(path)
    assert log.whole
    assert "died" in log.ending["ended"]
    _check_numbers(log, committed)


def test_when_the_power_goes_at_most_a_second_is_lost(tmp_path):
    path = tmp_path / "x.mcap"
    committed = _fly_and_kill(path, 2.2, both=True)
    log = read_log(path)
    assert not log.complete
    assert log.metadata["vehicle"] == "roughie"
    _check_numbers(log, committed - 100)


def test_the_recording_process_loads_little_and_the_flight_loads_no_mcap():
    code = "import sys, json, {}; print(json.dumps(sorted({{m.split('.')[0] for m in sys.modules}})))"

    def loaded(module):
        done = subprocess.run([sys.executable, "-c", code.format(module)], capture_output=True, check=True, text=True)
        return set(json.loads(done.stdout))

    writer, flight = loaded("glider.hal.recorder.writer"), loaded("glider.hal.recorder.recorder")
    assert "mcap" in writer
    assert not writer & {"numba", "numpy", "msgspec", "firmware", "sim_backend", "tools"}
    assert not flight & {"numba", "mcap", "msgspec", "firmware", "sim_backend", "tools"}


def test_recording_nothing_has_the_same_surface(tmp_path):
    with NullRecorder([TICK, TRUTH]) as recorder:
        channel = recorder.channel("/tick")
        assert channel.values.shape == (TICK.width,)
        assert channel.commit(0.0)
        assert recorder.event(0.0, INFO, "x")
        assert recorder.health().alive
        assert recorder.close({"reason": ""}).complete
    wanted = {name for name in dir(Recorder) if not name.startswith("_")}
    assert wanted <= {name for name in dir(NullRecorder) if not name.startswith("_")}


def test_two_specs_of_one_topic_are_refused(tmp_path):
    with pytest.raises(ValueError, match="a topic"):
        Recorder(tmp_path / "x.mcap", [TICK, TICK])


def _watch_until(recorder, condition):
    _await(lambda: condition(recorder.watch()))


def test_a_recording_process_that_dies_is_replaced_and_nothing_handed_over_later_is_lost(tmp_path):
    path = tmp_path / "x.mcap"
    recorder = Recorder(path, [TICK], sync_period_s=0.05)
    recorder.start()
    assert recorder.watch().level in (
        RecorderLevel.OK,
        RecorderLevel.DROPPING,
    )  # it may not have looked at the ring yet
    _fly(recorder, 100)
    _await(lambda: recorder.health().written == 100)
    _watch_until(recorder, lambda condition: condition.level == RecorderLevel.OK)
    time.sleep(0.3)  # so that these are on the disk
    recorder._process.kill()
    _await(lambda: not recorder.health().alive)
    _fly(recorder, 50, start=100)
    assert recorder.watch().level == RecorderLevel.FAILED
    _watch_until(recorder, lambda condition: condition.level == RecorderLevel.OK and condition.pending == 0)
    _fly(recorder, 50, start=150)
    report = recorder.close({"reason": "done"})
    assert (report.parts, report.complete, report.dropped) == (2, False, 0)
    assert recorder.condition.restarts == 1
    first, second = read_log(path), read_log(tmp_path / "x-part2.mcap")
    assert not first.complete
    assert second.whole
    assert second.ending["reason"] == "done"
    times = np.concatenate([log.topics["/tick"].column("t_s") for log in (first, second)])
    np.testing.assert_array_equal(times, np.arange(200) / 50)
    assert second.topics["/tick"].missing == 0
    assert second.metadata["part"] == "2"


def test_a_recording_process_that_hangs_is_replaced(tmp_path, monkeypatch):
    with Recorder(tmp_path / "x.mcap", [TICK]) as recorder:
        _watch_until(recorder, lambda condition: condition.level == RecorderLevel.OK)
        os.kill(recorder._process.pid, signal.SIGSTOP)
        with monkeypatch.context() as patch:  # for this process alone: the next may take its time to start
            patch.setattr("glider.hal.recorder.recorder.HUNG_S", 0.5)
            _watch_until(recorder, lambda condition: condition.level == RecorderLevel.FAILED)
            _watch_until(recorder, lambda condition: condition.restarts == 1)
        _watch_until(recorder, lambda condition: condition.level == RecorderLevel.OK)
        assert recorder.close().parts == 2


def test_a_folder_that_is_gone_is_tried_again_ever_more_seldom(tmp_path, monkeypatch):
    monkeypatch.setattr("glider.hal.recorder.recorder.FIRST_RETRY_S", 0.1)
    folder = tmp_path / "card"
    folder.mkdir()
    recorder = Recorder(folder / "x.mcap", [TICK])
    recorder.start()
    folder.rename(tmp_path / "gone")  # the card is pulled: the open file may live on, a new one cannot be made
    recorder._process.kill()
    _watch_until(recorder, lambda condition: condition.restarts >= 2)
    assert recorder.condition.level == RecorderLevel.FAILED
    folder.mkdir()
    _watch_until(recorder, lambda condition: condition.level == RecorderLevel.OK)
    assert recorder.close().parts == recorder.condition.restarts + 1


def test_a_refusing_disk_and_a_full_ring_are_seen_as_dropping(tmp_path):
    path = tmp_path / "x.mcap"
    with Recorder(path, [TICK], sync_period_s=0.05) as recorder:
        _watch_until(recorder, lambda condition: condition.level == RecorderLevel.OK)
        pid = recorder._process.pid
        _, hard = resource.prlimit(pid, resource.RLIMIT_FSIZE)
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (path.stat().st_size + 10, hard))
        _fly(recorder, 100)
        _watch_until(recorder, lambda condition: condition.level == RecorderLevel.DROPPING and condition.errno)
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (hard, hard))
        _watch_until(recorder, lambda condition: condition.level == RecorderLevel.OK)
        os.kill(pid, signal.SIGSTOP)
        _fly(recorder, 3000)
        condition = recorder.watch()
        os.kill(pid, signal.SIGCONT)
        assert condition.level == RecorderLevel.DROPPING
        assert condition.dropped > 0
