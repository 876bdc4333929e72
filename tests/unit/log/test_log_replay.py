"""`glider log replay`: recorded inputs flown again, to the bit; what a log tells of an abort, and of changed code."""

import json
import os
import re

import numpy as np
import pytest

from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.telemetry import TICK
from glider.hal.recorder.schema import RecordSpec
from glider.tools.data.log.parts import read_flight
from glider.tools.data.log.reader import read_log
from glider.tools.data.sources import name_or_path
from glider.tools.flight.replay import STATES, TAKEN, replay_log
from tests.support.commands import glider
from tests.support.logs import fly_dip, write_changed

WET_AT = 3.0


def spring_a_leak(flight, t):
    if t >= WET_AT:
        flight.board.leak._port.value = 1.0


@pytest.fixture(scope="module")
def dip(tmp_path_factory):
    return fly_dip(tmp_path_factory.mktemp("dip"))


@pytest.fixture(scope="module")
def wet(tmp_path_factory):
    return fly_dip(tmp_path_factory.mktemp("wet"), spring_a_leak)


def replayed(path, *more):
    """Exit code and JSON of `glider log replay`."""
    done = glider("log", "replay", path, "--json", *more, cwd=path.parent)
    assert "Traceback" not in done.stderr
    return done.returncode, json.loads(done.stdout)


def test_a_flight_is_the_same_to_the_bit(dip):
    code, found = replayed(dip)
    assert code == 0
    assert found["same"]
    assert found["replayed"] == found["ticks"] == read_log(dip).topics["/tick"].count > 500
    assert (found["abort"], found["differing_ticks"], found["largest"]) == (None, 0, {})


def test_an_operators_stop_is_replayed(tmp_path):
    def stop(flight, t):
        if t >= 2.0:
            flight.autopilot.give_up()

    code, found = replayed(fly_dip(tmp_path, stop))
    assert code == 0
    assert found["abort"]["reason"] == "asked to by the operator"
    assert found["abort"]["t_s"] == pytest.approx(2.0, abs=0.05)


def test_what_the_runtime_told_the_supervisor_is_replayed(tmp_path):
    """Memory past its limit (row 33) and a recorder that fails (27): written by the runtime, no sensor's."""

    def tell(flight, t):
        if t >= 2.0:
            flight.supervisor.G[sup.GROWTH] = 2.0

    path = fly_dip(tmp_path, tell)
    assert 33.0 in read_log(path).topics["/tick"].column("fault")
    assert replayed(path)[0] == 0


def test_an_ascent_after_a_flight_that_broke_off_is_replayed(tmp_path):
    """As flight/sortie begins one: given up before the first tick, and the supervisor told of the restart."""

    def restart(flight):
        flight.autopilot.give_up()
        flight.supervisor.G[sup.RESTARTED] = 1.0

    path = fly_dip(tmp_path, before=restart)
    assert read_log(path).metadata["restarted"] == "true"
    assert replayed(path)[0] == 0
    other = write_changed(path, tmp_path / "other.mcap", metadata={"restarted": "false"})
    assert replayed(other)[0] == 1


def test_a_surface_pressure_measured_at_arming_is_the_replays(tmp_path):
    def measure(flight):
        flight.autopilot.C[ctl.SURFACE_PRESSURE] -= 731.5

    path = fly_dip(tmp_path, before=measure)
    assert replayed(path)[0] == 0
    other = write_changed(path, tmp_path / "other.mcap", metadata={"surface_pressure_pa": "101325.0"})
    code, found = replayed(other)
    assert code == 1
    assert "depth_m" in found["first"]["fields"]


def test_an_actuator_that_takes_less_than_it_was_asked_is_replayed(tmp_path):
    def weaken(flight, t):
        flight.board.ballast._port._high = 0.03  # of the 0.08 kg asked for

    path = fly_dip(tmp_path, weaken)
    tick = read_log(path).topics["/tick"]
    assert (tick.column("asked_ballast_kg") > tick.column("cmd_ballast_kg")).any()
    assert replayed(path)[0] == 0


def test_a_leak_is_one_page_abort_and_inputs(wet):
    done = glider("log", "replay", wet, cwd=wet.parent)
    lines = done.stdout.splitlines()
    assert done.returncode == 0
    assert len(lines) <= 50
    assert max(map(len, lines)) <= 140
    (recorded,) = [line for line in lines if line.startswith("recorded: ")]
    assert re.match(r"recorded: .* 3\.", recorded)
    assert recorded.endswith(" reaction ABORT")
    (leak,) = [line.split() for line in lines if line.split()[:2] == ["leak", "wet"]]
    assert leak[2] == "0"
    assert leak[-1] == "1"
    for name in ("battery voltage V", "beacon pressure Pa", "imu pitch rad", "slider condition", "est_depth_m"):
        assert any(line.strip().startswith(name) for line in lines), name


