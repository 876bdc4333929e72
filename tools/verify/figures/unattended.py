"""`python -m glider.tools.verify.figures.unattended`: claims about unattended flights, measured, as JSON.

kills: a flight killed (-9) at random instants and started again, by the rule that `glider fly` goes by: how many dives
were resumed. power-cuts: a log of a flight cut at every byte: what is read of it. endurance: half an hour on twins at
real time, beside load on another core.
"""

import gc
import math
import os
import random
import signal
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from glider.tools.cli.common import DONE, FAILED, print_json, progress

DIP = """
format = 1
name = "dip"
time_limit_s = 60.0
[site]
name = "pool"
depth_m = 6.0
[[leg]]
duration_s = {seconds}
pitch_deg = -15.0
ballast_kg = 0.08
[[leg]]
duration_s = 1.0
pitch_deg = 15.0
ballast_kg = -0.15
"""
LOST_LIMIT_S = 1.0


@click.group()
def main() -> None:
    """Measure what is guaranteed of unattended flights."""


# --- kills ----------------------------------------------------------------------------------------------------------
@main.command("kills")
@click.option("--kills", default=1000, show_default=True, type=click.IntRange(1))
@click.option("--seed", default=1, show_default=True)
def kills(kills: int, seed: int) -> None:
    """Kill a flight at random instants, start it again: 0 dives may be resumed."""
    result = measure_kills(kills, seed)
    print_json(result)
    raise SystemExit(DONE if result["pass"] else FAILED)


@dataclass
class FlightReport:
    """What a flight that may have been killed had reported by then."""

    steps: str = ""  # A armed, D diving (both on the disk), F flew a tick of the mission, E ended, X that on the disk
    refused: bool = False
    ascent_only: bool = False
    seconds: float = 0.0  # from its first step to its end

    @property
    def under_way(self) -> bool:
        """Killed between its arming and its end."""
        return "A" in self.steps and "E" not in self.steps


def measure_kills(count: int, seed: int) -> dict[str, Any]:
    """Each trial: a flight killed, its restart killed too, a last one left alone."""
    from glider.tools.flight.compose import build_flight

    rng = random.Random(seed)
    with tempfile.TemporaryDirectory() as place:
        mission = Path(place, "dip.toml")
        mission.write_text(DIP.format(seconds=20.0))
        flight = build_flight(mission=str(mission))
        _warm(flight)
        flight = build_flight(mission=str(mission))
        gc.collect()
        gc.freeze()  # a child's collection need not copy all that was there before it
        whole_s = _in_child(flight, Path(place, "whole"), None).seconds
        found = {"kills": 0, "under_way": 0, "resumed": 0, "ascended_only": 0, "refused": 0, "ended_before": 0}
        by_step: dict[str, int] = {}
        trial = 0
        with progress("kills", count) as advance:
            while found["kills"] < count:
                trial += 1
                folder = Path(place, f"trial-{trial}")
                under_way = False
                for last in (False, False, True):
                    if not last and found["kills"] == count:
                        continue
                    flight_report = _in_child(flight, folder, None if last else rng.uniform(0.0, 1.05 * whole_s))
                    found["resumed"] += under_way and "F" in flight_report.steps
                    found["ascended_only"] += under_way and flight_report.ascent_only
                    found["refused"] += flight_report.refused
                    under_way = under_way or flight_report.under_way
                    if "X" in flight_report.steps:
                        under_way = False
                    if not last:
                        found["kills"] += 1
                        found["under_way"] += flight_report.under_way
                        found["ended_before"] += "X" in flight_report.steps
                        step = flight_report.steps[-1:] or "before arming"
                        by_step[step] = by_step.get(step, 0) + 1
                        advance(1)
    return {**found, "killed_after": by_step, "whole_flight_s": whole_s, "seed": seed, "pass": found["resumed"] == 0}


