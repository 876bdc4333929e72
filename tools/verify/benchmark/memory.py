"""Memory of the flying process: its peak resident set over a flight, the recorder's own process beside it."""

import json
import subprocess
import tempfile
from typing import Any

from glider.tools.verify.benchmark.registry import Settings
from glider.tools.verify.benchmark.startup import glider_command


def measure(settings: Settings) -> dict[str, Any]:
    """flight_rss_mb: peak resident memory of `glider fly` on the simulated board with a log, MB."""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [*glider_command(), "fly", "--mission", "spiral", "--json"],
            cwd=folder, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        )  # fmt: skip
    return {"flight_rss_mb": json.loads(done.stdout)["peak_rss_mb"]}