def test_the_inputs_around_an_abort_as_json(wet):
    _, found = replayed(wet)
    abort, inputs = found["abort"], found["inputs"]
    assert (abort["row"], abort["reaction"]) == (20, "ABORT")
    at = inputs["tick"].index(abort["tick"])
    assert inputs["reaction"][at] == 4.0
    assert inputs["reaction"][at - 1] < 4.0
    assert inputs["leak wet 1"][at] == 1.0
    assert inputs["leak wet 1"][0] == 0.0
    assert inputs["battery voltage V"][at] == 14.0


def test_a_sample_that_screening_rejected_is_marked(tmp_path):
    def break_beacon(flight, t):
        if t >= 2.0:
            flight.board.beacon.begin("jump", (1e9, 0.0))

    path = fly_dip(tmp_path, break_beacon)
    code, found = replayed(path)
    assert code == 0
    at = found["inputs"]["tick"].index(found["abort"]["tick"])
    assert found["inputs"]["beacon validity"][at] == "rejected"
    assert found["inputs"]["beacon pressure Pa"][at] > 1e8


def test_one_changed_input_is_told_as_a_difference(dip, tmp_path):
    at = 150  # ticks

    def change(data):
        place = TICK.index("raw_imu_pitch")
        data[at:, place] = np.where(data[at:, place] == data[at, place], data[at, place] + 1e-9, data[at:, place])

    code, found = replayed(write_changed(dip, tmp_path / "changed.mcap", change))
    assert code == 1
    assert found["first"]["tick"] == at + 1
    assert found["first"]["t_s"] == pytest.approx(at / 50.0)
    assert "est_pitch_rad" in found["first"]["fields"]
    text = glider("log", "replay", tmp_path / "changed.mcap", cwd=tmp_path).stdout
    assert f" tick {at + 1}, {at / 50:.2f} s" in text


def test_a_changed_outcome_is_told_with_both_numbers(dip, tmp_path):
    def change(data):
        data[99, TICK.index("asked_ballast_kg")] += 1e-3
        data[99, TICK.index("cmd_ballast_kg")] += 1e-3

    code, found = replayed(write_changed(dip, tmp_path / "changed.mcap", change))
    assert (code, found["differing_ticks"], found["first"]["tick"]) == (1, 1, 100)
    assert set(found["first"]["fields"]) == {"asked_ballast_kg", "cmd_ballast_kg"}
    assert found["largest"]["asked_ballast_kg"] == pytest.approx(1e-3)
    assert found["first_decision"] is None


def test_a_changed_setting_decides_otherwise(wet, tmp_path):
    """A supervisor that waits for more wet samples gives the dive up later, and the page says so."""
    text, _ = name_or_path("roughie", "vehicle", "model/vehicles")
    patient = f"{text}\n[supervisor]\nleak_samples = 8\n"
    path = write_changed(wet, tmp_path / "patient.mcap", attachments={"vehicle.toml": patient})
    code, found = replayed(path)
    assert code == 1
    assert found["abort_now"]["t_s"] > found["abort"]["t_s"] + 0.1
    assert found["first_decision"]["tick"] == found["abort"]["tick"]
    assert found["first_decision"]["fields"]["reaction"] == {"recorded": 4.0, "now": 2.0}
    page = glider("log", "replay", path, cwd=tmp_path).stdout
    assert f" tick {found['abort']['tick']}" in page
    assert "now: " in page
    assert len(page.splitlines()) <= 50


def test_changed_code_decides_otherwise(wet, monkeypatch):
    """A supervisor without its leak detector lets the flight go on."""
    from glider.firmware.supervisor import Supervisor

    honest = Supervisor.__init__

    def without_leak(self, *given, **more):
        honest(self, *given, **more)
        self.disable(sup.FAULT_LEAK)

    monkeypatch.setattr(Supervisor, "__init__", without_leak)
    found = replay_log(read_flight(wet))
    assert found.abort.row == 20
    assert found.abort_now.row != 20
    assert found.abort_now.tick > found.abort.tick
    recorded, now = found.first_state.fields["fault"]
    assert recorded == 20.0 != now  # on a busy machine now may be the disk's row


@pytest.mark.parametrize("share", [0.3, 0.8, 0.97])
def test_a_cut_log_is_replayed_as_far_as_it_goes(wet, tmp_path, share):
    path = tmp_path / "cut.mcap"
    path.write_bytes(wet.read_bytes()[: int(share * wet.stat().st_size)])
    code, found = replayed(path)
    assert code == 0
    assert not found["complete"]
    assert found["replayed"] == found["ticks"] == read_log(path).topics["/tick"].count > 50
    assert " cut" in glider("log", "replay", path, cwd=tmp_path).stdout


