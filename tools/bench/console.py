"""The bench's prompt, and the same commands from a script or a pipe.

At a terminal: completion, help, history. From a script every line is shown before it runs, answers to questions are the
next lines, and the first command that fails ends it with exit code 1 (2 where it was not understood).
"""

import contextlib
import math
import os
import select
import signal
import sys
import termios
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from glider.hal.ports import ACTUATORS
from glider.tools.bench.client import Bench, BenchError
from glider.tools.bench.commands import ALIASES, Commands
from glider.tools.bench.desk import UsageError
from glider.tools.bench.units import UNITS, WIRES, from_port, shown_values
from glider.tools.data.errors import BAD_INPUT, DONE, FAILED

HISTORY = "GLIDER_BENCH_HISTORY"
WATCH_S = 0.2
NOTE_S, PLAIN_NOTE_S = 1.0, 10.0  # between two notes, at a terminal and elsewhere


def table_of(state: dict) -> Any:
    """A snapshot as a table."""
    from rich.table import Table

    table = Table(title=f"{state['name']}: {'ENABLED' if state['enabled'] else 'not enabled'}; any key ends")
    for heading in ("device", "state", "values", "trouble"):
        table.add_column(heading)
    for name, item in state["sensors"].items():
        table.add_row(name, item["validity"], shown_values(name, item["values"]), item["error"])
    for name, item in state["actuators"].items():
        target = "-" if item["target"] is None else f"{from_port(name, item['target'], state['kg_per_m']):.2f}"
        values = f"target {target} {UNITS[name]}"
        if "measured" in item:
            values += f", at {from_port(name, item['measured'], state['kg_per_m']):.2f}"
        table.add_row(name, "answers" if item["answers"] else "SILENT", values, item["error"])
    return table


@contextlib.contextmanager
def keys() -> Iterator[Callable[[], bool]]:
    """pressed(): has a key been pressed at the terminal? Elsewhere never."""
    if not sys.stdin.isatty():
        yield lambda: False
        return
    before = termios.tcgetattr(0)
    tty.setcbreak(0)
    try:

        def pressed() -> bool:
            if select.select([0], [], [], 0.0)[0]:
                os.read(0, 100)
                return True
            return False

        yield pressed
    finally:
        termios.tcsetattr(0, termios.TCSADRAIN, before)


