"""The two real vehicles of docs/how-to/own-vehicle.md: identified from every second run, asked about others.

`python -m tests.support.real_vehicles blimp|auv DATA OUT` makes the page's tables: DATA is the folder of the
recordings, OUT takes the cases, the identified vehicle and the answers. What is there already is not asked again.
"""

import argparse
import csv
import gzip
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tests.support.commands import glider

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
BLIMP = EXAMPLES / "gliding_blimp" / "rgblimp.toml"
AUV = EXAMPLES / "four_thruster_auv" / "haizhe.toml"
MOVED = 8  # the spiral from which on the blimp's mass is moved
LOADED = 6  # dives with a load that follow normal ones
READ_OFF, OFF_M = 5, 0.1  # the dive of a session from which on its depth is read so much off


def recorded(folder: Path) -> list[Path]:
    """The recordings of a case, in order."""
    return sorted(folder.glob("run[0-9]*.csv.gz"))


def copied(
    folder: Path, runs: Sequence[Path], column: str = "", change: Callable[[float], float] = float, first: int = 0
) -> Path:
    """A case of some runs, with one column changed from run `first` on."""
    if folder.is_dir():
        return folder
    folder.mkdir(parents=True)
    for n, path in enumerate(runs):
        with gzip.open(path, "rt") as file:
            head, *rows = list(csv.reader(file))
        for row in rows:
            if column and n >= first:
                k = head.index(column)
                row[k] = f"{change(float(row[k])):.6f}"
        (folder / f"run{n:02d}.csv").write_text("\n".join(",".join(row) for row in [head, *rows]) + "\n")
    (folder / "case.toml").write_text(f'format = 1\nvehicle = "{folder.name}"\nruns = {len(runs)}\n')
    return folder


def asked(out: Path, answer: str, *arguments: object) -> dict[str, Any]:
    """The answer of a command in a folder of OUT, asked for once; its JSON."""
    file = out / f"{answer}.json"
    if not file.is_file():
        done = glider(*arguments, "--json", cwd=out)
        if done.returncode:
            raise SystemExit(done.stderr)
        file.write_text(done.stdout)
    return dict(json.loads(file.read_text()))


def said(answer: dict[str, Any]) -> str:
    """Verdict and the three likeliest causes of a diagnosis; sessions and events of a watch."""
    if "events" not in answer:
        best = ", ".join(f"{one['label']} {one['probability']:.2f}" for one in answer["causes"][:3])
        return f"{answer['verdict']}: {best}"
    lines = [f"a session from {one['from_run']} on" for one in answer["sessions"]]
    for event in answer["events"]:
        best = ", ".join(f"{label} {p:.2f}" for label, p in list(event["labels"].items())[:4])
        low, high = event["ci90"]
        lines.append(f"{event['from_run']} to {event['to_run']}: {best}; {event['size']:.3g} ({low:.3g} to {high:.3g})")
    lines += [f"{one['run']} unknown" for one in answer["runs"] if one["verdict"] == "unknown"]
    return "; ".join(lines) or "none"


def blimp(data: Path, out: Path) -> None:
    """The blimp: gaps by channel of flights left out, six flights with a change, spirals with one from the 8th on."""
    folders = [recorded(one) for one in sorted(data.iterdir()) if one.is_dir()]
    kept = [path for runs in folders for path in runs[1::2]]
    copied(out / "healthy", [path for runs in folders for path in runs[::2]])
    asked(out, "identify", "identify", "healthy", "--vehicle", BLIMP, "--out", "identified")
    vehicle = "identified/identified.toml"
    copied(out / "kept", kept)
    copied(out / "eight", kept[::2][:8])  # whose diagnosis the page has a time of
    for name, model in (("published", BLIMP), ("kept", vehicle)):
        gap = asked(out, f"gap-{name}", "gap", "measure", "kept", "--vehicle", model)
        print(
            f"{name}: {gap['total']:.2f}", {one: round(value, 1) for one, value in gap["channels"].items()}, flush=True
        )
    changes: dict[str, tuple[list[Path], str, Callable[[float], float]]] = {
        "same": (kept[::3], "", float),
        "same2": (kept[2::3], "", float),
        "mass": (kept[1::3], "mass_x_m", lambda value: value - 0.01),
        "left": (kept[1::3], "thrust_left_n", lambda value: value / 0.7),
        "right": (kept[1::3], "thrust_right_n", lambda value: value / 0.5),
    }
    for name, (runs, column, change) in changes.items():
        copied(out / name, runs, column, change)
        print(
            f"{name}:",
            said(asked(out, f"said-{name}", "gap", "diagnose", name, "--vehicle", vehicle, "--out", f"{name}-answer")),
            flush=True,
        )
    spirals = [path for one in folders if "spiral" in one[0].parent.name for path in one[1::2]]
    copied(out / "spirals", spirals)
    copied(out / "spirals-moved", spirals, "mass_x_m", lambda value: value - 0.01, MOVED - 1)
    for name in ("spirals", "spirals-moved"):
        print(f"{name}:", said(asked(out, f"said-{name}", "gap", "watch", name, "--vehicle", vehicle)), flush=True)


def auv(data: Path, out: Path) -> None:
    """The AUV: each normal session's other dives, with their depth read off from one on, and before dives with a load
    or a damaged propeller of other sessions; with a load, too, by a vehicle identified from that session alone."""
    sessions = {name: recorded(data / f"normal_{name}") for name in "abc"}
    for name, runs in sessions.items():
        copied(out / f"reference-{name}", runs[::2])
    healthy = [f"reference-{name}" for name in sessions]
    asked(out, "identify", "identify", *healthy, "--vehicle", AUV, "--out", "identified")

    def ask(case: str, after: str, first: int, by: str = "identified") -> None:
        answer = asked(out, f"said-{case}-{by}", "gap", "watch", case, "--reference", f"reference-{after}",
                       "--vehicle", f"{by}/identified.toml")  # fmt: skip
        print(f"{case}, from run {first} on, {by}:", said(answer), flush=True)

    for name, runs in sessions.items():
        copied(out / f"{name}-depth", runs[1::2], "depth_m", lambda value: value + OFF_M, READ_OFF)
        ask(f"{name}-depth", name, READ_OFF)
    others = {"load": recorded(data / "addweight"), "damage": recorded(data / "damage_b")}
    for after, further in others.items():
        for name, runs in sessions.items():
            case = f"{name}-{after}"
            copied(out / case, [*runs[1::2], *further[:LOADED]])
            ask(case, name, len(runs[1::2]))
    for name, runs in sessions.items():
        asked(out, f"identify-{name}", "identify", f"reference-{name}", "--vehicle", AUV, "--out", f"alone-{name}")
        ask(f"{name}-load", name, len(runs[1::2]), f"alone-{name}")


def main() -> None:
    """Make a vehicle's tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("vehicle", choices=("blimp", "auv"))
    parser.add_argument("data", type=Path)
    parser.add_argument("out", type=Path)
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    (blimp if args.vehicle == "blimp" else auv)(args.data.resolve(), args.out.resolve())


if __name__ == "__main__":
    main()