def _warm(flight: Any) -> None:
    """Everything compiled and loaded before the first fork."""
    import glider.tools.flight.keeper  # noqa: F401
    from glider.hal.recorder.recorder import NullRecorder
    from glider.tools.flight.compose import build_runtime, record_specs

    flight.board.open()
    runtime = build_runtime(flight, NullRecorder(record_specs(flight)))
    runtime.arm()
    runtime.run()
    runtime.disarm()


def _in_child(flight: Any, folder: Path, kill_after_s: float | None) -> FlightReport:
    """One start of the flight in a process of its own."""
    ours, theirs = os.pipe()
    pid = os.fork()
    if pid == 0:
        code = 1
        try:
            os.close(ours)
            _live(flight, folder, theirs)
            code = 0
        finally:
            os._exit(code)
    os.close(theirs)
    data = os.read(ours, 1)  # it begins
    begin = time.monotonic()
    if kill_after_s is not None:
        time.sleep(kill_after_s)
        os.kill(pid, signal.SIGKILL)
    while piece := os.read(ours, 1000):
        data += piece
    os.close(ours)
    _, status = os.waitpid(pid, 0)
    if kill_after_s is None and status:
        raise RuntimeError("a flight that nobody killed broke off")
    text = data.decode()
    steps = "".join(letter for letter in text if letter in "ADFEX")
    return FlightReport(steps, "R" in text, "U" in text, time.monotonic() - begin)


def _live(flight: Any, folder: Path, pipe: int) -> None:
    """What `glider fly` does between its start and its end, on the simulated board; each step is reported through a
    pipe: armed, diving, first tick flown, loop over (`E`), ended (`X`); refused, under way at the start."""
    from glider.firmware.core.layouts import control_layout as ctl
    from glider.hal.ports import BoardError
    from glider.hal.recorder.recorder import NullRecorder
    from glider.tools.flight import sortie
    from glider.tools.flight.compose import record_specs

    class Telling(sortie.FlightHost):
        flown = False

        def prepare(self) -> None:
            super().prepare()
            os.write(pipe, b"UA" if self.ascent_only else b"A")

        def begin(self, recorder: Any) -> None:
            super().begin(recorder)
            os.write(pipe, b"D")

        def beat(self, t: float) -> None:
            if not self.flown and flight.autopilot.ap[ctl.MODE] == ctl.FLYING:
                self.flown = True
                os.write(pipe, b"F")

        def closing(self, ending: Any) -> None:
            os.write(pipe, b"E")
            super().closing(ending)

    os.write(pipe, b"S")
    try:
        sortie.fly(flight, Telling(flight, name="dip", folder=folder), lambda: NullRecorder(record_specs(flight)))
    except BoardError:
        os.write(pipe, b"R")
        return
    os.write(pipe, b"X")


# --- power cuts -----------------------------------------------------------------------------------------------------
@main.command("power-cuts")
@click.option("--seconds", default=4.0, show_default=True, help="Length of the mission whose log is cut.")
@click.option("--every", default=1, show_default=True, help="Cut at every n-th byte.")
def power_cuts(seconds: float, every: int) -> None:
    """Cut the log of a flight at every byte: nothing damaged is read, at most a second is lost."""
    result = measure_cuts(seconds, every)
    print_json(result)
    raise SystemExit(DONE if result["pass"] else FAILED)


def reference_log(path: Path, seconds: float) -> None:
    """A flight on the simulated board at real time, so that the log is brought to the disk as it is in flight."""
    from glider.tools.flight.compose import build_flight, build_recorder, build_runtime

    mission = path.with_suffix(".toml")
    mission.write_text(DIP.format(seconds=1000.0).replace("time_limit_s = 60.0", "time_limit_s = 2000.0"))
    flight = build_flight(mission=str(mission), realtime=True)
    flight.board.open()
    with build_recorder(flight, path) as recorder:
        runtime = build_runtime(flight, recorder)
        runtime.arm()
        try:
            for _ in range(round(seconds / runtime.dt)):
                runtime.tick()
        finally:
            runtime.disarm()
        recorder.close({"reason": "long enough"})


