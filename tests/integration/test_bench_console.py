"""The bench: typed at a terminal, from a pipe and a script, and what happens when it dies."""

import json
import os
import re
import signal
import subprocess
import sys
import time

import pytest

from glider.hal.boardfile import calibration_hash, decode_device_file
from glider.tools.bench.client import Bench
from glider.tools.data.boards import load_board_file
from tests.support import commands
from tests.support.bench_session import Twins, session

pytestmark = pytest.mark.realtime(seconds=180)


def glider(*arguments, lines=(), **options):
    command = [sys.executable, "-m", "glider.tools.cli.main", *(str(item) for item in arguments)]
    text = "".join(f"{line}\n" for line in lines)
    return subprocess.run(command, input=text, capture_output=True, text=True, timeout=120, **options)


@pytest.fixture(scope="module")
def twins(tmp_path_factory):
    twins = Twins(tmp_path_factory.mktemp("twins"))
    yield twins
    twins.end()


def bench(twins, *lines, out="."):
    """From a pipe."""
    return glider("bench", "--board", twins.board, "--out", out, lines=lines)


def typed(twins, folder, *lines):
    """The same in this process, what is left going into a folder."""
    return commands.glider("bench", "--board", twins.board, "--out", ".", cwd=folder, lines="\n".join(lines) + "\n")


def test_a_session_at_a_terminal(tmp_path):
    """Calibrate with a ruler, sweep, stop by a key and by Ctrl-C, pull the cable and put it in again."""
    _, found = session(tmp_path, sweep=False)
    assert "`enable`" in found["not enabled"]
    assert "  not enabled" in found["not confirmed"]
    file = decode_device_file(found["board"], "board.toml")
    assert file.calibration == calibration_hash(file)
    assert file.slider.counts_per_m == pytest.approx(2_000_000, rel=0.01)
    assert file.slider_wire.per_m == pytest.approx(80_000, rel=0.03)
    assert (tmp_path / "p" / "board.toml.1").read_text() != found["board"]
    assert found["slider_m"] == pytest.approx(0.008, abs=0.0003)  # by the truth, not by the wire
    assert found["key"].rstrip().endswith("stopped\nbench>")
    assert found["stop"].rstrip().endswith("stopped\nbench>")
    first, second = found["stopped_m"]
    assert first == pytest.approx(second, abs=0.0002)
    assert "stale" in found["unplugged"]
    assert "port sensors   NOT OPEN" in found["unplugged health"]
    assert "valid" in found["plugged"]
    assert found["exit"] == 0
    assert "'abc'" in found["calibrate"]
    assert "goto?" in found["mistyped"]
    assert re.search(r"slider: 500 mm .* -12\.00 to 12\.00 mm", found["outside"])
    assert re.search(r"slider: \d+ of 31 s, ", found["sweeping"])


def test_the_answer_to_what_ctrl_c_broke_off_is_not_taken_for_the_next(twins):
    found = load_board_file(str(twins.board))
    with Bench(found.text, found.source, found.kind, "roughie", twins.board) as one:
        process = one._process
        process.stdin.write(json.dumps({"do": "stop", "number": 0}).encode() + b"\n")
        process.stdin.flush()  # Ctrl-C fell here: nobody reads the answer
        assert "beacon" in one.snapshot()["sensors"]
        assert "beacon" in one.snapshot()["sensors"]


def test_a_pipe_runs_commands_and_says_what_it_does(twins):
    done = bench(
        twins, "# a comment", "read beacon", "enable", "goto slider 5", "jog slider -10", "limits", "watch 0.1"
    )
    assert done.returncode == 0, done.stderr
    assert "> goto slider 5" in done.stdout
    assert "servo    -60.00 to 60.00 deg" in done.stdout
    assert twins.state()["slider_m"] == pytest.approx(-0.005, abs=0.0005)


