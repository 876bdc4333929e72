"""`glider log replay`: a log flown again, on one page."""

from pathlib import Path
from typing import Any

import click

from glider.tools.cli.common import DONE, FAILED, json_option, print_json, progress, say, show

AROUND_S = (-10.0, -1.0, -0.1, None, 0.0, None, 1.0)  # columns: s from the abort; None: the tick before, the one after
CHECKED = ("est_depth_m", "asked_servo_rad", "asked_slider_m", "asked_ballast_kg", "lateness_s", "recorder", "growth",
           "stop", "mode", "reaction", "fault")  # fmt: skip
MARKS = {0.0: "missing", 1.0: "", 2.0: "stale", 3.0: "fault"}
FRESH_S = 0.3  # a table leaves out the ages of a port whose samples are all valid and no older
REJECTED = "rejected"  # valid by its driver, and not so for the supervisor's screening
SHOWN_FIELDS, SHOWN_EVENTS = 4, 3
WARN = 30


def nearest_ticks(replay: Any) -> list[int]:
    """Ticks (from 0) to show around a recorded abort, or around the first difference where there was none."""
    import numpy as np

    t = replay.tick.column("t_s")
    centre = (replay.abort or replay.abort_now or replay.first).tick - 1
    found = [int(np.argmin(np.abs(t - (t[centre] + s)))) for s in AROUND_S if s is not None]
    return sorted({*found, max(centre - 1, 0), min(centre + 1, len(t) - 1)})


def inputs_around(replay: Any) -> dict[str, list[Any]]:
    """Return the recorded inputs and states of those ticks: a row's name -> a value for each tick, t_s first."""
    from glider.hal.ports import SLOTS, Validity

    ticks = nearest_ticks(replay)

    def values(name: str) -> list[float]:
        return [float(replay.tick.column(name)[i]) for i in ticks]

    t = values("t_s")
    rows: dict[str, list[Any]] = {"tick": [i + 1 for i in ticks], "t_s": t}
    for place, (port, slot) in enumerate(SLOTS.items()):
        rows[f"{port} age s"] = [now - then for now, then in zip(t, values(f"raw_{port}_time"), strict=True)]
        marks = []
        for i, validity in zip(ticks, values(f"raw_{port}_validity"), strict=True):
            left = replay.validity[i, place] if i < replay.replayed else validity
            screened = validity == Validity.VALID and left != Validity.VALID
            marks.append(REJECTED if screened else MARKS.get(validity, f"{validity:g}"))
        rows[f"{port} validity"] = marks
        for name, unit in zip(slot.names, slot.units, strict=True):
            rows[f"{port} {name} {unit}"] = values(f"raw_{port}_{name}")
    return rows | {name: values(name) for name in CHECKED}


def _table(rows: dict[str, list[Any]]) -> list[str]:
    """Lay the rows out; a port's age and validity share a line, and a port that is not fitted is left out."""
    lines = []
    for name, values in rows.items():
        if name.endswith(" validity"):
            continue
        port = name.split(" ")[0]
        marks = rows.get(f"{port} validity", [])
        if marks and all(mark == MARKS[0] for mark in marks):
            continue
        if name.endswith(" age s"):
            if not any(marks) and max(values) <= FRESH_S:
                continue
            cells = [f"{value:.2f} {mark}".rstrip() for value, mark in zip(values, marks, strict=True)]
        else:
            cells = [f"{round(value, 9) + 0.0:.7g}" for value in values]
        lines.append(f"  {name.removesuffix(' 1'):<26}" + "".join(f"{cell:>14}" for cell in cells))
    return lines


def page(replay: Any) -> list[str]:
    """Describe a replay on one page: same or where not, the abort, and its inputs."""
    log, facts = replay.log, replay.log.metadata
    words = [f"{facts[name]}" for name in ("software", "vehicle", "mission", "board") if name in facts]
    began = f", begun {log.began}" if log.began else ""
    lines = [f"{log.path}: {replay.tick.count} ticks, {log.duration_s:.2f} s{began}", f"flown by {', '.join(words)}"]
    if not log.complete:
        lines.append(f"the log is cut: nothing is known of the flight after {replay.tick.column('t_s')[-1]:.2f} s")
    if replay.ends:
        lines.append(f"replayed {replay.replayed} ticks: {replay.ends}")
    lines += _differences(replay)
    lines.append(f"recorded: {_abort(replay.abort) or _ending(log)}")
    if replay.abort_now != replay.abort and not replay.ends:
        lines.append(f"now:      {_abort(replay.abort_now) or 'not given up'}")
    if replay.abort is None and replay.abort_now is None:
        return lines
    at = (replay.abort or replay.abort_now).time_s
    events = [event for event in log.events if event.severity >= WARN and event.time_s <= at + 1.0]
    lines += [f"  {event.time_s:9.2f} s  {event.text}" for event in events[-SHOWN_EVENTS:]]
    lines.append("inputs around it, before screening (age: since the sample; validity where it is not valid):")
    return lines + _table(inputs_around(replay))


