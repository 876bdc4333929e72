"""Watches of a blind test against the truth: the figures of docs/explanation/watch.md, and how each is counted."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.verify.challenge.judge import case_folders, gather, manifest_beside, open_sealed
from glider.tools.verify.challenge.score import LARGEST_GROUP, ScoreFigure, middle_of, share
from glider.tools.verify.challenge.watch_answer import REFERENCE, WATCH_FILE, EventSaid, WatchSaid, read_watch
from glider.tools.verify.challenge.watch_plan import CHANGED, OUTSIDE, UNCHANGED

NEEDED = ("kind", "label", "from_run", "to_run", "strengths", "values", "runs")
# Labels whose strength in the foreign plant is the size of the catalogue's parameter, in its unit, whatever the form:
# of these the size is compared. Values of more than one entry by their length.
SAME_UNIT = (
    "servo_offset", "net_buoyancy", "cg_longitudinal", "cg_lateral", "cg_vertical", "current", "imu_pitch_bias",
    "imu_roll_bias", "gyro_scale", "gyro_bias", "depth_offset", "depth_scale", "pressure_lever", "command_delay",
    "mocap_delay", "attitude_lag", "depth_lag", "roll_trim", "pitch_trim", "yaw_trim", "side_force", "weathercock",
)  # fmt: skip


@dataclass
class Watched:
    """One vehicle: the truth, and what was said (None: nothing)."""

    name: str
    truth: dict[str, Any]
    said: WatchSaid | None
    seconds: float | None = None

    @property
    def kind(self) -> str:
        return self.truth["kind"]

    @property
    def changed(self) -> list[bool]:
        """Of each watched run, whether it is changed."""
        return [strength != 0.0 for strength in self.truth["strengths"]]

    def called(self) -> list[bool]:
        """Of each watched run, whether it was called changed; nothing said calls a run neither changed nor not."""
        if self.said is None or len(self.said.runs) != len(self.changed):
            return [not changed for changed in self.changed]
        return [run.verdict != "none" for run in self.said.runs]

    @property
    def main(self) -> EventSaid | None:
        return self.said.events[0] if self.said is not None and self.said.events else None

    def bounds(self) -> bool:
        """First and last run of the main event right to one run."""
        if self.said is None or self.main is None:
            return False
        first, last = self.said.span(self.main)
        ends = [self.truth["runs"] - 1 if one is None else one for one in (last, self.truth["to_run"])]
        return abs(first - self.truth["from_run"]) <= 1 and abs(ends[0] - ends[1]) <= 1

    def label(self) -> bool:
        return self.main is not None and self.main.label == self.truth["label"]

    def group(self) -> bool:
        main = self.main
        return main is not None and len(main.group) <= LARGEST_GROUP and (
            self.truth["label"] in {main.label, *main.group}
        )  # fmt: skip

    def unknown(self) -> bool:
        return self.main is not None and self.main.label is None

    def size(self) -> bool | None:
        """Whether the size is in its interval; None where it cannot be compared, or the label is another."""
        comparable = self.truth.get("same_unit", self.truth["label"] in SAME_UNIT)
        if not comparable or not self.label() or self.main is None or self.main.ci90 is None:
            return None
        values = self.truth["values"]
        true = values[0] if len(values) == 1 else float(np.linalg.norm(values))
        return self.main.ci90[0] <= true <= self.main.ci90[1]


@dataclass
class WatchScore:
    """A blind test of watches scored."""

    cases: list[Watched]
    figures: list[ScoreFigure]

    def plain(self) -> dict[str, Any]:
        """The result as `--json` prints it."""
        return {
            "figures": {figure.key: figure.plain() for figure in self.figures},
            "unanswered": [case.name for case in self.cases if case.said is None],
            "cases": [_plain(case) for case in self.cases],
        }


def _plain(case: Watched) -> dict[str, Any]:
    main, truth = case.main, case.truth
    return {
        "name": case.name, "kind": case.kind, "label": truth["label"] or truth.get("secret"),
        "course": truth.get("course"), "from_run": truth["from_run"], "to_run": truth["to_run"],
        "said": None if main is None else main.label or "unknown",
        "said_from": None if main is None else main.from_run, "said_to": None if main is None else main.to_run,
        "events": 0 if case.said is None else len(case.said.events),
        "called_wrongly": sum(c and not t for c, t in zip(case.called(), case.changed, strict=True)),
        "not_found": sum(t and not c for c, t in zip(case.called(), case.changed, strict=True)),
        "size_in_interval": case.size(), "seconds": case.seconds,
    }  # fmt: skip


def score_watches(cases: Sequence[Watched]) -> WatchScore:
    """Every figure over the vehicles."""
    runs = [(case.kind, true, said) for case in cases for true, said in zip(case.changed, case.called(), strict=True)]
    changed = [case for case in cases if case.kind != UNCHANGED]
    known = [case for case in cases if case.kind == CHANGED]
    outside = [case for case in cases if case.kind == OUTSIDE]
    sizes = [found for found in (case.size() for case in known) if found is not None]
    figures = [
        share("unchanged_called", "runs without change called one", 0.02, [s for _, t, s in runs if not t], True),
        share("changed_found", "runs with it found", 0.95, [s for _, t, s in runs if t]),
        share("bounds", "first and last run right to one run", 0.90, [case.bounds() for case in changed]),
        share("label", "label right first", 0.90, [case.label() for case in known]),
        share("group", "label in its group", 0.97, [case.group() for case in known]),
        share("size", "size within its interval", 0.90, sizes),
        share("outside_unknown", "outside the catalogue, called unknown", 0.90, [case.unknown() for case in outside]),
    ]
    seconds = [case.seconds for case in cases if case.seconds is not None]
    figures.append(middle_of("seconds", "seconds a vehicle, the longest", seconds, 120.0, True, max))
    return WatchScore(list(cases), figures)


def gather_watches(
    cases: Path, answers: Path, said: Path, needed: tuple[str, ...], *, manifest: Path | None = None,
    partial: bool = False, advance: Callable[[int], None] = lambda n: None,
) -> list[Watched]:  # fmt: skip
    """Open and check the answers, and gather what was said to every vehicle of a blind test's folder."""
    folder, _ = case_folders(cases)
    opened = open_sealed(answers, manifest or manifest_beside(folder), folder, folder.parent / REFERENCE, needed)
    return gather(opened, said, partial, WATCH_FILE, read_watch, Watched, advance)


def judge_watches(cases: Path, answers: Path, said: Path, **how: Any) -> WatchScore:
    """Open, check and score what was said to every vehicle of a blind test's folder; how: as in gather_watches."""
    return score_watches(gather_watches(cases, answers, said, NEEDED, **how))