@pytest.mark.parametrize(
    ("lines", "code", "said"),
    [
        (["goto slider 5"], 1, "goto slider 5: "),
        (["dance"], 2, "'dance'; `help`"),
        (["swepp slider"], 2, "sweep?"),
        (["enable", "goto slidr 5"], 1, "slider?"),
        (["read becon"], 2, "beacon?"),
        (["enable", "calibrate ballast", "1.5x"], 2, "'1.5x'"),
        (["goto slider"], 2, "usage: goto ACTUATOR POSITION"),
        (["raw sensors 01 03 01 00 00 04", "no"], 1, "not sent"),
        (["raw sensors 01 63 01", "yes"], 1, "Modbus request"),
        (["zero slider_wire"], 1, "answer: write"),
        (["enable", "sweep slider 5 900"], 1, "expected LOW < HIGH within -60.00 to 60.00 mm"),
        (["limits slider 10 -10"], 1, "board file"),
    ],
)
def test_a_script_ends_at_the_first_command_that_fails(twins, tmp_path, lines, code, said):
    before = twins.board.read_text()
    script = tmp_path / "script"
    script.write_text("\n".join([*lines, "read"]) if code == 2 or len(lines) == 1 else "\n".join(lines))
    if "zero" in lines[0]:
        script.write_text(lines[0])
    done = commands.glider("bench", "--board", twins.board, "--script", script, cwd=tmp_path)
    assert done.returncode == code, done.stdout + done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert twins.board.read_text() == before


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("goto slider 500", "-60.00 to 60.00 mm"),
        ("goto servo -200", "servo: -200 deg is outside -60.00 to 60.00 deg"),
        ("jog slider 70", "slider: 70 mm is outside"),
    ],
)
def test_a_place_outside_the_limits_is_refused_and_nothing_moves(twins, tmp_path, line, said):
    done = typed(twins, tmp_path, "enable", "goto slider 0", "goto servo 0", line, "goto slider 20")
    assert done.returncode == 1
    assert said in done.stderr
    state = twins.state()
    assert state["slider_m"] == pytest.approx(0.0, abs=0.0005)
    assert state["servo_rad"] == pytest.approx(0.0, abs=0.001)


def test_the_limits_as_they_are_shown_are_within_them(twins, tmp_path):
    done = typed(twins, tmp_path, "limits ballast")
    low = done.stdout.split("ballast")[-1].split()[0]
    done = typed(twins, tmp_path, "enable", f"goto ballast {low}", "goto servo 60", "wait 1.5")
    assert done.returncode == 0, done.stderr
    assert twins.state()["servo_rad"] == pytest.approx(1.0472, abs=0.001)
    assert twins.state()["ballast_kg"] == pytest.approx(float(low) * 1e-3 * 998.2 * 0.0062, abs=0.004)


def test_help_breaks_between_words(twins, tmp_path, monkeypatch):
    from glider.tools.bench.commands import Commands

    for columns in (60, 100):
        monkeypatch.setenv("COLUMNS", str(columns))
        done = typed(twins, tmp_path, "?", "help calibrate", "exit", "never reached")
        assert done.returncode == 0, done.stderr
        assert max(map(len, done.stdout.splitlines())) < columns
        assert "quit: " in done.stdout
        words = {word for name in Commands.names() for word in getattr(Commands, f"do_{name}").__doc__.split()}
        assert set(done.stdout.split()) <= words | {">", "?", "help", "calibrate", "exit"}


def test_raw_bytes_and_their_answers(twins, tmp_path):
    done = typed(twins, tmp_path, "raw imu VNRRG,01", "yes", "raw sensors 01 04 00 00 00 08", "yes")
    assert "$VNRRG,01,VN-100T-CR" in done.stdout
    assert done.returncode == 1  # the transmitter has no input registers
    assert "exception 2" in done.stderr


def test_a_sweep_leaves_run_data_and_a_picture(twins, tmp_path):
    from glider.tools.data.runs.case import load_case

    done = typed(twins, tmp_path, "enable", "goto slider 0", "sweep slider -2 2")
    assert done.returncode == 0, done.stdout + done.stderr
    shown = re.findall(r"^sweeping slider: (\d+) of \d+ s, (.*)$", done.stdout, re.MULTILINE)
    assert [int(seconds) for seconds, _ in shown[:2]] == [0, 10]
    assert shown[0][1] == "on its way"
    assert "travel time" in done.stdout
    (run,) = load_case(tmp_path / "sweep-slider-001").runs
    assert run.columns["cmd_slider_m"].max() == pytest.approx(0.002)
    assert (tmp_path / "sweep-slider-001" / "sweep-slider.png").stat().st_size > 10_000


