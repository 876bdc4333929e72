"""How steady a diagnosis is: copies with a millionth of each reading's noise added.

See docs/explanation/diagnosis.md, Steady.

    python -m glider.tools.verify.figures.steady CASE... --copies 4 --seed 1

Prints, for each case, the largest move of a probability and of which entry, whether verdict and `selected` stayed, and
the largest move of a stage's gap.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import click
import numpy as np

from glider.tools.cli.common import progress
from glider.tools.data.runs.case import Case, load_case
from glider.tools.diagnose.diagnosis import diagnose
from glider.tools.inference.kinds import kind_of

NOISE_SHARE = 1e-6  # of a reading's noise


@dataclass(frozen=True)
class Said:
    """What is compared of a diagnosis."""

    verdict: str
    selected: frozenset[str]
    probabilities: dict[str, float]
    stages: dict[str, float]  # gap, tolerances


def moved(case: Case, seed: int) -> Case:
    """A copy of the case, every reading moved by NOISE_SHARE of its noise."""
    rng, runs = np.random.default_rng(seed), []
    for run in case.runs:
        columns = dict(run.columns)
        for reading in kind_of(case.vehicle).readings:
            if reading.column in columns:
                sigma = NOISE_SHARE * getattr(case.sensors, reading.source).noise
                values = columns[reading.column]
                columns[reading.column] = values + sigma * rng.standard_normal(len(values))
        runs.append(replace(run, columns=columns))
    return replace(case, runs=runs)


def said(case: Case) -> Said:
    """The diagnosis of a case."""
    found = diagnose(case)
    return Said(found.verdict, frozenset(found.answer.selected), found.answer.probabilities,
                {stage.name: stage.total for stage in found.stages})  # fmt: skip


def largest_move(one: Said, other: Said) -> tuple[str, float]:
    """The entry whose probability differs most, and by how much."""
    names = {*one.probabilities, *other.probabilities}
    apart = {name: abs(one.probabilities.get(name, 0.0) - other.probabilities.get(name, 0.0)) for name in names}
    name = max(sorted(apart), key=lambda name: apart[name])
    return name, apart[name]


def largest_stage_move(one: Said, other: Said) -> tuple[str, float]:
    """The stage whose gap differs most, and by what share of it."""
    apart = {name: abs(other.stages.get(name, np.inf) / gap - 1.0) for name, gap in one.stages.items()}
    name = max(sorted(apart), key=lambda name: apart[name])
    return name, apart[name]


def line(name: str, own: Said, copies: list[Said]) -> str:
    """What a case's copies came to."""
    label, far = max((largest_move(own, copy) for copy in copies), key=lambda found: found[1])
    stage, share = max((largest_stage_move(own, copy) for copy in copies), key=lambda found: found[1])
    verdicts = sum(copy.verdict != own.verdict for copy in copies)
    selected = sum(copy.selected != own.selected for copy in copies)
    return (
        f"{name}: {len(copies)} copies, {own.verdict} {own.probabilities.get(label, 0.0):.3f} {label} moves by "
        f"{far:.2g}; another verdict {verdicts}, others selected {selected}; "
        f"gap of stage {stage} moves by {share:.2%}"
    )


@click.command()
@click.argument("cases", nargs=-1, required=True, type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--copies", default=2, show_default=True)
@click.option("--seed", default=1, show_default=True, help="Of the first copy; the next ones follow.")
def main(cases: tuple[Path, ...], copies: int, seed: int) -> None:
    """How far answers move."""
    with progress("cases", len(cases)) as advance:
        for folder in cases:
            case = load_case(folder)
            found = [said(moved(case, seed + n)) for n in range(copies)]
            click.echo(line(folder.name, said(case), found))
            advance(1)


if __name__ == "__main__":
    main()
