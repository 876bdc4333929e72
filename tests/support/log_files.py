"""A small log for the tests of this folder, and the runs to compare with."""

from pathlib import Path

import numpy as np

from glider.firmware.model.library import shipped
from glider.hal.recorder import disk
from glider.hal.recorder.logfile import LogFile
from glider.hal.recorder.schema import INFO, Field, RecordSpec

TICK = RecordSpec(
    "/tick",
    "glider/msg/Tick",
    (
        Field("t_s", "s", "time"),
        Field("depth_m", "m", "depth"),
        Field("pitch_rad", "rad", "pitch"),
        Field("yaw_rad", "rad", "never there"),
        Field("ref_depth_m", "m", "reference"),
        Field("wrench", "N", "filling", 20),
    ),
)
TRUTH = RecordSpec("/truth", "glider/msg/Truth", (Field("t_s", "s"), Field("x_m", "m", "north")), spare=True)
VEHICLE = shipped("model/vehicles")["roughie"]
METADATA = {"vehicle": "roughie", "site": "pool", "log_rate_hz": "50", "water_density_kg_m3": "998.2"}


def tick_rows(count: int) -> np.ndarray:
    """The log's tick records, shape (count, TICK.width)."""
    rows = np.random.default_rng(7).normal(scale=0.1, size=(count, TICK.width))
    rows[:, 0] = np.arange(count) / 50
    rows[::3, 1] = np.nan
    rows[:, 3] = np.nan
    return rows


def write_small_log(path: Path, rows: np.ndarray, *, attachments=None, metadata=None, epoch_ns=0) -> Path:
    """Ticks, a truth every other tick, an event every hundredth; a new chunk at every 16 kB and every 150 ticks."""
    fd = disk.create(str(path))
    file = disk.DiskFile(fd)
    log = LogFile(
        file,
        [TICK, TRUTH],
        attachments={"vehicle.toml": VEHICLE, "mission.toml": "x = 1\n"} if attachments is None else attachments,
        metadata=METADATA if metadata is None else metadata,
        epoch_ns=epoch_ns,
    )
    for number, row in enumerate(rows):
        time_s = number / 50
        log.record(0, number + 1, time_s, row.tobytes())
        if number % 2 == 0:
            log.record(1, number // 2 + 1, time_s, np.array([time_s, number]).tobytes())
        if number % 100 == 0:
            log.event(number // 100 + 1, time_s, INFO, f"event {number} äöü")
        if number % 150 == 149:
            log.flush()
    log.finish({"reason": "done"})
    assert file.sync()
    disk.close(fd, str(path), keep=True)
    return path
