"""The person at the terminal of a flight on devices: arming is confirmed, a stop never waits, noise has no effect.

Why it is so stands in docs/explanation/supervisor.md ("The console").
"""

import contextlib
import math
import os
import signal
import sys
import termios
import time
from collections.abc import Callable, Iterator

import click

AGAIN_S = (0.3, 5.0)  # between two presses of Ctrl-C that leave a submerged vehicle: no burst of noise, no afterthought
IGNORED = (
    "SIGTSTP",
    "SIGQUIT",
    "SIGTTOU",
    "SIGTTIN",
)  # what keys, or writing from the background, would do to the loop


def confirm_arming(what: str) -> bool:
    """Whether the person at the terminal says yes, in full. Where there is no terminal, nobody does."""
    if sys.stdin is None or not sys.stdin.isatty():
        return False
    click.echo(f"{what}: actuators go live once all checks pass; hands and cables clear? (yes/no) ", err=True, nl=False)
    return sys.stdin.readline().strip().lower() == "yes"


class Stop:
    """Handles Ctrl-C. The first gives the dive up: the vehicle surfaces. Another stops at once, KeyboardInterrupt; but
    while a vehicle is under water, where nobody's hands are, only one that is meant (AGAIN_S after the one before)."""

    def __init__(
        self, give_up: Callable[[], None], surface: float = 0.0, depth: Callable[[], float] | None = None,
        now: Callable[[], float] = time.monotonic, *, tell: Callable[[str], object] = lambda text: None,
    ):  # fmt: skip
        """`surface`: m, the depth above which the vehicle is at the surface; `depth`: m, measured, NaN where it is not
        known, of a vehicle on devices; None in simulation; tell(text): a line for the person, from a signal handler."""
        self._surface = surface
        self.presses = 0
        self._give_up, self._depth, self._now, self._tell = give_up, depth, now, tell
        self._before = -math.inf

    def __call__(self, *_: object) -> None:
        self.presses += 1
        since, self._before = self._now() - self._before, self._now()
        deep = self._depth is not None and not self._depth() <= self._surface  # NaN: deep
        if self.presses == 1:
            self._give_up()
            again = "twice more, a second apart, leaves it under water" if deep else "again stops at once"
            self._tell(f"surfacing; Ctrl-C {again}")
        elif not deep or (self.presses > 2 and AGAIN_S[0] <= since <= AGAIN_S[1]):
            raise KeyboardInterrupt
        else:
            self._tell("surfacing; Ctrl-C once more, in a second, leaves the vehicle where it is")


@contextlib.contextmanager
def terminal_detached() -> Iterator[None]:
    """A flight that its terminal cannot stop, halt or hold up: keys that stop or suspend a program do nothing, a
    terminal that goes away does nothing, one that takes no more (Ctrl-S, a line that hangs) holds nobody up. What was
    typed meanwhile is thrown away, so that no shell runs it afterwards.
    """
    terminals = [fd for fd in (0, 1, 2) if os.isatty(fd)]
    hung_up: list[int] = []
    handlers = {getattr(signal, name): signal.SIG_IGN for name in IGNORED}
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}

    def on_hang_up(*_: object) -> None:
        hung_up.append(signal.SIGHUP)
        _let_go(terminals)

    before[signal.SIGHUP] = signal.signal(signal.SIGHUP, on_hang_up)
    kept = _without_waiting(2) if 2 in terminals else None
    try:
        yield
    finally:
        if kept is not None and not hung_up:
            os.dup2(kept, 2)
        if kept is not None:
            os.close(kept)
        if 0 in terminals and not hung_up:
            with contextlib.suppress(OSError, termios.error):
                if os.tcgetpgrp(0) == os.getpgrp():
                    termios.tcflush(0, termios.TCIFLUSH)
        for number, handler in before.items():
            if number != signal.SIGHUP or not hung_up:
                signal.signal(number, handler)


def _let_go(terminals: list[int]) -> None:
    """The terminal is gone: nobody reads, nobody types."""
    null = os.open(os.devnull, os.O_RDWR)
    for fd in terminals:
        os.dup2(null, fd)
    os.close(null)


def _without_waiting(fd: int) -> int | None:
    """Have a terminal's descriptor refuse rather than wait; the one there was, to be put back. The shell's stays as it
    is: O_NONBLOCK belongs to what was opened, so the terminal is opened anew."""
    try:
        fresh = os.open(os.ttyname(fd), os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
    except OSError:  # a terminal of another user's, say
        return None
    kept = os.dup(fd)
    os.dup2(fresh, fd)
    os.close(fresh)
    return kept
