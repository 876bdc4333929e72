"""A diagnosis.json as a scorer reads it (docs/reference/gap.md, Answers): what is scored is checked, the rest is let
be."""

from pathlib import Path
from typing import Annotated, Literal

import msgspec

from glider.tools.data.errors import InputError
from glider.tools.data.plain import read_json

FILE = "diagnosis.json"
MODEL = "corrected.toml"
TIMING = "timing.json"  # beside it, by `glider gap challenge run`
SUM = 0.01  # by which the probabilities of the causes may miss 1
MAX_BYTES = 50_000_000

Probability = Annotated[float, msgspec.Meta(ge=0.0, le=1.0 + 1e-9)]


class Where(msgspec.Struct):
    subsystem: str
    element: str
    probability: Probability


class AnsweredCause(msgspec.Struct):
    label: str
    probability: Probability
    group: list[str] = msgspec.field(default_factory=list)


class AnswerFile(msgspec.Struct):
    """Verdict, places and causes most probable first, and the effects that the corrected model holds."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    verdict: Literal["none", "cause", "unknown"]
    where: list[Where]
    causes: Annotated[list[AnsweredCause], msgspec.Meta(min_length=1)]
    selected: list[str]

    def probability(self, *labels: str) -> float:
        """Probability that the main cause is one of the labels."""
        return sum(cause.probability for cause in self.causes if cause.label in labels)


def read_diagnosis(path: Path) -> AnswerFile:
    """A diagnosis, sorted as it should be; InputError with the place in the file where it is not one."""
    found = read_json(path, AnswerFile, MAX_BYTES)
    labels = [cause.label for cause in found.causes]
    if len(set(labels)) < len(labels):
        twice = next(label for label in labels if labels.count(label) > 1)
        raise InputError(f"the label '{twice}' stands twice", source=path, column="causes")
    total = sum(cause.probability for cause in found.causes)
    if abs(total - 1.0) > SUM:
        raise InputError(f"the probabilities add up to {total:.3f}, not 1", source=path, column="causes")
    found.causes.sort(key=lambda cause: -cause.probability)
    found.where.sort(key=lambda place: -place.probability)
    return found
