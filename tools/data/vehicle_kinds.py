"""Kinds of vehicles: what a vehicle file names in `kind` brings its reader, its equations and what commands do with it.

Each comes in by an entry point of the group `glider.kinds`, named as files name it; nothing else in the tree lists
them. A model of a user's own (docs/how-to/own-vehicle.md) needs none.
"""

import contextlib
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Protocol, TypeAlias

from glider.hal.strict import ConfigError

GROUP = "glider.kinds"
UNNAMED = "roughie"  # of a vehicle file without `kind`
Say = Callable[[str], None]
Case: TypeAlias = Any  # of tools/data/runs, where cases are read by the vehicle that they name
Run: TypeAlias = Any


def no_progress(label: str, total: int) -> contextlib.AbstractContextManager[Callable[[int], None]]:
    """No progress shown."""
    return contextlib.nullcontext(lambda n: None)


@dataclass(frozen=True)
class Identified:
    """An identification as commands print and write it."""

    plain: Callable[[], dict[str, Any]]  # as `glider identify --json` prints it
    vehicle_text: Callable[[], str]  # the vehicle file, TOML
    notes: tuple[str, ...]  # runs that were left out, and what limits the result
    write: Callable[[Path], None]  # its files into a folder
    lines: Callable[[], list[str]]  # sentences and tables for a terminal
    report: bool  # whether `write` writes a report


class VehicleKind(Protocol):
    """One kind of vehicle. Methods import what they need when they are called: reading a file compiles nothing."""

    name: str  # as files have it
    group: str  # of shipped vehicles, as `glider.vehicles()` lists them
    noun: str  # in messages, with its article
    extra: str  # of this distribution, that identification needs
    sparse_rows: bool  # whether rows of its runs may be minutes apart
    own_columns: tuple[str, ...]  # that no other kind's runs have
    vehicle: type  # of what `decode` returns

    def shipped(self) -> Mapping[str, str]:
        """Vehicle files that come with the kind, text by name."""
        ...

    def decode(self, text: str, source: str) -> Any:
        """A vehicle file; ConfigError names the key."""
        ...

    def equations(self) -> Any:
        """What a diagnosis flies it by (tools/inference/kind.Kind)."""
        ...

    def catalogue(self) -> Mapping[str, Any]:
        """What a diagnosis may name: effects by label (sim_backend/core/effects/catalogue.Effect); compiles nothing."""
        ...

    def model(self, name: str, vehicle: Any) -> Any:
        """A vehicle as a model (tools/inference/model.Model)."""
        ...

    def numbers(self, name: str, source: str, model: Any, sd: dict[str, float]) -> Any:
        """A model's numbers on their way out (tools/inference/numbers_out.VehicleNumbers)."""
        ...

    def compile(self, say: Say, progress: Callable[..., Any] = no_progress) -> None:
        """Compile what a diagnosis calls, unless that was done; progress as in tools/flight/precompile."""
        ...

    def submerged(self, run: Run) -> Run:
        """The run without what was measured out of the water."""
        ...

    def readings(self, case: Case) -> Any:
        """What a case's readings say of each other; InputError where this kind's are not held against each other."""
        ...

    def disagreements(self, case: Case) -> list[str]:
        """Sentences on readings that contradict each other."""
        ...

    def usable_runs(self, runs: Sequence[Run]) -> tuple[dict[int, Run], dict[int, str]]:
        """The runs that a watch can judge by their number, and why the others cannot be."""
        ...

    def speeds(self, problem: Any, learned_from: Any) -> Any:
        """Of watched runs, a function (history, events, run) -> mean speed through the water; None where readings
        give none."""
        ...

    def identify(self, case: Case, seed: int, likelihood: str, say: Say) -> Identified:
        """Identify the case's vehicle."""
        ...

    def diagnose(self, case: Case, reference: Case | None, without: str | None, say: Say) -> Callable[[Path], str]:
        """Diagnose a case; returns what writes answer and report into a folder and returns the verdict's sentence."""
        ...


@cache
def kinds() -> Mapping[str, VehicleKind]:
    """All installed kinds by name."""
    return {entry.name: entry.load() for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name)}


def kind_of(vehicle: Any) -> VehicleKind:
    """The kind of a vehicle, as its file was read."""
    return kinds()[vehicle.kind]


def kind_of_file(text: str, source: str) -> VehicleKind:
    """The kind that a vehicle file names; ConfigError where it is not installed. What is no TOML its reader refuses."""
    try:
        named = tomllib.loads(text).get("kind", UNNAMED)
    except (ValueError, RecursionError):
        named = UNNAMED
    if not isinstance(named, str) or named not in kinds():
        raise ConfigError(source, f"no kind of vehicle {named!r}; installed: {', '.join(kinds())}", key="kind")
    return kinds()[named]


def shipped_vehicles() -> dict[str, str]:
    """The vehicle files of all kinds, text by name."""
    return {name: text for kind in kinds().values() for name, text in kind.shipped().items()}