def measure_cuts(seconds: float, every: int) -> dict[str, Any]:
    """The log shortened byte by byte, and read each time: what is read against what was written.

    Lost is what had happened when the byte at the cut was written and is not read: the time from the last record that
    is read to the last of the piece (chunk) in which the cut lies.
    """
    from glider.tools.data.log.reader import read_log
    from glider.tools.data.log.repair import repair

    with tempfile.TemporaryDirectory() as place:
        path = Path(place, "reference.mcap")
        reference_log(path, seconds)
        whole = read_log(path)
        size = path.stat().st_size
        written = {name: (topic.times_ns.tobytes(), _rows(topic)) for name, topic in whole.topics.items()}
        ends = chunk_ends(path)
        began_ns = min(int(topic.times_ns[0]) for topic in whole.topics.values() if topic.count)
        wrong, worst, repaired = 0, 0.0, 0
        cuts = range(size, -1, -every)
        with progress("cuts", len(cuts)) as advance:
            for done, cut in enumerate(cuts):
                os.truncate(path, cut)
                log = read_log(path)
                good = all(
                    name in written
                    and written[name][0].startswith(topic.times_ns.tobytes())
                    and written[name][1].startswith(_rows(topic))
                    for name, topic in log.topics.items()
                )
                wrong += not (good and not log.damages)
                worst = max(worst, _lost_s(log, ends, cut, began_ns))
                if done % 5000 == 0:
                    repaired += _repairs(repair, read_log, path, log)
                advance(1)
    return {
        "bytes": size, "cuts": len(cuts), "records": {name: topic.count for name, topic in whole.topics.items()},
        "cuts_with_damaged_records": wrong, "most_lost_s": worst, "repaired_and_whole": repaired,
        "repairs_tried": math.ceil(len(cuts) / 5000), "pass": wrong == 0 and worst <= LOST_LIMIT_S,
    }  # fmt: skip


def _rows(topic: Any) -> bytes:
    return b"" if topic.data is None else topic.data.tobytes()


def chunk_ends(path: Path) -> list[tuple[int, int]]:
    """Where each chunk of a log begins and the time of its last record, ns, by its own index."""
    from mcap.reader import make_reader

    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    return sorted((index.chunk_start_offset, index.message_end_time) for index in summary.chunk_indexes)


def _lost_s(log: Any, pieces: list[tuple[int, int]], cut: int, began_ns: int) -> float:
    """Seconds between the last record read (none: the first) and the last of the piece in which the cut lies."""
    begun = [last_ns for start, last_ns in pieces if start < cut]
    if not begun:
        return 0.0
    read = [int(topic.times_ns.max()) for topic in log.topics.values() if topic.count]
    return (max(begun) - max(read, default=began_ns)) / 1e9


def _repairs(repair: Any, read_log: Any, path: Path, cut: Any) -> bool:
    """Whether what can be read of a cut log is a whole log once repaired."""
    out = path.with_name("repaired.mcap")
    if cut.size < 8:
        return True
    report = repair(path, out)
    if report.out is None:
        return cut.whole
    again = read_log(out)
    out.unlink()
    return again.whole and {n: _rows(t) for n, t in again.topics.items()} == {
        n: _rows(t) for n, t in cut.topics.items()
    }


# --- endurance ------------------------------------------------------------------------------------------------------
@main.command("endurance")
@click.option("--minutes", default=30.0, show_default=True)
@click.option("--fifo", is_flag=True, help="At real-time priority, memory locked, as a flight should be.")
@click.option("--no-load", is_flag=True, help="Without the busy process on the other core.")
def endurance(minutes: float, fifo: bool, no_load: bool) -> None:
    """Fly on twins at real time beside load: missed ticks, lateness, memory, descriptors."""
    from glider.tools.verify.figures.endurance import measure

    result = measure(minutes * 60.0, fifo=fifo, load=not no_load)
    print_json(result)
    raise SystemExit(DONE if result["pass"] else FAILED)


if __name__ == "__main__":
    main()
