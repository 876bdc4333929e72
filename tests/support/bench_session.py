"""A session at the bench's prompt, typed into a real terminal: calibrate, sweep, stop, plug out and in.

`python -m tests.support.bench_session docs/how-to/bench-session.txt` writes what the terminal showed.
"""

import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import pexpect
import pyte

PROMPT = "bench>"
ROWS, COLUMNS = 120, 110
LIMIT_M = 0.012


class Twins:
    """`glider twin`, running, and told things through its socket."""

    def __init__(self, folder: Path, *, wrong: dict[str, tuple[str, str]] | None = None):
        self.folder = folder
        command = [
            sys.executable,
            "-m",
            "glider.tools.cli.main",
            "twin",
            "--dir",
            str(folder),
            "--stand",
            "--seed",
            "5",
        ]
        self.process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        for line in self.process.stderr:
            if b"are there" in line:
                break
        self.board = folder / "board.toml"
        text = self.board.read_text()
        for old, new in (wrong or {}).values():
            assert old in text, old
            text = text.replace(old, new)
        self.board.write_text(text)

    def tell(self, command: str) -> str:
        with socket.socket(socket.AF_UNIX) as line:
            line.connect(str(self.folder / "control"))
            line.sendall(command.encode() + b"\n")
            return line.makefile().readline().strip()

    def state(self) -> dict:
        return json.loads(self.tell("state"))

    def end(self) -> None:
        self.tell("quit")
        self.process.wait(60)
        for pipe in (self.process.stdout, self.process.stderr):
            pipe.close()


# The hull's slider has 80000 uA and 2000000 counts a metre; whoever wrote this board file thought otherwise.
WRONG = {
    "wire": ("per_m = 80000.0", "per_m = 74000.0"),
    "zero": ("zero = 12000.0\nrange_m = [-0.08, 0.08]", "zero = 12200.0\nrange_m = [-0.08, 0.08]"),
    "drive": ("counts_per_m = 2000000.0 ", "counts_per_m = 1900000.0 "),
    "limits": ("limits_m = [-0.062, 0.062]", f"limits_m = [-{LIMIT_M}, {LIMIT_M}]"),
}


