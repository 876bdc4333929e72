"""Answers against the truth: the figures of docs/reference/gap.md by name, each counted as
docs/explanation/blind-tests.md says."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from glider.tools.data.intervals import wilson
from glider.tools.verify.challenge.diagnosis import AnsweredCause, AnswerFile
from glider.tools.verify.challenge.plan import NONE, PAIR, SINGLE, UNKNOWN

LEAST_PROBABILITY = 1e-6  # what a cause without an entry counts as
LARGEST_GROUP = 3
MOST_SELECTED = 3  # naming more than that is no answer for a pair
SURE_PROBABILITY = 0.8
SCATTER = frozenset({"waves", "turbulence"})  # whose course nobody can predict


@dataclass
class ScoredCase:
    """One case: the truth, what was said (None: nothing), and its outcome."""

    name: str
    truth: dict[str, Any]
    said: AnswerFile | None
    closed: float | None = None  # of what a perfect model closes, on the held runs; None: not asked or no sense
    seconds: float | None = None

    @property
    def labels(self) -> list[str]:
        return self.truth["labels"]

    @property
    def kind(self) -> str:
        """none, single, pair or unknown."""
        if not self.labels:
            return NONE
        if "unknown" in self.labels:
            return UNKNOWN
        return SINGLE if len(self.labels) == 1 else PAIR

    @property
    def answers(self) -> list[str]:
        """What the main cause may rightly be called."""
        return self.labels or ["none"]

    @property
    def messy(self) -> bool:
        """Whether small effects act beside the main one, or alone."""
        return bool(self.truth.get("small"))

    @property
    def tolerable(self) -> list[str]:
        """What may have probability: where only small effects act, they too."""
        return self.answers if self.labels else [*self.answers, *(one["label"] for one in self.truth.get("small", ()))]

    @property
    def subsystems(self) -> set[str]:
        return {place[0] for places in self.truth["places"] for place in places}

    @property
    def predictable(self) -> bool:
        """Whether a model can close this gap at all."""
        return self.kind in (SINGLE, PAIR) and not SCATTER & set(self.labels)

    # --- one yes or no a figure; nothing said is no answer, wrong wherever it counts ------------------------------
    def verdict(self) -> str | None:
        return None if self.said is None else self.said.verdict

    def seen(self) -> bool:
        return self.verdict() in ("cause", "unknown")

    def called_gap(self) -> bool:
        return self.verdict() != "none"

    def called_cause(self) -> bool:
        """Whether a cause is named; no answer counts too."""
        return self.verdict() in (None, "cause")

    def called_unknown(self) -> bool:
        return self.verdict() == "unknown"

    def sure_of_a_label(self) -> bool:
        """Whether a label, or unknown, is named with more than SURE_PROBABILITY; no answer counts too."""
        if self.said is None:
            return True
        return any(cause.probability > SURE_PROBABILITY for cause in self.said.causes if cause.label != "none")

    def _main(self) -> AnsweredCause | None:
        """The most probable cause; None where nothing was said, or so large a group that nothing was."""
        cause = None if self.said is None else self.said.causes[0]
        return None if cause is None or len(cause.group) > LARGEST_GROUP else cause

    def first(self) -> bool:
        cause = self._main()
        return cause is not None and cause.label in self.answers

    def grouped(self) -> bool:
        cause = self._main()
        return cause is not None and bool({cause.label, *cause.group} & set(self.answers))

    def first_three(self) -> bool:
        return self.said is not None and any(cause.label in self.answers for cause in self.said.causes[:3])

    def subsystem(self) -> bool:
        return self.said is not None and bool(self.said.where) and self.said.where[0].subsystem in self.subsystems

    def log_loss(self) -> float:
        probability = 0.0 if self.said is None else self.said.probability(*self.tolerable)
        return -math.log(min(1.0, max(probability, LEAST_PROBABILITY)))

    def odds(self) -> float | None:
        """Nat by which the likeliest label is more probable than `none`; None where one of them has no probability."""
        if self.said is None:
            return None
        none = self.said.probability("none")
        label = max((c.probability for c in self.said.causes if c.label not in ("none", "unknown")), default=0.0)
        return math.log(label / none) if label > 0.0 and none > 0.0 else None

    def _named(self) -> set[str]:
        if self.said is None or len(self.said.selected) > MOST_SELECTED:
            return set()
        return set(self.said.selected)

    def both(self) -> bool:
        return set(self.labels) <= self._named()

    def one_at_least(self) -> bool:
        return bool(set(self.labels) & self._named())

    def sure_and_wrong(self) -> bool:
        if self.said is None:
            return True
        cause = self.said.causes[0]
        return cause.probability > SURE_PROBABILITY and cause.label not in self.answers


@dataclass
class ScoreFigure:
    """One line of the result."""

    key: str
    name: str  # as in docs/reference/gap.md, Figures to reach
    target: float | None  # None: for information
    at_most: bool
    value: float | None
    of: int  # cases that it was counted over
    count: int | None = None  # None: no share
    interval: tuple[float, float] | None = None

    @property
    def met(self) -> bool | None:
        """Whether the value reaches the target; None without a value or a target."""
        if self.value is None or self.target is None:
            return None
        return self.value <= self.target if self.at_most else self.value >= self.target

    def plain(self) -> dict[str, Any]:
        found: dict[str, Any] = {"name": self.name, "value": self.value, "of": self.of, "target": self.target}
        found |= {"bound": "at most" if self.at_most else "at least", "met": self.met}
        if self.count is not None:
            found |= {"count": self.count, "ci90": self.interval}
        return found


@dataclass(frozen=True)
class _Share:
    name: str
    kinds: tuple[str, ...]
    holds: Callable[[ScoredCase], bool]
    at_most: bool = False


GAPS = (SINGLE, PAIR, UNKNOWN)
SHARES = {
    "no_gap_called_gap": _Share("no-gap cases called a gap", (NONE,), ScoredCase.called_gap, True),
    "unchanged_called_cause": _Share("unchanged, called a cause", (NONE,), ScoredCase.called_cause, True),
    "unchanged_called_unknown": _Share("unchanged, called unknown", (NONE,), ScoredCase.called_unknown, True),
    "effects_seen": _Share("effects seen", GAPS, ScoredCase.seen),
    "right_cause_first": _Share("right cause first", (SINGLE,), ScoredCase.first),
    "within_group": _Share("right cause within its group", (SINGLE,), ScoredCase.grouped),
    "in_first_three": _Share("right cause in the first three", (SINGLE,), ScoredCase.first_three),
    "right_subsystem": _Share("right subsystem", (SINGLE,), ScoredCase.subsystem),
    "unknown_called_unknown": _Share("outside the catalogue, called unknown", (UNKNOWN,), ScoredCase.called_unknown),
    "known_called_unknown": _Share("known called unknown", (SINGLE, PAIR), ScoredCase.called_unknown, True),
    "small_sure": _Share("no large one, but sure (> 0.8) of one", (NONE,), ScoredCase.sure_of_a_label, True),
    "small_called_gap": _Share("no large one, called a gap", (NONE,), ScoredCase.called_gap, True),
    "two_both_named": _Share("two effects at once, both named", (PAIR,), ScoredCase.both),
    "two_one_named": _Share("two effects at once, at least one named", (PAIR,), ScoredCase.one_at_least),
    "sure_and_wrong": _Share("sure (> 0.8) and wrong", (NONE, *GAPS), ScoredCase.sure_and_wrong, True),
}
# The shares of each kind of blind test in their order, with their targets; None: for information.
SINGLE_TARGETS = {
    "no_gap_called_gap": 0.02, "effects_seen": 0.98, "right_cause_first": 0.95, "within_group": 0.98,
    "in_first_three": 0.99, "right_subsystem": 0.98, "unknown_called_unknown": 0.90, "known_called_unknown": 0.05,
    "two_both_named": 0.80, "two_one_named": 0.98, "sure_and_wrong": 0.02,
}  # fmt: skip
MESSY_TARGETS = {
    "right_cause_first": 0.90, "within_group": 0.97, "in_first_three": 0.97, "right_subsystem": 0.90,
    "unknown_called_unknown": 0.90, "known_called_unknown": 0.05, "small_sure": 0.03, "small_called_gap": 1.0,
    "two_both_named": 0.80, "sure_and_wrong": 0.03,
}  # fmt: skip
FORM_TARGETS = {  # of vehicles of another form, which the identified model does not quite fit
    "unchanged_called_cause": 0.05, "unchanged_called_unknown": 0.10, "right_cause_first": 0.75, "within_group": None,
    "in_first_three": 0.90, "known_called_unknown": None, "unknown_called_unknown": 0.60, "sure_and_wrong": 0.04,
}  # fmt: skip


def share(key: str, name: str, target: float | None, marks: Sequence[bool], at_most: bool = False) -> ScoreFigure:
    """How many of the marks hold, with its interval."""
    value = sum(marks) / len(marks) if marks else None
    return ScoreFigure(key, name, target, at_most, value, len(marks), sum(marks), wilson(sum(marks), len(marks)))


def _shares(targets: Mapping[str, float | None], cases: Sequence[ScoredCase]) -> list[ScoreFigure]:
    """The shares of a kind of blind test."""
    found = []
    for key, target in targets.items():
        one = SHARES[key]
        marks = [one.holds(case) for case in cases if case.kind in one.kinds]
        found.append(share(key, one.name, target, marks, one.at_most))
    return found


def middle_of(key: str, name: str, values: list[float], target: float | None, at_most: bool, middle) -> ScoreFigure:
    """Mean, median or largest of values."""
    return ScoreFigure(key, name, target, at_most, float(middle(values)) if values else None, len(values))


@dataclass
class ChallengeScore:
    """A blind test scored."""

    cases: list[ScoredCase]
    figures: list[ScoreFigure] = field(default_factory=list)

    def plain(self) -> dict[str, Any]:
        """The result as `--json` prints it."""
        return {
            "figures": {figure.key: figure.plain() for figure in self.figures},
            "cases_by_kind": {kind: len([c for c in self.cases if c.kind == kind]) for kind in (NONE, *GAPS)},
            "unanswered": [case.name for case in self.cases if case.said is None],
            "labels": by_label(self.cases),
            "cases": [_plain_case(case) for case in self.cases],
        }


def _plain_case(case: ScoredCase) -> dict[str, Any]:
    said = case.said
    return {
        "name": case.name,
        "kind": case.kind,
        "labels": case.truth.get("secret") or case.labels,
        "verdict": case.verdict(),
        "first": None if said is None else said.causes[0].label,
        "probability": None if said is None else said.causes[0].probability,
        "selected": None if said is None else said.selected,
        "log_loss": case.log_loss(),
        "odds": case.odds(),
        "closed": case.closed,
        "seconds": case.seconds,
    }


def score_forms(cases: Sequence[ScoredCase], gaps: Sequence[tuple[float, float]]) -> ChallengeScore:
    """Figures of vehicles of another form; gaps: of the file's and the identified model in each one's healthy runs."""
    figures = _shares(FORM_TARGETS, cases)
    closed = [case.closed for case in cases if case.closed is not None]
    figures.append(middle_of("closed", "closed of what the change adds, median", closed, None, False, np.median))
    worse = [identified > file for file, identified in gaps]
    figures.append(share("identified_worse", "identified predicts healthy runs worse", None, worse, True))
    for n, name in enumerate(("file", "identified")):
        totals = [pair[n] for pair in gaps]
        figures.append(middle_of(f"healthy_{name}", f"healthy gap, {name}, median", totals, None, True, np.median))
    seconds = [case.seconds for case in cases if case.seconds is not None]
    figures.append(middle_of("seconds", "seconds a case, the longest", seconds, None, True, max))
    return ChallengeScore(list(cases), figures)


def score(cases: Sequence[ScoredCase]) -> ChallengeScore:
    """Every figure of docs/reference/gap.md over the cases; those of messy cases where small effects act in any of
    them."""
    figures = _shares(MESSY_TARGETS if any(case.messy for case in cases) else SINGLE_TARGETS, cases)
    losses = [case.log_loss() for case in cases]
    closed = [case.closed for case in cases if case.closed is not None]
    seconds = [case.seconds for case in cases if case.seconds is not None]
    figures.insert(6, middle_of("log_loss", "probability log loss, nat", losses, 0.3, True, np.mean))
    figures.append(middle_of("closed", "closed of what a perfect model closes, median", closed, 0.95, False, np.median))
    figures.append(middle_of("seconds", "seconds a case, the longest", seconds, 60.0, True, max))
    figures.append(middle_of("seconds_median", "seconds a case, median", seconds, 20.0, True, np.median))
    return ChallengeScore(list(cases), figures)


def by_label(cases: Sequence[ScoredCase]) -> dict[str, dict[str, Any]]:
    """One line a label: its single cases, and how many of them were seen, first, in the group, in the right place.

    Effects outside the catalogue stand under their own names, `first` being what called them unknown; so does `none`.
    """
    table: dict[str, dict[str, Any]] = {}
    for case in cases:
        if case.kind == PAIR:
            continue
        label = (case.truth.get("secret") or case.answers)[0]
        row = table.setdefault(
            label,
            {"cases": 0, "seen": 0, "first": 0, "group": 0, "three": 0, "subsystem": 0, "called": {}, "closed": []},
        )
        row["cases"] += 1
        row["seen"] += case.seen()
        row["first"] += case.called_unknown() if case.kind == UNKNOWN else case.first()
        row["group"] += case.grouped()
        row["three"] += case.first_three()
        row["subsystem"] += bool(case.subsystems) and case.subsystem()
        if case.said is not None and not case.first():
            wrong = case.said.causes[0].label
            row["called"][wrong] = row["called"].get(wrong, 0) + 1
        if case.closed is not None:
            row["closed"].append(case.closed)
    for row in table.values():
        row["closed"] = float(np.median(row["closed"])) if row["closed"] else None
    return dict(sorted(table.items()))
