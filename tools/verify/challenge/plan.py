"""Which cases a blind test holds: kinds, labels, sizes and sites, shuffled; all of it follows from the seed."""

from dataclasses import dataclass

import numpy as np

from glider.tools.verify.challenge.forms import KNOWN, SECRET, Form

NONE, SINGLE, PAIR, UNKNOWN = "none", "single", "pair", "unknown"
# Pairs whose effects these flights hardly part from each other teach nothing about finding two.
CONFOUNDED_LABELS = ({"servo_offset", "cg_lateral", "roll_trim", "imu_roll_bias"},)


@dataclass(frozen=True)
class Counts:
    """Cases of each kind."""

    single: int = 100
    none: int = 60
    pairs: int = 30
    unknown: int = 30

    @property
    def total(self) -> int:
        return self.single + self.none + self.pairs + self.unknown


MESSY = Counts(100, 20, 0, 20)


@dataclass(frozen=True)
class Planned:
    """One case of a blind test before anything is drawn for it."""

    number: int
    kind: str

    @property
    def name(self) -> str:
        return f"case{self.number:03d}"


@dataclass(frozen=True)
class CasePlan(Planned):
    """Its effects."""

    labels: tuple[str, ...]
    weak: tuple[bool, ...]
    mocap: bool
    messy: bool = False  # noise is not what the file says, and small effects act beside


def _turns(rng: np.random.Generator, forms: tuple[Form, ...], count: int) -> list[tuple[Form, bool]]:
    """`count` forms, all as often as can be, each weak and strong in turn."""
    found: list[tuple[Form, bool]] = []
    weak = np.zeros(len(forms), dtype=bool)
    for turn in range(-(-count // len(forms))):
        weak = rng.random(len(forms)) < 0.5 if turn % 2 == 0 else ~weak
        found += [(forms[n], bool(weak[n])) for n in rng.permutation(len(forms))]
    return found[:count]


def _pair(rng: np.random.Generator) -> tuple[Form, Form]:
    while True:
        first, second = (KNOWN[n] for n in rng.choice(len(KNOWN), 2, replace=False))
        apart = first.places[0] != second.places[0] and not (first.scatter or second.scatter)
        if apart and not any({first.label, second.label} <= confounded for confounded in CONFOUNDED_LABELS):
            return first, second


def plan(seed: int, counts: Counts, messy: bool = False) -> list[CasePlan]:
    """The cases in their order; half of each kind with motion capture, those that need it among them."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, 0]))
    drawn: list[tuple[str, tuple[Form, ...], tuple[bool, ...]]] = []
    drawn += [(SINGLE, (form,), (weak,)) for form, weak in _turns(rng, KNOWN, counts.single)]
    for n in range(counts.pairs):
        drawn.append((PAIR, _pair(rng), (n % 2 == 0, n % 2 == 0)))
    drawn += [(UNKNOWN, (form,), (weak,)) for form, weak in _turns(rng, SECRET, counts.unknown)]
    drawn += [(NONE, (), ())] * counts.none
    mocap = np.zeros(len(drawn), dtype=bool)
    for kind in (SINGLE, PAIR, UNKNOWN, NONE):
        here = np.array([n for n, case in enumerate(drawn) if case[0] == kind], dtype=int)
        must = np.array([n for n in here if any(form.by_mocap for form in drawn[n][1])], dtype=int)
        free = rng.permutation(np.setdiff1d(here, must))
        mocap[must] = True
        mocap[free[: max(0, len(here) // 2 - len(must))]] = True
    order = rng.permutation(len(drawn))
    return [
        CasePlan(number, drawn[n][0], tuple(form.label for form in drawn[n][1]), drawn[n][2], bool(mocap[n]), messy)
        for number, n in enumerate(order)
    ]
