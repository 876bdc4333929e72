"""The health page of a flight under way: read from its heartbeat, in a terminal that may come and go."""

import math
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from glider.firmware.autopilot import MODES
from glider.hal import heartbeat as hb
from glider.hal.heartbeat import Guard, Heartbeat
from glider.hal.outofband.rise import AscentStage
from glider.hal.recorder.condition import RecorderLevel
from glider.tools.data.errors import InputError

PERIOD_S = 1.0
LATE_S = 1.0  # a heartbeat older than this is no good sign
STAGES = {
    "blind": "no depth", "rising": "under water", "surfaced": "at the surface", "again": "does not rise, pumping again",
    "hardware": "does not rise, hardware watchdog no longer fed",
}  # fmt: skip
GUARD_STALE_S = 5.0  # nor is an out-of-band process that was not heard of for so long


def find_folder(wanted: Path | None) -> Path:
    """Where a heartbeat lies: as named, the vehicle's own folder, or that of the newest flight on twins."""
    candidates = [wanted] if wanted else [hb.run_folder()]
    if not wanted:
        twins = Path(tempfile.gettempdir()).glob(f"glider-run-*/{hb.NAME}")
        newest = sorted((path for path in twins if path.is_file()), key=lambda path: path.stat().st_mtime)
        candidates += [path.parent for path in reversed(newest)]
    for folder in candidates:
        if (folder / hb.NAME).is_file():
            return folder
    raise InputError("no flight has left a heartbeat here", source=candidates[0])


def snapshot(folder: Path) -> dict[str, Any]:
    """A flight's health now; `problems` in words, empty where all is well. InputError where there is no heartbeat."""
    try:
        pulse = Heartbeat.open(folder)
    except (OSError, ValueError) as error:
        raise InputError(str(error), source=folder) from None
    try:
        words, values, look = pulse.words, pulse.values, pulse.look()
        alive = pulse.held()
        found = {
            "flight": pulse.flight, "pid": look.pid, "alive": alive, "state": look.state.name.lower(),
            "heartbeat_age_s": look.age_s, "time_s": values[hb.V_TIME_S], "ticks": look.ticks,
            "missed": words[hb.W_MISSED], "worst_late_s": words[hb.W_WORST_NS] / 1e9,
            "mode": MODES.get(float(words[hb.W_MODE]), "?"), "leg": words[hb.W_LEG] + 1, "legs": words[hb.W_LEGS],
            "depth_m": values[hb.V_DEPTH_M], "pitch_deg": math.degrees(values[hb.V_PITCH_RAD]),
            "roll_deg": math.degrees(values[hb.V_ROLL_RAD]), "slider_m": values[hb.V_SLIDER_M],
            "ballast_kg": values[hb.V_BALLAST_KG], "battery_v": values[hb.V_BATTERY_V],
            "recorder": RecorderLevel(words[hb.W_RECORDER_LEVEL]).name.lower() if words[hb.W_RECORDER_LEVEL] < 3 else
            "?", "recorder_age_s": look.recorder_age_s, "records_written": words[hb.W_WRITTEN],
            "records_dropped": words[hb.W_DROPPED], "disk_errors": words[hb.W_DISK_ERRORS],
            "resident_mb": words[hb.W_RSS_BYTES] / 1e6, "descriptors": words[hb.W_FILES],
            "ascent": AscentStage(stage).name.lower() if (stage := words[hb.W_GUARD_STAGE]) in list(AscentStage) else
            "blind", "ascent_depth_m": values[hb.V_GUARD_DEPTH_M] if look.guard == Guard.ASCENDING else float("nan"),
            "out_of_band": look.guard.name.lower(), "out_of_band_age_s": look.guard_age_s,
        }  # fmt: skip
        found["problems"] = _problems(look, alive, found)
    finally:
        pulse.close()
    return found


def _problems(look: hb.Pulse, alive: bool, found: dict[str, Any]) -> list[str]:
    problems = []
    if look.guard == Guard.ASCENDING:
        depth = f", {found['ascent_depth_m']:.1f} m deep" if math.isfinite(found["ascent_depth_m"]) else ""
        problems.append(f"the out-of-band process is bringing the vehicle up: {STAGES[found['ascent']]}{depth}")
    elif look.state.at_rest:
        return ["no flight is under way"]
    elif not alive:
        problems.append("the flight's process is gone")
    elif look.state.beats and look.age_s > LATE_S:
        problems.append(f"no heartbeat for {look.age_s:.1f} s")
    if look.guard_age_s > GUARD_STALE_S:
        problems.append("no out-of-band process watches")
    if found["recorder"] != "ok":
        problems.append(f"recorder: {found['recorder']}")
    if found["records_dropped"]:
        problems.append(f"{found['records_dropped']} records dropped")
    if found["missed"]:
        problems.append(f"{found['missed']} ticks missed")
    return problems


ROWS = (
    ("flight", "{flight}: {state}, {mode}, leg {leg} of {legs}"),
    ("loop", "{ticks} ticks, {missed} missed, at most {worst_ms:.1f} ms late; heartbeat {heartbeat_age_s:.2f} s old"),
    ("vehicle", "depth {depth_m:.2f} m, pitch {pitch_deg:+.1f} deg, roll {roll_deg:+.1f} deg, {battery_v:.1f} V"),
    ("commands", "slider {slider_mm:+.1f} mm, ballast {ballast_kg:+.3f} kg"),
    ("recorder", "{recorder}, {records_written} written, {records_dropped} dropped, {disk_errors} disk errors"),
    ("process", "{resident_mb:.0f} MB resident, {descriptors} descriptors"),
    ("watch", "out of band: {out_of_band}, {out_of_band_age_s:.2f} s ago"),
)


def lines(found: dict[str, Any]) -> list[tuple[str, str]]:
    """The page's rows: a name and a text."""
    numbers = {**found, "worst_ms": 1e3 * found["worst_late_s"], "slider_mm": 1e3 * found["slider_m"]}
    rows = [(name, text.format(**numbers)) for name, text in ROWS]
    return [*rows, ("health", "; ".join(found["problems"]) or "all well")]


def show(folder: Path) -> None:
    """The page, renewed once a second until Ctrl-C; elsewhere than on a terminal a line of it at each."""
    if not sys.stdout.isatty():
        for name, text in lines(snapshot(folder)):
            print(f"{name:<10} {text}")
        return
    from rich.live import Live
    from rich.table import Table

    with Live(refresh_per_second=2, screen=False) as live:
        while True:
            found = snapshot(folder)
            table = Table(title=f"{folder} (Ctrl-C ends)", show_header=False)
            for name, text in lines(found):
                style = "red" if name == "health" and found["problems"] else None
                table.add_row(name, text, style=style)
            live.update(table)
            time.sleep(PERIOD_S)
