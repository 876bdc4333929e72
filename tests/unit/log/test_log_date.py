"""A log has a date: its times are Unix time, and what reads it goes on in seconds from the flight's start."""

import json
import time
from datetime import UTC, datetime

import numpy as np

from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.telemetry import REPLAYED
from glider.hal.recorder import disk
from glider.hal.recorder.logfile import LogFile
from glider.hal.recorder.schema import INFO
from glider.tools.data.log.reader import read_log
from glider.tools.data.log.rundata import run_of
from glider.tools.flight import sortie
from glider.tools.flight.arming import BYTES_PER_SECOND
from glider.tools.flight.compose import build_flight, build_recorder
from tests.support.commands import glider
from tests.support.log_files import METADATA, TICK

EPOCH = 1_800_000_000 * 10**9
SHORT = """
format = 1
name = "dip"
time_limit_s = 60.0
[site]
name = "pool"
depth_m = 6.0
[[leg]]
duration_s = 2.0
pitch_deg = -15.0
ballast_kg = 0.05
"""


def flown(folder, **more):
    """A short simulated flight with its log; build_flight takes `more`."""
    (folder / "dip.toml").write_text(SHORT)
    flight = build_flight(mission=str(folder / "dip.toml"), **more)
    host = sortie.SimulatedHost(flight, name="dip", paced=False)
    sortie.fly(flight, host, lambda: build_recorder(flight, folder / "dip.mcap"))
    return flight, folder / "dip.mcap"


def test_a_flights_log_begins_at_the_time_of_day_of_its_arming(tmp_path):
    before = time.time_ns()
    _, path = flown(tmp_path)
    after = time.time_ns()
    log = read_log(path)
    tick = log.topics["/tick"]
    assert before <= tick.times_ns[0] <= after
    assert before <= log.epoch_ns <= after
    assert np.array_equal(tick.times_ns - log.epoch_ns, np.round(1e9 * tick.column("t_s")).astype(np.int64))
    assert run_of(log).run.t[0] == 0.0


def test_info_gives_the_date(tmp_path):
    _, path = flown(tmp_path)
    began = read_log(path).began
    assert abs(datetime.fromisoformat(began) - datetime.now(UTC)).total_seconds() < 3600.0
    assert began in glider("log", "info", path, cwd=tmp_path).stdout
    assert json.loads(glider("log", "info", path, "--json", cwd=tmp_path).stdout)["began"] == began


def test_a_log_without_a_date_has_none(small_log):
    assert read_log(small_log).began == ""
    assert json.loads(glider("log", "info", small_log, "--json", cwd=small_log.parent).stdout)["began"] is None


def test_events_stay_in_seconds_of_flight_even_where_the_metadata_are_lost(tmp_path):
    path = tmp_path / "x.mcap"
    fd = disk.create(str(path))
    file = disk.DiskFile(fd)
    log = LogFile(file, [TICK], attachments={"vehicle.toml": "x"}, metadata=METADATA, epoch_ns=EPOCH)
    log.event(1, 12.5, INFO, "here")
    log.finish({})
    assert file.sync()
    disk.close(fd, str(path), keep=True)
    assert read_log(path).events[0].time_s == 12.5
    data = bytearray(path.read_bytes())
    place = data.index(b"epoch_ns")
    data[place] ^= 1  # the metadata's check sum is wrong now
    path.write_bytes(data)
    found = read_log(path)
    assert "epoch_ns" not in found.metadata
    assert found.events[0].time_s == 12.5


def test_the_log_says_what_a_replay_needs(tmp_path):
    flight, path = flown(tmp_path)
    facts = read_log(path).metadata
    assert float(facts["loop_hz"]) == flight.board.loop_hz
    assert json.loads(facts["periods_s"]) == flight.board.periods
    assert float(facts["surface_pressure_pa"]) == flight.autopilot.C[ctl.SURFACE_PRESSURE]
    assert facts["restarted"] == "false"
    assert json.loads(facts["actuator_limits"])["ballast"] == list(flight.board.ballast.limits)


def test_the_surface_pressure_is_the_one_of_the_flight_not_of_the_board_file(tmp_path):
    """Arming may measure it: then C has it."""
    (tmp_path / "dip.toml").write_text(SHORT)
    flight = build_flight(mission=str(tmp_path / "dip.toml"))
    flight.board.open()
    flight.autopilot.C[ctl.SURFACE_PRESSURE] = 99000.25
    with build_recorder(flight, tmp_path / "b.mcap"):
        pass
    assert read_log(tmp_path / "b.mcap").metadata["surface_pressure_pa"] == "99000.25"


def test_run_data_have_the_columns_they_had(tmp_path):
    _, path = flown(tmp_path)
    log = read_log(path)
    columns = {*run_of(log).run.columns, *run_of(log).run.extra}
    assert not columns & set(REPLAYED)
    assert {"cmd_ballast_kg", "depth_m", "reaction", "fault", "lateness_s"} <= columns


def test_a_log_takes_no_more_of_the_disk_than_arming_counts_on(tmp_path):
    _, path = flown(tmp_path)
    assert path.stat().st_size - 20_000 < BYTES_PER_SECOND * read_log(path).duration_s