class Terminal:
    """The console in a pseudo-terminal of 110 columns; pyte shows what a person would see."""

    def __init__(self, board: Path, out: Path):
        environment = {**os.environ, "TERM": "xterm", "PROMPT_TOOLKIT_NO_CPR": "1"}
        command = ["-m", "glider.tools.cli.main", "bench", "--board", str(board), "--out", str(out)]
        self.child = pexpect.spawn(sys.executable, command, env=environment, dimensions=(ROWS, COLUMNS))
        self.screen = pyte.Screen(COLUMNS, ROWS)
        self._stream = pyte.ByteStream(self.screen)
        self.ready()

    def text(self) -> str:
        """What stands on the screen."""
        return "\n".join(self._row(y) for y in range(ROWS)).rstrip()

    def _row(self, y: int) -> str:
        """One line of the screen; `screen.display` measures every character of all of them anew."""
        row = self.screen.buffer[y]
        return "".join(row[x].data for x in range(COLUMNS)).rstrip()

    def look(self, seconds: float) -> None:
        """Take what comes in the next seconds."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            try:
                self._stream.feed(self.child.read_nonblocking(65_536, timeout=left))
            except pexpect.TIMEOUT:
                return
            except pexpect.EOF:
                raise AssertionError(f"the console has ended:\n{self.text()}") from None

    def wait(self, shows: Callable[[], bool], timeout: float = 60.0) -> None:
        """Until the screen shows something."""
        end = time.monotonic() + timeout
        while not shows():
            assert time.monotonic() < end, self.text()
            self.look(0.1)

    def line(self) -> str:
        """The line that the cursor is on."""
        return self._row(self.screen.cursor.y)

    def ready(self) -> None:
        """Until the prompt is there, and empty."""
        self.wait(lambda: self.line() == PROMPT)

    def note(self, text: str) -> None:
        """A remark of whoever writes the transcript, where the prompt stands."""
        self._stream.feed(f"\r\x1b[K{text}\r\n{PROMPT} ".encode())

    def start(self, line: str) -> None:
        """Type a line."""
        self.look(0.1)
        self.child.send(line.encode())
        self.wait(lambda: line in self.line())
        self.child.send(b"\r")
        self.wait(lambda: self.line() != f"{PROMPT} {line}")

    def type(self, line: str) -> str:
        """Type a line; what is shown until the next prompt."""
        before = len(self.text().splitlines())
        self.start(line)
        self.ready()
        return "\n".join(self.text().splitlines()[before - 1 : -1])

    def answer(self, question: str, answer: str) -> None:
        """Wait for a question and answer it."""
        self.wait(lambda: self.line().startswith(question))
        self.start(answer)


def enable(terminal: Terminal) -> None:
    """Let actuators move, and say that hands are clear."""
    terminal.start("enable")
    terminal.answer("actuators will move", "yes")
    terminal.ready()


def session(folder: Path, *, sweep: bool) -> tuple[str, dict]:
    """The whole session, with or without the sweep to its end; its transcript and what was found on the way."""
    twins = Twins(folder / "p", wrong=WRONG)
    found: dict = {}
    try:
        terminal = Terminal(twins.board, folder)
        terminal.type("read slider_wire")
        found["not enabled"] = terminal.type("goto slider 5")
        terminal.start("enable")
        terminal.answer("actuators will move", "no")
        terminal.ready()
        found["not confirmed"] = terminal.text()
        enable(terminal)
        terminal.start("calibrate slider")
        for place in range(5):
            terminal.wait(lambda: terminal.line() == "where is it really, mm?")
            if place == 1:
                terminal.start("abc")  # a slip of the finger
                terminal.wait(lambda: terminal.line() == "where is it really, mm?")
            terminal.start(f"{1e3 * twins.state()['slider_m']:.1f}")  # the ruler
        terminal.answer("write ", "yse")  # another
        terminal.answer("write ", "yes")
        terminal.ready()
        found["calibrate"] = terminal.text()
        found["board"] = twins.board.read_text()
        enable(terminal)
        found["mistyped"] = terminal.type("gotoo slider 8")
        found["outside"] = terminal.type("goto slider 500")
        found["goto"] = terminal.type("goto slider 8")
        found["slider_m"] = twins.state()["slider_m"]
        if sweep:
            terminal.type("sweep slider")
        terminal.start("sweep slider")
        terminal.wait(lambda: "sweeping slider" in terminal.text().splitlines()[-1])
        terminal.look(1.5)
        found["sweeping"] = terminal.text()
        terminal.child.send(b" ")
        terminal.ready()
        found["key"] = terminal.text()
        terminal.type("goto slider 8")
        if sweep:
            terminal.start("goto slider -9")
            terminal.look(0.35)
        else:  # half a minute of motion: Ctrl-C is in time on the busiest machine
            terminal.start("sweep slider")
            terminal.look(1.5)
        stops = terminal.text().count("stopped")
        terminal.child.sendintr()
        terminal.wait(lambda: terminal.text().count("stopped") > stops)
        terminal.ready()
        found["stop"] = terminal.text()
        found["stopped_m"] = [twins.state()["slider_m"] for _ in range(2) if terminal.look(0.3) is None]
        twins.tell("fault beacon unplug")
        terminal.look(0.7)
        terminal.note("(the cable of the sensors' port is pulled out)")
        found["unplugged"] = terminal.type("read beacon")
        found["unplugged health"] = terminal.type("health")
        twins.tell("fault beacon none")
        terminal.look(1.2)
        terminal.note("(and put in again)")
        found["plugged"] = terminal.type("read beacon")
        terminal.child.send(b"quit\r")
        terminal.child.expect(pexpect.EOF)
        terminal._stream.feed(terminal.child.before or b"")
        terminal.child.close()
        found["exit"] = terminal.child.exitstatus
        return terminal.text(), found
    finally:
        twins.end()


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        text, _ = session(Path(name), sweep=True)
        text = text.replace(name + "/p/", "").replace(name + "/", "")
    Path(sys.argv[1]).write_text(text.strip() + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
