"""`glider status`, `acknowledge`, `compile`: what a person sees and does beside a flight."""

import json
import subprocess
import sys
import time

import pytest
from click.testing import CliRunner

from glider.hal import heartbeat as hb
from glider.hal.heartbeat import Guard, Heartbeat
from glider.hal.outofband.rise import AscentStage
from glider.hal.recorder.condition import RecorderLevel
from glider.hal.sortie import SortieState
from glider.hal.state_file import StateFile
from glider.tools.cli.acknowledge import acknowledge
from glider.tools.cli.check import check
from glider.tools.cli.compile_ import compile_
from glider.tools.cli.status import status
from glider.tools.flight.status import find_folder, lines, snapshot


@pytest.fixture
def pulse(tmp_path):
    """A heartbeat as a flight leaves it once a second."""
    found = Heartbeat.create(tmp_path, 0.02, "sawtooth-001")
    found.words[hb.W_MODE], found.words[hb.W_LEG], found.words[hb.W_LEGS] = 1, 1, 4
    found.words[hb.W_RECORDER_NS] = time.monotonic_ns()
    found.words[hb.W_GUARD_STATUS], found.words[hb.W_GUARD_NS] = Guard.WATCHING, time.monotonic_ns()
    found.values[hb.V_DEPTH_M], found.values[hb.V_PITCH_RAD] = 2.5, -0.35
    found.beat(12.0)
    found.publish(SortieState.DIVING)
    yield found
    found.close()


def test_a_good_flight_is_all_well(pulse, tmp_path):
    found = snapshot(tmp_path)
    assert found["problems"] == []
    assert (found["flight"], found["mode"], found["leg"], found["depth_m"]) == ("sawtooth-001", "flying", 2, 2.5)
    page = dict(lines(found))
    assert page["flight"].startswith("sawtooth-001: diving, flying, ")
    assert "depth 2.50 m, pitch -20.1 deg" in page["vehicle"]
    done = CliRunner().invoke(status, ["--state", str(tmp_path)])
    assert done.exit_code == 0
    assert "all well" in done.output


@pytest.mark.parametrize(
    ("word", "value", "said"),
    [
        (hb.W_BEAT_NS, 1, "no heartbeat for"),
        (hb.W_MISSED, 3, "3 ticks missed"),
        (hb.W_RECORDER_LEVEL, RecorderLevel.FAILED, "recorder: failed"),
        (hb.W_RECORDER_LEVEL, 77, "recorder: ?"),
        (hb.W_DROPPED, 5, "5 records dropped"),
        (hb.W_GUARD_NS, 1, "no out-of-band process watches"),
        (hb.W_GUARD_STATUS, Guard.ASCENDING, "bringing the vehicle up"),
        (hb.W_STATE, SortieState.ASHORE, "no flight is under way"),
    ],
)
def test_what_is_wrong_is_said_and_is_exit_1(pulse, tmp_path, word, value, said):
    pulse.words[word] = value
    assert any(said in problem for problem in snapshot(tmp_path)["problems"])
    done = CliRunner().invoke(status, ["--json", "--state", str(tmp_path)])
    assert done.exit_code == 1
    assert said in " ".join(json.loads(done.stdout)["problems"])


def test_a_dead_flight_is_seen(pulse, tmp_path):
    pulse.close()
    second = Heartbeat.open(tmp_path)
    assert any("process" in one for one in snapshot(tmp_path)["problems"])
    pulse.__init__(second._fd, second.path)  # for the fixture to close


def test_without_a_heartbeat_it_says_where_it_looked(tmp_path, monkeypatch):
    monkeypatch.setenv("GLIDER_RUN_DIR", str(tmp_path / "run"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    from glider.tools.data.errors import InputError

    with pytest.raises(InputError, match="run: no flight"):
        find_folder(None)
    (tmp_path / "glider-run-x").mkdir()
    Heartbeat.create(tmp_path / "glider-run-x", 0.02).close()
    assert find_folder(None) == tmp_path / "glider-run-x"


def test_acknowledging_sets_the_state_back(tmp_path):
    StateFile(tmp_path).write(SortieState.HELD, flight="dive-007", reason="no depth")
    done = CliRunner().invoke(acknowledge, ["--state", str(tmp_path)])
    assert done.exit_code == 0
    assert "; no depth" in done.stderr
    assert StateFile(tmp_path).read().state == SortieState.ASHORE


def test_a_flight_under_way_is_not_acknowledged(pulse, tmp_path):
    StateFile(tmp_path).write(SortieState.DIVING, flight="dive-007")
    done = CliRunner().invoke(acknowledge, ["--state", str(tmp_path)])
    assert (done.exit_code, done.stderr.count("\n")) == (1, 1)
    assert StateFile(tmp_path).read().state == SortieState.DIVING


@pytest.mark.parametrize("stage", [AscentStage.BLIND, AscentStage.RISING, AscentStage.AGAIN, AscentStage.HARDWARE])
def test_an_ascent_under_way_is_not_acknowledged(pulse, tmp_path, stage):
    """At any depth: only a vehicle that the out-of-band process sees at the surface is another's to look at."""
    pulse.words[hb.W_GUARD_STATUS], pulse.words[hb.W_GUARD_STAGE] = Guard.ASCENDING, stage
    StateFile(tmp_path).write(SortieState.ABORTED, flight="dive-007")
    pulse.close()
    Heartbeat.open(tmp_path).words[hb.W_GUARD_NS] = time.monotonic_ns()
    done = CliRunner().invoke(acknowledge, ["--state", str(tmp_path)])
    assert done.exit_code == 1
    assert "out-of-band process" in done.stderr
    assert StateFile(tmp_path).read().state == SortieState.ABORTED
    Heartbeat.open(tmp_path).words[hb.W_GUARD_STAGE] = AscentStage.SURFACED
    assert CliRunner().invoke(acknowledge, ["--state", str(tmp_path)]).exit_code == 0
    pulse.__init__(Heartbeat.open(tmp_path)._fd, pulse.path)  # for the fixture to close


def test_compiled_ahead_means_compiled():
    """Another process finds every kernel of a flight in the cache."""
    done = json.loads(CliRunner().invoke(compile_, ["--json"]).stdout)
    assert done["kernels"] > 0
    script = (
        "from glider.tools.flight.precompile import FLIGHT; n = []; print(FLIGHT.compile(n.append)['kernels'], len(n))"
    )
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    assert int(found[0]) > 0
    assert int(found[1]) == 0


def test_old_spellings_say_the_new_one_and_do_it(pulse, tmp_path):
    done = CliRunner().invoke(check, ["--live", "--json", "--state", str(tmp_path)])
    assert done.exit_code == 0
    assert json.loads(done.stdout)["flight"] == "sawtooth-001"
    assert "`glider check --live` is now `glider status`" in done.stderr
    done = CliRunner().invoke(check, ["--acknowledge", "--state", str(tmp_path)])
    assert done.exit_code == 1
    assert "is now `glider acknowledge`" in done.stderr
    assert "not acknowledged: " in done.stderr
    assert "--live" not in CliRunner().invoke(check, ["--help"]).output