class Console:
    """Reads lines and runs them as commands."""

    def __init__(self, bench: Bench, out: Path):
        self.bench = bench
        self._pressed: Callable[[], bool] = lambda: False
        self._lines: Iterator[str] | None = None
        self._noted = -math.inf  # when a note was last shown
        self.commands = Commands(bench, self.say, self.ask, lambda: self._pressed(), self._show, out, self.note)

    def say(self, text: str) -> None:
        print(text, flush=True)

    def note(self, text: str) -> None:
        """How far something is: one line that is written over once a second, elsewhere than at a terminal one now and
        then; empty: take it away."""
        terminal, now = sys.stdout.isatty(), time.monotonic()
        if not text:
            self._noted = -math.inf
            print(end="\r\x1b[K" if terminal else "", flush=True)
        elif now - self._noted >= (NOTE_S if terminal else PLAIN_NOTE_S):
            self._noted = now
            print(f"\r\x1b[K{text}" if terminal else text, end="" if terminal else "\n", flush=True)

    # --- a script or a pipe -----------------------------------------------------------------------------------------
    def run_lines(self, lines: Iterator[str], source: str) -> int:
        """Commands one a line; exit code 0, 1 (a command failed) or 2 (one was not understood)."""
        self._lines = (line.rstrip("\n") for line in lines)
        self.commands.scripted = True
        for line in self._lines:
            if line.strip() and not line.strip().startswith("#"):
                self.say(f"> {line.strip()}")
            try:
                self.commands.run(line)
            except BenchError as error:
                self._stop_quietly()
                print(f"glider: {source}: {line.strip()}: {error}", file=sys.stderr, flush=True)
                return BAD_INPUT if isinstance(error, UsageError) else FAILED
            except KeyboardInterrupt:
                self._stop_quietly()
                print("glider: stopped", file=sys.stderr, flush=True)
                return FAILED
            except SystemExit:
                break
        return DONE

    def _stop_quietly(self) -> None:
        with contextlib.suppress(BenchError):
            self.bench.stop()

    def ask(self, question: str) -> str:
        """An answer: the next line of the script, or of the person."""
        if self._lines is None:
            return self._session.prompt(question, completer=None).strip()
        answer = next(self._lines, None)
        if answer is None:
            raise BenchError(f"no line left to answer: {question.strip()}")
        self.say(f"{question}{answer.strip()}")
        return answer.strip()

    # --- a person ---------------------------------------------------------------------------------------------------
    def run_prompt(self) -> int:
        """The prompt, until `quit` or Ctrl-D."""
        from prompt_toolkit import PromptSession
        from prompt_toolkit.completion import NestedCompleter
        from prompt_toolkit.history import FileHistory, InMemoryHistory

        place = os.environ.get(HISTORY)
        self._session: Any = PromptSession(
            history=FileHistory(place) if place else InMemoryHistory(),
            completer=NestedCompleter.from_nested_dict(self._completions()),
            complete_while_typing=False,
        )
        self.say(f"{self.bench.source}: `help` lists the commands; nothing moves before `enable`")
        while True:
            try:  # Ctrl-C stops the actuators wherever it falls, between prompt and command too
                line = self._session.prompt("bench> ")
                with keys() as self._pressed:
                    self._ask_plainly(line)
            except KeyboardInterrupt:
                self._stop_quietly()
                self.say("stopped")
            except (EOFError, SystemExit):
                return DONE

    def _ask_plainly(self, line: str) -> None:
        """Run one line of a person's; what goes wrong is said."""
        try:
            self.commands.run(line)
        except BenchError as error:
            self.say(f"  {error}")

    def _completions(self) -> dict[str, Any]:
        state = self.bench.snapshot()
        actuators: dict[str, Any] = {name: None for name in ACTUATORS}
        devices = {name: None for name in [*state["sensors"], *state["actuators"]]}
        wires = {name: None for name in WIRES.values()}
        arguments = {
            "read": devices, "goto": actuators, "jog": actuators, "sweep": actuators, "limits": actuators,
            "calibrate": {**actuators, **wires}, "zero": {**actuators, **wires, "imu": None, "beacon": None},
            "raw": {name: None for name in state["ports"]}, "help": {name: None for name in Commands.names()},
        }  # fmt: skip
        return {name: arguments.get(name) for name in [*Commands.names(), *ALIASES]}

    def _show(self, snapshot: Callable[[], dict], seconds: float) -> None:
        """A live table at a terminal; elsewhere a line a second."""
        from rich.console import Console as Screen

        end = time.monotonic() + (seconds if seconds < math.inf or self._lines is None else 5.0)
        if not sys.stdout.isatty():
            while time.monotonic() < end:
                state = snapshot()
                self.say("; ".join(f"{name} {self.commands.describe(name, state)}" for name in state["sensors"]))
                time.sleep(min(1.0, max(0.0, end - time.monotonic())))
            return
        from rich.live import Live

        with Live(table_of(snapshot()), console=Screen(), refresh_per_second=10) as live:
            while time.monotonic() < end and not self._pressed():
                live.update(table_of(snapshot()))
                time.sleep(WATCH_S)


def hang_up_ends() -> None:
    """A terminal that goes away ends the console as Ctrl-D does; the ports' holder then stops the actuators."""

    def leave(*_: object) -> None:
        raise SystemExit(FAILED)

    for name in ("SIGHUP", "SIGTERM"):
        signal.signal(getattr(signal, name), leave)
