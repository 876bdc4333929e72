"""What a watch answers (docs/explanation/watch.md): a verdict for every run, events over the runs."""

from dataclasses import dataclass, field
from typing import Any

NONE, CAUSE, UNKNOWN = "none", "cause", "unknown"
FILE = "watch.json"


@dataclass(frozen=True)
class Sized:
    """A size with its 90 % interval; `parameters` has every parameter of the label by itself."""

    size: float | None
    ci90: tuple[float, float] | None
    unit: str | None
    parameters: dict[str, dict[str, Any]] = field(default_factory=dict)


@dataclass(frozen=True)
class RunCause:
    """A cause in one run."""

    label: str
    probability: float
    group: list[str]
    sized: Sized

    def plain(self) -> dict[str, Any]:
        return {
            "label": self.label, "probability": self.probability, "group": self.group, "size": self.sized.size,
            "ci90": self.sized.ci90, "unit": self.sized.unit,
        }  # fmt: skip


@dataclass(frozen=True)
class RunVerdict:
    """One run: its verdict, or why there is none."""

    run: str
    verdict: str
    causes: list[RunCause]
    gap: float | None  # total, of the model that all runs share
    skipped: str | None
    velocity: dict[str, Any] | None = None  # through the water, of an ocean glider (tools/gap/velocity, mean_speed)

    def plain(self) -> dict[str, Any]:
        found = {
            "run": self.run, "verdict": self.verdict, "causes": [cause.plain() for cause in self.causes],
            "gap": self.gap, "skipped": self.skipped,
        }  # fmt: skip
        return found if self.velocity is None else found | {"velocity": self.velocity}


@dataclass(frozen=True)
class EventAnswer:
    """A change from run to run. label None: no effect of the catalogue explains it."""

    label: str | None
    where: list[dict[str, Any]]
    group: list[str]
    from_run: str
    to_run: str | None  # None: still there in the last run
    course: str  # step, episode or growing
    probability: float
    sized: Sized
    sizes: list[dict[str, Any]]  # by run

    def plain(self) -> dict[str, Any]:
        return {
            "label": self.label, "where": self.where, "group": self.group, "from_run": self.from_run,
            "to_run": self.to_run, "course": self.course, "probability": self.probability, "size": self.sized.size,
            "ci90": self.sized.ci90, "unit": self.sized.unit, "parameters": self.sized.parameters,
            "sizes": self.sizes,
        }  # fmt: skip


@dataclass(frozen=True)
class WatchAnswer:
    """The answer, and what has to be said with it."""

    runs: list[RunVerdict]
    events: list[EventAnswer]
    reference: list[str]
    cautions: list[str]
    kind: str  # of vehicle, by whose catalogue events are named
    flights: dict[str, str] = field(default_factory=dict)  # run -> file and date of its flight, where they are known

    def plain(self) -> dict[str, Any]:
        found = {
            "format": 1, "kind": self.kind, "runs": [run.plain() for run in self.runs],
            "events": [one.plain() for one in self.events], "reference": self.reference, "cautions": self.cautions,
        }  # fmt: skip
        return found | {"flights": self.flights} if self.flights else found
