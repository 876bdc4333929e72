"""A model in another process that speaks lines: a simulator in any language, asked for rollouts.

Each question is a line of JSON on its standard input, each answer one on its standard output::

    {"ask": "declaration"}                                  {"inputs": ..., "outputs": ..., "parameters": ...}
    {"ask": "rollout", "x0": {...}, "t": [...], "u": [[...]], "theta": [...]}      {"y": [[...]]}

x0 holds the first readings of the outputs and their rates (`depth`, `depth_rate`), null where there are none.
"""

import atexit
import contextlib
import json
import math
import shlex
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.data.errors import InputError


class ProcessModel:
    """A black box behind a command; InputError where it does not answer as it should."""

    def __init__(self, command: str, folder: Path):
        self.command = command
        try:
            self._process = subprocess.Popen(
                shlex.split(command), cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
            )
        except (OSError, ValueError) as error:
            raise InputError(f"cannot be started: {error}", source=command) from None
        atexit.register(self._process.kill)
        declared = self._ask({"ask": "declaration"})
        for name in ("inputs", "outputs", "parameters"):
            if name not in declared:
                raise InputError(f"its declaration has no {name}", source=command)
            setattr(self, name, declared[name])
        self.horizon = declared.get("horizon")

    def _ask(self, question: dict[str, Any]) -> dict[str, Any]:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with contextlib.suppress(OSError):  # it has ended: what it said before is read below
            self._process.stdin.write(json.dumps(question) + "\n")
            self._process.stdin.flush()
        line = self._process.stdout.readline()
        if not line:
            raise InputError(
                f"ended with code {self._process.wait()} when asked for its {question['ask']}", source=self.command
            )
        try:
            answer = json.loads(line)
        except ValueError:
            raise InputError(f"expected a line of JSON, got {line.strip()[:80]!r}", source=self.command) from None
        if not isinstance(answer, dict) or "error" in answer:
            raise InputError(
                str(answer.get("error") if isinstance(answer, dict) else answer)[:200], source=self.command
            )
        return answer

    def rollout(self, x0: dict[str, float], t: np.ndarray, u: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Outputs (rows, outputs) from readings x0 at t (rows,) under u (rows, inputs)."""
        start = {name: value if math.isfinite(value) else None for name, value in x0.items()}
        asked = {"ask": "rollout", "x0": start, "t": t.tolist(), "u": u.tolist(), "theta": theta.tolist()}
        answer = self._ask(asked)
        if "y" not in answer:
            raise InputError("its rollout has no y", source=self.command)
        return np.array([[math.nan if one is None else one for one in row] for row in answer["y"]], dtype=np.float64)