def start(twins):
    """A console on a pipe that is left open, with the slider on its way from end to end."""
    command = [sys.executable, "-m", "glider.tools.cli.main", "bench", "--board", str(twins.board)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    process.stdin.write("enable\ngoto slider -55\ngoto slider 55\n")
    process.stdin.flush()
    end = time.monotonic() + 60.0
    while twins.state()["slider_m"] > -0.045:
        assert time.monotonic() < end
        time.sleep(0.05)
    while twins.state()["slider_m"] < -0.03:
        assert time.monotonic() < end
        time.sleep(0.05)
    return process


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_losing_the_console_stops_the_actuators(twins, how):
    process = start(twins)
    os.kill(process.pid, how)
    try:
        time.sleep(0.8 if how != signal.SIGSTOP else 3.6)  # one that is stopped is missed after three seconds
        place = twins.state()["slider_m"]
        time.sleep(0.4)
        assert twins.state()["slider_m"] == pytest.approx(place, abs=2e-4)
        assert place < 0.053
    finally:
        process.kill()
        process.stdin.close()
        process.wait()
        time.sleep(0.3)


def test_the_bench_refuses_what_has_no_devices(tmp_path):
    done = commands.glider("bench", "--board", "sim", cwd=tmp_path)
    assert done.returncode == 2
    assert "no devices" in done.stderr


def test_check_talks_to_every_device(twins, tmp_path):
    twins.tell("fault beacon silent")
    done = commands.glider("check", "--board", twins.board, cwd=tmp_path)
    twins.tell("fault beacon none")
    assert done.returncode == 1
    assert "model VN-100T-CR" in done.stdout
    assert "FAIL  beacon" in done.stdout


def lead(twins, board, actuators):
    """`glider check --signs` with a person who turns the stand when asked to; its findings."""
    command = [sys.executable, "-m", "glider.tools.cli.main", "check", "--board", str(board), "--signs", "--json"]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    process = subprocess.Popen(command, text=True, **pipes)
    poses = {"level": "0 0 40 0.3", "nose by": "0 15 40 0.3", "side down": "15 0 40 0.3", "nose to": "0 0 55 0.3"}
    poses["Lower"] = "0 0 40 0.4"
    for line in process.stderr:
        for asked, pose in poses.items():
            if asked in line:
                assert twins.tell(f"pose {pose}") == "ok"
                time.sleep(0.15)
        if line.strip():
            process.stdin.write("yes\n" if actuators or "clear?" not in line else "no\n")
            process.stdin.flush()
        if "swing" in line or ("clear?" in line and not actuators):
            break
    output, _ = process.communicate(timeout=90)
    twins.tell("pose 0 0 0 0.3")
    return {item["check"]: item for item in json.loads(output)["findings"]}


SIGNS = ("nose up", "roll to starboard", "turn to starboard", "deeper", "mass forward", "pump in", "servo to starboard")


def test_check_leads_through_signs_and_axes(twins, tmp_path):
    """Whatever the actuators stood at before: here the mass is further forward than the check will send it."""
    assert typed(twins, tmp_path, "enable", "goto slider 50").returncode == 0
    found = lead(twins, twins.board, actuators=True)
    assert {name: found[name]["pass"] for name in SIGNS} == dict.fromkeys(SIGNS, True), found
    assert re.match(r"pitch \+1[3-7]\.\d deg: ", found["nose up"]["message"])


def test_check_finds_an_imu_that_looks_aft(twins, tmp_path):
    wrong = tmp_path / "board.toml"
    wrong.write_text(twins.board.read_text().replace("mount_deg = [0.0, 0.0, 0.0]", "mount_deg = [0.0, 0.0, 180.0]"))
    found = lead(twins, wrong, actuators=False)
    assert not found["nose up"]["pass"]
    assert not found["roll to starboard"]["pass"]
    assert found["turn to starboard"]["pass"]
    assert "imu.mount_deg" in found["nose up"]["message"]
    assert not found["calibration"]["pass"]
