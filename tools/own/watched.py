"""The answer of a watch of a user's vehicle: events, sessions, what is said of every run."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from glider.tools.own.decision import UNKNOWN, Healthy, confounded, group_of
from glider.tools.own.effects import UNEXPLAINED
from glider.tools.own.evidence import interval

CERTAIN = 0.5  # probability from which an event is one
LEAST_LISTED = 0.005  # probability of a label or a place

K = TypeVar("K")


def likeliest(chances: Mapping[K, float]) -> dict[K, float]:
    """Probabilities that are listed, the largest first."""
    return {one: p for one, p in sorted(chances.items(), key=lambda item: -item[1]) if p > LEAST_LISTED}


@dataclass
class Event:
    """A change: its labels by probability, the runs it is in, its size."""

    chances: dict[str, float]
    first: int
    end: int
    label: str
    size: float  # spreads
    sd: float
    probability: float

    @property
    def span(self) -> slice:
        return slice(self.first, self.end)


@dataclass
class Watched:
    """The answer of a watch."""

    names: list[str]
    learned: int
    events: list[Event]
    healthy: Healthy
    gaps: np.ndarray  # (runs,) tolerances
    strange: np.ndarray  # (runs,) probability that a run has more left than healthy ones and its events say
    cautions: list[str] = field(default_factory=list)
    reference: list[str] = field(default_factory=list)  # runs from which it was learned
    sessions: list[dict[str, Any]] = field(default_factory=list)  # that begin among them, and what each differs by

    def plain(self) -> dict[str, Any]:
        """The JSON of docs/reference/gap.md, What changed."""
        effects = {one.label: one for one in self.healthy.effects}
        runs, events = [], []
        for one in self.events:
            events.append(self._event(one, effects))
        for n, name in enumerate(self.names):
            own = [event for one, event in zip(self.events, events, strict=True) if one.first <= n < one.end]
            causes = [{key: event[key] for key in ("label", "probability", "group", "size", "ci90", "unit")}
                      for event in own if event["label"]]  # fmt: skip
            unknown = self.strange[n] > CERTAIN or any(event["label"] is None for event in own)
            verdict = "cause" if causes else (UNKNOWN if unknown else "none")
            runs.append(
                {"run": name, "verdict": verdict, "causes": causes, "gap": float(self.gaps[n]), "skipped": None}
            )
        return {
            "format": 1, "runs": runs, "events": events, "sessions": self.sessions, "reference": self.reference,
            "cautions": [
                *self.cautions,
                *(text for one in events for text in confounded(one["group"], f"the change from {one['from_run']} on")),
            ],
        }  # fmt: skip

    def _event(self, one: Event, effects) -> dict[str, Any]:
        effect = effects[one.label]
        known = effect.family not in UNEXPLAINED
        # of an unknown change the labels that come nearest
        group = group_of({label: p for label, p in one.chances.items() if effects[label].family not in UNEXPLAINED})
        places: dict[tuple[str, str], float] = {}
        for label, p in one.chances.items():
            where = effects[label].where
            places[where] = places.get(where, 0.0) + p
        return {
            "label": one.label if known else None, "group": group, "probability": one.probability,
            "labels": likeliest(one.chances),
            "where": [{"subsystem": s, "element": e, "probability": p} for (s, e), p in likeliest(places).items()],
            "from_run": self.names[one.first],
            "to_run": None if one.end == len(self.names) else self.names[one.end - 1],
            "course": "step" if one.end == len(self.names) else "episode",
            "size": one.size * effect.spread, "ci90": interval(effect, one.size, one.sd), "unit": effect.unit,
            "sizes": [],
        }  # fmt: skip
