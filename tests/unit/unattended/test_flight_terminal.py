"""A flight's terminal, a real one: what is typed, what is not read, and what happens when it goes away."""

import io
import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pexpect
import pytest

from glider.hal.sortie import SortieState
from glider.hal.state_file import StateFile
from glider.tools.flight.terminal import AGAIN_S, Stop, confirm_arming
from tests.support.twinned import end_guard, until

pytestmark = pytest.mark.realtime(seconds=60)

# --- Ctrl-C ---------------------------------------------------------------------------------------------------------


class Clock:
    """A clock that a test turns."""

    def __init__(self):
        self.t = 100.0

    def __call__(self):
        return self.t


def pressed(depth, seconds):
    """Ctrl-C at these times; how often the dive was given up, and the number of presses before it stopped at once."""
    clock, given_up = Clock(), []
    stop = Stop(lambda: given_up.append(clock.t), 0.4, depth, clock)
    for number, at in enumerate(seconds, start=1):
        clock.t = 100.0 + at
        try:
            stop(signal.SIGINT, None)
        except KeyboardInterrupt:
            return len(given_up), number
    return len(given_up), None


@pytest.mark.parametrize("depth", [None, lambda: 0.0, lambda: 0.39, lambda: -0.1])
def test_the_first_gives_up_and_the_second_stops_at_once_where_people_are(depth):
    assert pressed(depth, [0.0, 0.001]) == (1, 2)
    assert pressed(depth, [0.0]) == (1, None)


@pytest.mark.parametrize("metres", [3.0, 0.41, math.nan])  # a depth that is not known may be any
def test_under_water_only_one_that_is_meant_leaves_the_vehicle(metres):
    def deep():
        return metres

    assert pressed(deep, [0.0, 1.0]) == (1, None)
    assert pressed(deep, [0.0, 1.0, 2.0]) == (1, 3)
    assert pressed(deep, [0.01 * n for n in range(500)]) == (1, None)  # a burst of noise
    assert pressed(deep, [(AGAIN_S[1] + 1.0) * n for n in range(50)]) == (1, None)  # one now and then


@pytest.mark.parametrize(
    ("depth", "said"),
    [
        (None, ["surfacing; Ctrl-C again stops at once"]),
        (lambda: 0.1, ["surfacing; Ctrl-C again stops at once"]),
        (
            lambda: 3.0,
            [
                "surfacing; Ctrl-C twice more, a second apart, leaves it under water",
                "surfacing; Ctrl-C once more, in a second, leaves the vehicle where it is",
            ],
        ),
    ],
)
def test_each_press_says_what_the_next_does(depth, said):
    told, clock = [], Clock()
    stop = Stop(lambda: None, 0.4, depth, clock, tell=told.append)
    for _ in said:
        stop(signal.SIGINT, None)
        clock.t += 1.0
    with pytest.raises(KeyboardInterrupt):
        stop(signal.SIGINT, None)
    assert told == said


# --- arming -----------------------------------------------------------------------------------------------------------
QUESTION = "hands and cables clear"


@pytest.fixture
def fly(tmp_path):
    """`glider fly` of a board whose ports are not there, in a terminal."""
    started = []

    def start(*extra):
        command = [
            "-m",
            "glider.tools.cli.main",
            "fly",
            "--board",
            "roughie",
            "--no-log",
            "--state",
            str(tmp_path),
            *extra,
        ]
        child = pexpect.spawn(sys.executable, command, timeout=120, encoding="utf-8")
        started.append(child)
        return child

    yield start
    for child in started:
        child.close(force=True)
    end_guard(tmp_path)


def asleep(pid):
    """Whether a process waits for something, as one that has asked does."""
    return "State:\tS" in Path(f"/proc/{pid}/status").read_text()


def ended(child):
    """What it still said, and its exit code. The out-of-band process that it leaves behind may keep the terminal."""
    until(lambda: not child.isalive(), 120.0)
    child.expect([pexpect.EOF, pexpect.TIMEOUT], timeout=0.5)
    return child.before, child.exitstatus


@pytest.mark.parametrize("answer", ["", "y", "no", "yes yes", "\x00\x1b[A", "yes"])
def test_only_a_whole_yes_confirms(monkeypatch, capsys, answer):
    """What is typed at a terminal that asks; of the rest, flights below."""
    typed = io.StringIO(f"{answer}\n")
    typed.isatty = lambda: True
    monkeypatch.setattr("sys.stdin", typed)
    assert confirm_arming("board, mission") == (answer == "yes")
    assert QUESTION in capsys.readouterr().err