def _differences(replay: Any) -> list[str]:
    if replay.same:
        return ["same: every command, mode, reaction and estimate, to the bit"]
    first, states = replay.first, replay.first_state
    lines = [f"differs from tick {first.tick}, {first.time_s:.2f} s, on: {replay.differing} ticks"]
    shown = list(first.fields.items())
    lines += [f"  {name:<22} recorded {was:<22.17g} now {now:.17g}" for name, (was, now) in shown[:SHOWN_FIELDS]]
    if len(shown) > SHOWN_FIELDS:
        lines.append(f"  and {len(shown) - SHOWN_FIELDS} more numbers (--json has them all)")
    largest = ", ".join(f"{name} {value:.3g}" for name, value in replay.largest.items())
    lines.append(f"largest difference of a command: {largest or 'none'}")
    if states is None:
        lines.append("mode, leg, reason, reaction and row of the fault table: the same in every tick")
    else:
        changes = "; ".join(f"{name} {was:g}, now {now:g}" for name, (was, now) in _states(states).items())
        lines.append(f"decides otherwise from tick {states.tick}, {states.time_s:.2f} s: {changes}")
        lines.append("(the samples behind that tick are still those of the recorded commands)")
    return lines


def _states(difference: Any) -> dict[str, tuple[float, float]]:
    from glider.tools.flight.replay import STATES

    return {name: pair for name, pair in difference.fields.items() if name in STATES}


def _abort(abort: Any) -> str:
    if abort is None:
        return ""
    return f"given up at {abort.time_s:.2f} s (tick {abort.tick}): {abort.reason}; reaction {abort.reaction}"


def _ending(log: Any) -> str:
    return log.ending.get("ended", "not given up so far" if not log.complete else "not given up")


def summary(replay: Any) -> dict[str, Any]:
    """What --json says of a replay."""

    def difference(item: Any) -> dict[str, Any] | None:
        if item is None:
            return None
        fields = {name: {"recorded": was, "now": now} for name, (was, now) in item.fields.items()}
        return {"tick": item.tick, "t_s": item.time_s, "fields": fields}

    def given_up(item: Any) -> dict[str, Any] | None:
        if item is None:
            return None
        facts = {"reaction": item.reaction, "row": item.row, "reason": item.reason}
        return {"tick": item.tick, "t_s": item.time_s, **facts}

    return {
        "file": str(replay.log.path), "began": replay.log.began or None, "complete": replay.log.complete,
        "ticks": replay.tick.count, "replayed": replay.replayed, "ends": replay.ends, "same": replay.same,
        "differing_ticks": replay.differing, "first": difference(replay.first),
        "first_decision": difference(replay.first_state), "largest": replay.largest,
        "abort": given_up(replay.abort), "abort_now": given_up(replay.abort_now),
        "inputs": inputs_around(replay) if replay.abort or replay.abort_now else None,
    }  # fmt: skip


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@json_option
def replay(file: Path, as_json: bool) -> None:
    """Fly a log's recorded inputs again and compare every outcome with the recorded one, bit for bit.

    Vehicle, mission and settings are the log's own, the code is the present one. Exit code 0: the same; 1: something
    differs, and the page says from which tick on. Of a dive that was given up it shows the inputs around that tick.
    """
    from glider.tools.data.log.parts import read_flight
    from glider.tools.flight.precompile import FLIGHT, ensure_compiled
    from glider.tools.flight.replay import replay_log

    log = read_flight(file)
    ensure_compiled(FLIGHT, say, progress)
    ticks = log.topics["/tick"].count if "/tick" in log.topics else 0
    with progress("replaying", ticks) as advance:
        found = replay_log(log, advance)
    if as_json:
        print_json(summary(found))
    else:
        for line in page(found):
            show(line)
    raise SystemExit(DONE if found.same else FAILED)
