"""Short simulated flights with their logs, and logs written anew with something else in them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from glider.firmware.telemetry import TICK
from glider.hal.recorder import disk
from glider.hal.recorder.logfile import LogFile
from glider.sim_backend.faults import break_in
from glider.tools.data.log.reader import read_log
from glider.tools.flight import sortie
from glider.tools.flight.compose import Flight, build_flight, build_recorder

DIP = """
format = 1
name = "dip"
time_limit_s = 60.0
[site]
name = "pool"
depth_m = 6.0
[[leg]]
duration_s = 4.0
pitch_deg = -15.0
roll_deg = 10.0
ballast_kg = 0.08
[[leg]]
duration_s = 2.0
pitch_deg = 15.0
ballast_kg = -0.15
"""


def fly_dip(
    folder: Path,
    on_second: Callable[[Flight, float], None] | None = None,
    before: Callable[[Flight], None] | None = None,
) -> Path:
    """Fly DIP on the simulated board, with leak sensor and battery, and return the log.

    on_second(flight, t) may break them; before(flight) is called before arming.
    """
    mission = folder / "dip.toml"
    mission.write_text(DIP)
    flight = build_flight(mission=str(mission))
    break_in(flight.board)
    if before is not None:
        before(flight)
    log = folder / "dip.mcap"
    host = sortie.SimulatedHost(flight, name="dip", paced=False)
    second = None if on_second is None else (lambda t: on_second(flight, t))
    sortie.fly(flight, host, lambda: build_recorder(flight, log), on_second=second)
    return log


def write_changed(
    source: Path, path: Path, change: Callable[[np.ndarray], np.ndarray | None] = lambda data: None, *,
    attachments: dict[str, str] | None = None, metadata: dict[str, str | None] | None = None, spec=TICK,
) -> Path:  # fmt: skip
    """Write a log's ticks anew: change(data) may alter them in place, or give others; texts and metadata replaced by
    name (None: left out)."""
    log = read_log(source)
    tick = log.topics["/tick"]
    data = tick.data.copy()
    changed = change(data)
    data = data if changed is None else changed
    facts = {name: text for name, text in {**log.metadata, **(metadata or {})}.items() if text is not None}
    texts = {name: text for name, text in {**log.attachments, **(attachments or {})}.items() if text is not None}
    fd = disk.create(str(path))
    file = disk.DiskFile(fd)
    anew = LogFile(file, [spec], attachments=texts, metadata=facts, epoch_ns=log.epoch_ns)
    times = (tick.times_ns - log.epoch_ns) / 1e9
    for row, number, time_s in zip(data, tick.sequences.tolist(), times.tolist(), strict=True):
        anew.record(0, number, time_s, np.ascontiguousarray(row).tobytes())
    anew.finish(log.ending)
    assert file.sync()
    disk.close(fd, str(path), keep=True)
    return path
