"""The same release there and here: its sources on this computer, and two logs compared, number by number."""

import math
import os
import shutil
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.data.log.reader import read_log
from glider.tools.deploy.bundle import archived, written
from glider.tools.deploy.wheels import ROOT
from glider.tools.verify.arm64.arm import Arm

REFERENCE = "tests/data/reference"
# Times and what the host says of itself: different in any two flights.
OF_THE_CLOCK = ("lateness_s", "duration_s")
# What Python and the C library make of the same numbers: a library of another version, or for a processor without
# fused multiply-add, rounds the last bit of a sine otherwise, and then no flight is the same bit for bit.
MATHS = """
import hashlib, math, random
numbers, found = random.Random(1), hashlib.sha256()
for _ in range(20000):
    x = numbers.uniform(-10.0, 10.0)
    made = math.sin(x), math.cos(x), math.tan(x), math.exp(x), math.tanh(x), math.atan2(x, 1.3), math.log(abs(x))
    found.update(repr((*made, math.asin(x / 10.0), math.hypot(x, 1.3), abs(x) ** 0.3, sum(made))).encode())
print(found.hexdigest())
"""


@dataclass(frozen=True)
class Here:
    """The same release on this computer: its sources and reference flights, unpacked."""

    folder: Path

    @classmethod
    def of(cls, release: Path, folder: Path) -> "Here":
        """Of a release's own wheel, and of the commit that it was made of."""
        shutil.rmtree(folder, ignore_errors=True)
        (folder / "sources").mkdir(parents=True)
        (wheel,) = (release / "wheels").glob("underwater_glider-*.whl")
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(folder / "sources")
        archived(ROOT, written(release)["release"].rpartition("-")[2], folder, REFERENCE)
        return cls(folder)

    def references(self) -> list[Path]:
        return sorted((self.folder / REFERENCE).glob("*.csv"))

    def call(self, *words: str, compiled: bool) -> subprocess.CompletedProcess:
        """A command of this Python on those sources, with kernels of their own."""
        settings = {"PYTHONPATH": str(self.folder / "sources"), "GLIDER_CACHE_DIR": str(self.folder / "cache"),
                    "GLIDER_JIT": str(int(compiled)), "PYTHONWARNINGS": "ignore"}  # fmt: skip
        (self.folder / "cache").mkdir(exist_ok=True)
        return subprocess.run(
            [sys.executable, *words], env={**os.environ, **settings}, cwd=self.folder / "sources",
            stdout=subprocess.PIPE, text=True,
        )  # fmt: skip


def same_maths(arm: Arm, here: Here) -> bool:
    """Whether the C libraries there and here agree to the last bit."""
    there = arm.call("python3", "-c", MATHS, stdout=subprocess.PIPE, check=True)
    return there.stdout == here.call("-c", MATHS, compiled=False).stdout


def compared(mission: str, logs: list[Path]) -> dict[str, Any]:
    """Which numbers of two logs' ticks differ, and by how much at most; passed with as many ticks in both."""
    found = [read_log(path).topics.get("/tick") for path in logs if path.exists()]
    ticks = [one for one in found if one is not None]
    if len(ticks) < 2:
        return {"mission": mission, "pass": False, "bit_for_bit": False, "largest": math.inf, "said": "no log"}
    counts = [ticks[0].count, ticks[1].count]
    same = counts[0] == counts[1]
    names = [field.name for field in ticks[0].fields if same and field.name not in OF_THE_CLOCK]
    columns = {name: [np.asarray(one.column(name)) for one in ticks] for name in names}
    worst = {name: difference(*pair) for name, pair in columns.items() if pair[0].tobytes() != pair[1].tobytes()}
    return {
        "mission": mission, "pass": same, "ticks": counts, "fields": len(ticks[0].fields),
        "bit_for_bit": same and not worst, "largest": max(worst.values(), default=0.0),
        "largest_differences": dict(sorted(worst.items(), key=lambda item: -item[1])[:8]),
    }  # fmt: skip


def difference(one: np.ndarray, other: np.ndarray) -> float:
    """The largest of two columns, (n,) each; infinite where one has a number and the other none."""
    one, other = one.astype(float), other.astype(float)
    if (np.isnan(one) != np.isnan(other)).any():
        return math.inf
    return float(np.nanmax(np.abs(one - other), initial=0.0))
