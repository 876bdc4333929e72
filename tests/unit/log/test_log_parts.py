"""A flight's log in parts, written by recording processes that are killed: read, shown, exported, repaired as one."""

import json
import re
import shutil
import time

import numpy as np
import pytest
from click.testing import CliRunner

from glider.hal.recorder.recorder import Recorder
from glider.hal.recorder.schema import INFO
from glider.tools.cli.log import log as log_command
from glider.tools.data.errors import InputError
from glider.tools.data.log.parts import FlightLog, read_flight
from glider.tools.data.log.reader import read_log
from glider.tools.data.log.repair import repair
from glider.tools.data.log.rundata import run_of
from glider.tools.data.runs.case import load_case
from tests.support.log_files import METADATA, TICK, TRUTH, VEHICLE, write_small_log

BETWEEN = 13  # ticks that a recording process takes with it when it dies


def _await(condition, seconds=20.0):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def _commit(recorder, ticks, numbers):
    """Ticks of those numbers, and a truth every other one."""
    tick, truth = recorder.channel("/tick"), recorder.channel("/truth")
    for number in numbers:
        tick.values[:] = ticks[number]
        tick.commit(number / 50)
        if number % 2 == 0:
            truth.values[:] = (number / 50, number)
            truth.commit(number / 50)


def _lose(recorder, count):
    """What a process had taken and not brought to the disk when it died: numbers that no file has."""
    recorder.channel("/tick")._sequence += count


@pytest.fixture(scope="module")
def flight(tmp_path_factory, rows):
    """Three parts: two recording processes killed; thirteen ticks lost before the second, none before the third."""
    path = tmp_path_factory.mktemp("parts") / "dive.mcap"
    recorder = Recorder(path, (TICK, TRUTH), attachments={"vehicle.toml": VEHICLE}, metadata=METADATA,
                        sync_period_s=0.05)  # fmt: skip
    recorder.start()
    bounds = ((0, 200), (200 + BETWEEN, 350), (350, 500))
    for part, (start, end) in enumerate(bounds, start=1):
        _commit(recorder, rows, range(start, end))
        recorder.event(start / 50, INFO, f"part {part}")
        _await(lambda: recorder.health().pending == 0)
        if part == 3:
            break
        time.sleep(0.3)  # so that these are on the disk
        recorder._process.kill()
        _await(lambda: not recorder.health().alive)
        if part == 1:
            _lose(recorder, BETWEEN)
        _await(lambda part=part: recorder.watch().restarts == part and recorder.health().alive)
    assert recorder.close({"reason": "done"}).parts == 3
    return path


def test_the_first_file_gives_the_whole_flight(flight, rows):
    log = read_flight(flight)
    assert isinstance(log, FlightLog)
    assert [part.log.path.name for part in log.parts] == ["dive.mcap", "dive-part2.mcap", "dive-part3.mcap"]
    assert [part.log.complete for part in log.parts] == [False, False, True]
    tick = log.topics["/tick"]
    np.testing.assert_array_equal(tick.data, np.delete(rows, range(200, 200 + BETWEEN), axis=0))
    assert (np.diff(tick.times_ns) > 0).all()
    assert tick.missing == BETWEEN
    assert log.parts[1].lost["/tick"] == BETWEEN
    assert log.parts[1].gap_s == pytest.approx((BETWEEN + 1) / 50)
    assert set(log.parts[2].lost.values()) == {0}
    assert [event.text for event in log.events] == ["part 1", "part 2", "part 3"]
    assert (log.complete, log.whole) == (True, False)
    assert log.ending["reason"] == "done"
    assert log.metadata["site"] == "pool"
    assert "part" not in log.metadata
    assert log.duration_s == pytest.approx(499 / 50)


def test_a_part_given_alone_stands_alone(flight, rows):
    log = read_flight(flight.with_name("dive-part2.mcap"))
    assert not isinstance(log, FlightLog)
    np.testing.assert_array_equal(log.topics["/tick"].data, rows[200 + BETWEEN : 350])
    assert log.topics["/tick"].missing == 0
    done = CliRunner().invoke(log_command, ["info", str(flight.with_name("dive-part2.mcap"))])
    assert "part 2 of" in done.stdout


def test_a_log_without_parts_is_read_as_ever(small_log):
    assert type(read_flight(small_log)) is type(read_log(small_log))
    assert read_flight(small_log).whole


@pytest.fixture
def copied(flight, tmp_path):
    """The flight's files, to be spoilt."""
    for file in flight.parent.glob("dive*.mcap"):
        shutil.copy(file, tmp_path)
    return tmp_path / "dive.mcap"


def test_info_names_every_part_and_what_is_lost_between(copied):
    done = CliRunner().invoke(log_command, ["info", str(copied)])
    assert done.exit_code == 0, done.output
    assert "dive.mcap: in 3 parts; 9.98 s" in done.stdout
    assert "dive-part2.mcap: cut" in done.stdout
    assert f" {BETWEEN} of /tick (0.28 s)" in done.stdout
    assert "dive-part3.mcap: complete" in done.stdout
    shown = json.loads(CliRunner().invoke(log_command, ["info", str(copied), "--json"]).stdout)
    assert [part["part"] for part in shown["parts"]] == [1, 2, 3]
    assert shown["parts"][1]["missing_before"]["/tick"] == BETWEEN
    assert shown["topics"]["/tick"]["missing"] == BETWEEN