def test_a_replay_ends_where_ticks_are_missing_and_the_abort_behind_is_shown(wet, tmp_path):
    path = tmp_path / "gap.mcap"
    data = bytearray(wet.read_bytes())
    tick = read_log(wet).topics["/tick"]
    place = data.index(tick.data[60].tobytes())
    data[place] ^= 1  # costs the chunk
    path.write_bytes(data)
    code, found = replayed(path)
    assert code == 0
    assert 0 < found["replayed"] <= 60
    assert f"ticks {found['replayed'] + 1} to" in found["ends"]
    assert found["abort"]["row"] == 20
    assert found["inputs"]["leak wet 1"][-1] == 1.0


def refused(path):
    """The one line that a log which cannot be replayed gets."""
    done = glider("log", "replay", path, cwd=path.parent)
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = [line for line in done.stderr.splitlines() if not line.startswith("replaying")]
    assert line.startswith(f"glider: {path}")
    return line


def test_a_log_without_inputs_is_one_line(small_log):
    assert "(asked_ballast_kg " in refused(small_log)


def test_what_is_no_log_is_one_line(tmp_path):
    (tmp_path / "x.mcap").write_text("no log")
    assert "MCAP file" in refused(tmp_path / "x.mcap")
    assert "no such" in refused(tmp_path / "y.mcap")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"attachments": {"mission.toml": None}}, "holds no mission.toml"),
        ({"attachments": {"vehicle.toml": "mass = 3"}}, "vehicle.toml"),
        ({"metadata": {"loop_hz": None}}, "no loop_hz"),
        ({"metadata": {"loop_hz": "0"}}, "loop_hz as '0'"),
        ({"metadata": {"periods_s": '{"imu": 0.02}'}}, "periods_s as"),
        ({"metadata": {"actuator_limits": "{}"}}, "actuator_limits"),
    ],
)
def test_a_log_that_lacks_what_flew_is_one_line(dip, tmp_path, change, says):
    assert says in refused(write_changed(dip, tmp_path / "x.mcap", **change))


def test_states_that_no_flight_has_are_one_line(dip, tmp_path):
    def change(data):
        data[7, TICK.index("reason")] = np.nan

    assert "tick 8: reason " in refused(write_changed(dip, tmp_path / "x.mcap", change))


@pytest.mark.parametrize("time", [np.nan, np.inf, 1e300, 0.0])
def test_times_that_do_not_go_on_are_one_line(dip, tmp_path, time):
    def change(data):
        data[7, TICK.index("t_s")] = time

    assert "tick 8: t_s is" in refused(write_changed(dip, tmp_path / "x.mcap", change))


def test_a_command_that_no_actuator_takes_is_one_line(dip, tmp_path):
    def change(data):
        data[7, TICK.index("cmd_servo_rad")] = np.inf

    assert "tick 8: cmd_servo_rad " in refused(write_changed(dip, tmp_path / "x.mcap", change))


def test_inputs_that_are_no_numbers_end_in_an_answer(dip, tmp_path):
    """Whatever a record holds is flown: it differs, or is one line."""
    rng = np.random.default_rng(0)

    def change(data):
        states = [TICK.index(name) for name in ("t_s", *TAKEN, *STATES)]
        kept = data[:, states].copy()
        data[50:] = rng.choice([np.nan, np.inf, -np.inf, 1e300, -1e300, 0.0], size=data[50:].shape)
        data[:, states] = kept

    code, found = replayed(write_changed(dip, tmp_path / "x.mcap", change))
    assert code == 1
    assert found["first"]["tick"] == 51


def test_a_log_whose_first_ticks_are_missing_is_one_line(dip, tmp_path):
    path = tmp_path / "x.mcap"
    data = bytearray(dip.read_bytes())
    data[data.index(read_log(dip).topics["/tick"].data[3].tobytes())] ^= 1
    path.write_bytes(data)
    assert "missing" in refused(path)


def test_fields_that_another_version_had_do_not_hinder(dip, tmp_path):
    """An outcome that the log does not have is not compared."""
    fewer = RecordSpec("/tick", "glider/msg/Tick", tuple(f for f in TICK.fields if f.name != "sd_u_m_s"))
    keep = [i for i, f in enumerate(TICK.fields) if f.name != "sd_u_m_s"]
    path = write_changed(dip, tmp_path / "x.mcap", lambda data: data[:, keep], spec=fewer)
    assert replayed(path)[0] == 0


def test_no_byte_flipped_ends_in_a_traceback(dip, tmp_path):
    """A log is a stranger's file: a flipped bit anywhere is a replay that ends earlier, or one line."""
    data, rng, path = dip.read_bytes(), np.random.default_rng(3), tmp_path / "x.mcap"
    for _ in range(12):
        damaged = bytearray(data)
        damaged[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        done = glider("log", "replay", path, cwd=tmp_path)
        assert done.returncode in (0, 1, 2), done.stderr
        os.unlink(path)
