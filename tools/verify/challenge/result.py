"""What one sealed set came to, as a file of docs/results: the pages of results are generated from these."""

import datetime as dt
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import msgspec

from glider.tools.data.errors import InputError
from glider.tools.data.plain import read_json
from glider.tools.verify.challenge.diagnosis import TIMING
from glider.tools.verify.challenge.score import ChallengeScore, ScoredCase
from glider.tools.verify.challenge.seal import open_answers
from glider.tools.verify.challenge.watch_plan import UNCHANGED
from glider.tools.verify.challenge.watch_score import Watched, WatchScore

Kind = Literal["single", "messy", "watch", "ocean", "form"]


class ResultFigure(msgspec.Struct):
    """One figure as `ScoreFigure.plain` has it: a share `count`/`of` with Wilson's 90 % interval, or a value."""

    name: str
    of: int
    value: float | None = None
    count: int | None = None
    ci90: tuple[float, float] | None = None
    target: float | None = None
    bound: Literal["at most", "at least"] = "at least"
    met: bool | None = None


class StatedProbability(msgspec.Struct):
    """Probability of an answer's main cause, and whether that cause was right."""

    probability: float
    right: bool


class SetResult(msgspec.Struct):
    """A sealed set with its figures; without figures it has not been answered yet."""

    kind: Kind
    seed: str
    answers_sha256: str | None
    commit: str | None = None  # of the program that answered
    date: str | None = None  # of the scoring, UTC; of the commit where a page is the source
    answered: str = ""  # how many of the cases, where not all were
    standing: bool = True  # false: by a version whose change was removed again
    source: Literal["score", "page"] = "score"  # page: figures copied from the page that published them
    counts: dict[str, int] = {}
    figures: dict[str, ResultFigure] = {}
    stated: list[StatedProbability] = []
    note: str = ""


def stated_of(case: ScoredCase | Watched) -> StatedProbability | None:
    """The probability stated for a case's main cause, or main event; None without one."""
    if isinstance(case, Watched):
        event = case.main
        if event is None or event.probability is None:
            return None
        right = case.kind != UNCHANGED and (event.label or "unknown") == (case.truth["label"] or "unknown")
        return StatedProbability(event.probability, right)
    if case.said is None:
        return None
    main = case.said.causes[0]
    return StatedProbability(main.probability, main.label in case.answers)


def answered_by(diagnoses: Path, names: Sequence[str]) -> str:
    """The commits by which the cases were answered, from their timing files; InputError where none names one."""
    paths = [diagnoses / name / TIMING for name in names]
    found = [json.loads(path.read_bytes()).get("commit") for path in paths if path.is_file()]
    commits = dict.fromkeys(one for one in found if one)
    if not commits:
        raise InputError("no answer names its commit: give --commit", source=diagnoses)
    return ", ".join(commits)


def result_of(
    scored: ChallengeScore | WatchScore, kind: Kind, answers: Path, diagnoses: Path, answered: str | None
) -> SetResult:
    """A scored set as a file of docs/results.

    Args:
        scored: the score.
        kind: what the set is of; messy sets are recognised by their cases.
        answers: the archive of answers, for its seed and hash.
        diagnoses: the folder of answers, for the commit that made them.
        answered: that commit, where the answers do not name it.
    """
    opened = open_answers(answers, ())
    plan = opened.plan or {}
    counts = next((part for part in plan.values() if isinstance(part, dict)), {})
    cases: Sequence[ScoredCase | Watched] = scored.cases
    if isinstance(scored, ChallengeScore) and any(case.messy for case in scored.cases):
        kind = "messy"
    return SetResult(
        kind, str(plan.get("seed", "")), opened.sha256,
        answered or answered_by(diagnoses, [case.name for case in cases]),
        f"{dt.datetime.now(dt.UTC):%Y-%m-%dT%H:%M}", counts=counts,
        figures={figure.key: msgspec.convert(figure.plain(), ResultFigure) for figure in scored.figures if figure.of},
        stated=[one for one in map(stated_of, cases) if one is not None],
    )  # fmt: skip


def as_file(result: SetResult) -> bytes:
    """The bytes of a result's file."""
    return msgspec.json.format(msgspec.json.encode(result), indent=1) + b"\n"


def read_results(folder: Path) -> list[SetResult]:
    """Every result of a folder, in the order of their file names; InputError with the file where one is none."""
    return [read_json(path, SetResult) for path in sorted(folder.glob("*.json"))]
