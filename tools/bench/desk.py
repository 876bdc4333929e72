"""What the bench's commands share: the bench, the person, and how a word is understood."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from glider.tools.bench.client import Bench, BenchError


class UsageError(BenchError):
    """A command was typed that cannot be understood."""


def number(word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        raise UsageError(f"expected a number, got '{word}'") from None
    if not math.isfinite(value):
        raise UsageError(f"expected a finite number, got '{word}'")
    return value


class Desk:
    """A bench, a way to say things, a way to ask, a way to see a key pressed, and where files go."""

    def __init__(
        self, bench: Bench, say: Callable[[str], None], ask: Callable[[str], str],
        pressed: Callable[[], bool], show_table: Callable[[Callable[[], Any], float], None], out: Path,
        note: Callable[[str], None],
    ):  # fmt: skip
        """note(text): how far something is that takes its time; the next replaces it, an empty one takes it away."""
        self.scripted = False  # an `enable` in a script was written with time to think, and is not asked about
        self.bench, self.say, self.ask, self.pressed, self._show, self.out = bench, say, ask, pressed, show_table, out
        self.note = note

    def ask_number(self, question: str) -> float | None:
        """A number, or None for an empty answer. A person who mistypes is asked again; a script's answer has to do."""
        while answer := self.ask(question):
            try:
                return number(answer)
            except UsageError as error:
                if self.scripted:
                    raise
                self.say(f"  {error}; again, or empty to leave it out")
        return None

    def ask_yes(self, question: str, *, again: bool = False) -> bool:
        """Whether the answer is yes; `again`: a person who answers neither yes nor no is asked again."""
        while (answer := self.ask(f"{question} (yes/no) ").lower()) not in ("y", "yes"):
            if self.scripted or not again or answer in ("", "n", "no"):
                return False
        return True