def test_a_missing_middle_part_is_named_and_its_records_counted(copied):
    copied.with_name("dive-part2.mcap").unlink()
    log = read_flight(copied)
    assert [path.name for path in log.absent.values()] == ["dive-part2.mcap"]
    assert log.parts[1].number == 3
    assert log.parts[1].lost["/tick"] == 150
    assert log.topics["/tick"].missing == 150
    done = CliRunner().invoke(log_command, ["info", str(copied)])
    lines = [line.strip() for line in done.stdout.splitlines()[1:4]]
    assert lines[1].startswith("dive-part2.mcap: ")
    assert re.match(r"dive-part3\.mcap: complete; .* 150 of /tick", lines[2])
    done = CliRunner().invoke(log_command, ["export", str(copied), "--json"])
    assert lines[1] in json.loads(done.stdout)["notes"]


def test_parts_whose_first_file_is_gone_are_named(copied):
    copied.unlink()
    with pytest.raises(InputError, match=r"dive-part2\.mcap, dive-part3\.mcap"):
        read_flight(copied)


def test_export_takes_the_parts_together(copied, rows):
    done = CliRunner().invoke(log_command, ["export", str(copied), "--json"])
    assert done.exit_code == 0, done.output
    result = json.loads(done.stdout)
    assert result["rows"] == 500 - BETWEEN
    assert any(f"{BETWEEN} of /tick" in note for note in result["notes"])
    (run,) = load_case(copied.with_name("dive")).runs
    np.testing.assert_array_equal(run.t, np.delete(rows[:, 0], range(200, 200 + BETWEEN)))


def test_repair_makes_one_log_of_the_parts(copied):
    before = read_flight(copied)
    report = repair(copied)
    assert [path.name for path in report.parts] == ["dive.mcap", "dive-part2.mcap", "dive-part3.mcap"]
    after = read_flight(report.out)
    assert after.whole
    assert not isinstance(after, FlightLog)
    for name in ("/tick", "/truth", "/events"):
        np.testing.assert_array_equal(after.topics[name].sequences, before.topics[name].sequences)
        np.testing.assert_array_equal(after.topics[name].times_ns, before.topics[name].times_ns)
    assert after.topics["/tick"].data.tobytes() == before.topics["/tick"].data.tobytes()
    assert after.topics["/tick"].missing == BETWEEN
    assert after.events == before.events
    assert after.attachments == before.attachments
    assert after.metadata["repaired_from"] == "dive.mcap, dive-part2.mcap, dive-part3.mcap"
    assert after.ending == before.ending
    exported, wanted = run_of(after), run_of(before)
    assert {name: column.tobytes() for name, column in exported.run.columns.items()} == {
        name: column.tobytes() for name, column in wanted.run.columns.items()
    }


def test_repair_of_a_part_alone_stays_a_part(copied):
    report = repair(copied.with_name("dive-part2.mcap"))
    log = read_log(report.out)
    assert log.whole
    assert log.metadata["part"] == "2"
    assert log.topics["/tick"].missing == 0


@pytest.mark.parametrize("what", ["another recording", "another number", "a log of its own", "no log", "a copy"])
def test_a_file_that_is_no_part_of_this_flight_is_left_out_and_named(copied, rows, what):
    path = copied.with_name("dive-part4.mcap")
    own = read_log(copied).metadata
    of_part = {**METADATA, "part": "4", "recording": own["recording"]}
    if what == "no log":
        path.write_text("a text that is no log")
    elif what == "a copy":  # everything is right but its records: they were there before
        write_small_log(path, rows[:300], metadata=of_part)
    else:
        changed = {"another recording": {"recording": "0123456789abcdef"}, "another number": {"part": "3"}}
        metadata = METADATA if what == "a log of its own" else {**of_part, **changed[what]}
        write_small_log(path, rows, metadata=metadata)
    log = read_flight(copied)
    assert [part.number for part in log.parts] == [1, 2, 3]
    assert log.topics["/tick"].count == 500 - BETWEEN
    (said,) = log.left_out
    assert "dive-part4.mcap" in said
    assert "\n" not in said
    assert said in CliRunner().invoke(log_command, ["info", str(copied)]).stdout


def test_a_part_cut_before_its_first_record_holds_nothing_and_harms_nothing(copied):
    last = copied.with_name("dive-part3.mcap")
    for size in (0, 5, 200):
        last.write_bytes(last.read_bytes()[:size])
        log = read_flight(copied)
        assert not log.complete
        assert log.topics["/tick"].count == 350 - BETWEEN


def test_every_damage_is_named_with_its_file(copied):
    second = copied.with_name("dive-part2.mcap")
    data = bytearray(second.read_bytes())
    data[len(data) // 2] ^= 0x10
    second.write_bytes(data)
    log = read_flight(copied)
    assert [item.what.partition(":")[0] for item in log.damages] == ["dive-part2.mcap"]
    done = CliRunner().invoke(log_command, ["repair", str(copied)])
    assert done.exit_code == 0, done.output
    assert "dive-part2.mcap: " in done.stderr