@pytest.mark.parametrize("answer", ["yes yes", "\x04"])
def test_nothing_arms_without_a_yes(fly, tmp_path, answer):
    child = fly()
    child.expect(QUESTION)
    child.sendline(answer)
    said, code = ended(child)
    assert code == 1
    assert "not armed: " in said
    assert StateFile(tmp_path).read().state == SortieState.ASHORE


def test_without_a_terminal_nothing_arms_unless_the_command_line_says_yes(tmp_path):
    command = [sys.executable, "-m", "glider.tools.cli.main", "fly", "--board", "roughie", "--no-log"]
    command += ["--state", str(tmp_path)]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 1
    assert "--yes)" in done.stderr
    assert StateFile(tmp_path).read().state == SortieState.ASHORE


def test_a_confirmed_start_goes_on_to_the_checks(fly):
    child = fly()
    child.expect(QUESTION)
    child.sendline("yes")
    said, code = ended(child)
    assert (code, "not confirmed" in said) == (1, False)
    assert "not armed: " in said  # its ports are not there


def test_ctrl_c_at_the_question_arms_nothing(fly, tmp_path):
    child = fly()
    child.expect(QUESTION)
    until(lambda: asleep(child.pid), 60.0)  # Python loses what comes between the question and the wait for the answer
    child.sendintr()
    assert ended(child)[1] == 130
    assert StateFile(tmp_path).read().state == SortieState.ASHORE


def test_who_says_yes_beforehand_is_not_asked(fly):
    said, code = ended(fly("--yes"))
    assert (code, QUESTION in said) == (1, False)


def test_an_ascent_is_never_asked_for(fly, tmp_path):
    StateFile(tmp_path).write(SortieState.DIVING)
    child = fly()
    assert child.expect([QUESTION, "ascending only"]) == 1
    assert QUESTION not in ended(child)[0]


# --- in flight --------------------------------------------------------------------------------------------------------
LOOP = """
import contextlib, json, os, select, sys, time
from glider.tools.flight.terminal import terminal_detached
with terminal_detached() if sys.argv[2] == "undisturbed" else contextlib.nullcontext():
    print("flying", flush=True)
    longest, before, end = 0.0, time.monotonic(), time.monotonic() + 1.0
    while time.monotonic() < end:
        with contextlib.suppress(OSError):
            print("x" * 500, file=sys.stderr, flush=True)
        time.sleep(0.01)
        longest, before = max(longest, time.monotonic() - before), time.monotonic()
left = bool(select.select([0], [], [], 0.0)[0]) if os.isatty(0) else None
with open(sys.argv[1], "w") as file:
    json.dump({"longest": longest, "left": left}, file)
"""


def disturbed(tmp_path, how, disturb):
    """A loop in a terminal that nobody reads from its start on; what it says of itself, None where it did not end."""
    result = tmp_path / "result"
    child = pexpect.spawn(sys.executable, ["-c", LOOP, str(result), how], timeout=60)
    child.expect_exact("flying")
    disturb(child)
    end = time.monotonic() + (8.0 if how == "undisturbed" else 2.0)  # of the loop, one
    while time.monotonic() < end and not (result.exists() and result.read_text().endswith("}")):
        time.sleep(0.05)
    child.close(force=True)
    return json.loads(result.read_text()) if result.exists() else None


def hang_up(child):
    """Close the terminal's other end, and that alone."""
    null = os.open(os.devnull, os.O_RDWR)
    os.dup2(null, child.child_fd)
    os.close(null)


DISTURBANCES = {
    "suspend": lambda child: child.send(b"\x1a"),
    "quit": lambda child: child.send(b"\x1c"),
    "hold": lambda child: child.send(b"\x13"),
    "nobody reads": lambda child: None,
    "garbage": lambda child: child.send(bytes(range(4, 256)) + b"\nrm -r x\n\x1a\x1c\x13"),
    "hang up": hang_up,
}


@pytest.mark.parametrize("what", DISTURBANCES)
def test_nothing_that_a_terminal_does_reaches_the_loop(tmp_path, what):
    found = disturbed(tmp_path, "undisturbed", DISTURBANCES[what])
    assert found is not None, what
    assert found["longest"] < 1.0  # s, on a busy machine
    assert not found["left"]  # typed in flight: no shell shall run it


@pytest.mark.parametrize("what", DISTURBANCES)
def test_it_would_without(tmp_path, what):
    assert disturbed(tmp_path, "as it is", DISTURBANCES[what]) is None
