"""Faults of the bench's console: what is typed into it."""

import contextlib
import random
from pathlib import Path

from glider.tools.verify.faults.cases import GroundOutcome, observed


def console(disabled: bool, folder: Path) -> GroundOutcome:
    """Garbage typed at the bench of a twinned board, `enable` among it, questions answered by more of it: nothing is
    enabled, nothing moves, the console goes on."""
    from glider.tools.bench.client import Bench, BenchError
    from glider.tools.bench.commands import Commands
    from glider.tools.data.boards import load_board_file

    file, rng = load_board_file("twin"), random.Random(32)
    said: list[str] = []
    words = ["slider", "servo", "0.01", "nan", "-1e9", "\x00", "ü", "#", "'", "$(x)", "enable", "stop", "no"]

    def answer(question: str) -> str:
        return "yes" if disabled else rng.choice(words)

    with Bench(file.text, file.source, file.kind, "roughie", None) as bench:
        commands = Commands(bench, said.append, answer, lambda: True, lambda *a: None, folder, lambda text: None)
        survived = 0
        for _ in range(150):
            line = "".join(map(chr, (rng.randrange(1, 0x250) for _ in range(12))))
            if rng.random() < 0.5:
                line = " ".join(rng.choice(words) for _ in range(rng.randrange(1, 5)))
            with contextlib.suppress(BenchError):
                commands.run(line)
            survived += 1
        for line in ("enable", "jog slider 5", "goto ballast 20", "sweep servo"):
            with contextlib.suppress(BenchError):
                commands.run(line)
        state = bench.snapshot()
    moved = any(item["target"] is not None for item in state["actuators"].values())
    good = not state["enabled"] and not moved and survived == 150
    return observed(good, "no effect", "actuators moved")
