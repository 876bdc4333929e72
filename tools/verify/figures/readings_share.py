"""How often `glider gap readings` finds what is wrong, and flags what is not: cases of the blind test's own drawing.

    python -m glider.tools.verify.figures.readings_share --seed 91001 --none 100 --each 10

A label's cases are drawn as in `gap challenge make`: half weak, half strong, flown in the foreign plant.
"""

import tempfile
from collections import Counter
from functools import partial
from pathlib import Path

import click

from glider.tools.cli.common import progress
from glider.tools.data.runs.case import load_case
from glider.tools.data.sources import load_vehicle
from glider.tools.readings.check import check
from glider.tools.study.workers import work_here
from glider.tools.verify.challenge.cases import NoCase, draw_case, write
from glider.tools.verify.challenge.make import VEHICLE
from glider.tools.verify.challenge.plan import NONE, SINGLE, CasePlan

BY_CAPTURE = (
    "mocap_delay", "clock_skew", "imu_pitch_bias", "imu_roll_bias", "compass", "attitude_scale", "depth_offset",
    "depth_scale", "depth_lag", "pressure_lever",
)  # fmt: skip
BY_ITSELF = ("gyro_scale", "gyro_bias", "attitude_lag")  # of motion capture's and of a lake's cases
NOT_DRAWN = "not drawn"
NOT_FLYING = "not_flying"  # no fault of an instrument


def plans(none: int, each: int) -> list[CasePlan]:
    """The cases without a gap, half of them in a lake, then `each` of every label and site."""
    found = [CasePlan(n, NONE, (), (), mocap=n % 2 == 0) for n in range(none)]
    wanted = [(label, True) for label in (*BY_CAPTURE, *BY_ITSELF)] + [(label, False) for label in BY_ITSELF]
    for label, mocap in wanted:
        for n in range(each):
            found.append(CasePlan(len(found), SINGLE, (label,), (n % 2 == 0,), mocap))
    return found


def flagged(seed: int, plan: CasePlan) -> tuple[str, ...]:
    """A case drawn and its readings checked: the label of each finding, its kind where it has none."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        try:
            write(draw_case(seed, plan, load_vehicle(VEHICLE)), folder / "cases", folder / "held")
        except NoCase:
            return (NOT_DRAWN,)
        found = check(load_case(folder / "cases" / plan.name).runs).findings
    return tuple(one.label or f"{one.finding} of {one.channel}" for one in found if one.finding != NOT_FLYING)


def table(answers: dict[CasePlan, tuple[str, ...]]) -> list[str]:
    """Lines: cases without a gap and what was flagged in them, then each label's share by site and strength."""
    drawn = {plan: found for plan, found in answers.items() if found != (NOT_DRAWN,)}
    clean = [found for plan, found in drawn.items() if plan.kind == NONE]
    lines = [f"without a gap: {len(clean)} cases, flagged in {sum(map(bool, clean))}: {_counted(clean)}"]
    groups: dict[tuple[str, bool], list[CasePlan]] = {}
    for plan in drawn:
        if plan.kind == SINGLE:
            groups.setdefault((plan.labels[0], plan.mocap), []).append(plan)
    for (label, mocap), group in groups.items():
        weak = [label in drawn[plan] for plan in group if plan.weak[0]]
        strong = [label in drawn[plan] for plan in group if not plan.weak[0]]
        others = [tuple(one for one in drawn[plan] if one != label) for plan in group]
        lines.append(
            f"{label}, {'motion capture' if mocap else 'lake'}: weak {sum(weak)} of {len(weak)}, "
            f"strong {sum(strong)} of {len(strong)}; beside it: {_counted(others)}"
        )
    return lines


def _counted(found: list[tuple[str, ...]]) -> str:
    counts = Counter(label for labels in found for label in set(labels))
    return ", ".join(f"{label} {count}" for label, count in counts.most_common()) or "nothing"


@click.command()
@click.option("--seed", required=True, type=click.IntRange(0))
@click.option("--none", default=100, show_default=True, type=click.IntRange(0), help="Cases without a gap.")
@click.option("--each", default=10, show_default=True, type=click.IntRange(0), help="Cases of each label and site.")
@click.option("--jobs", default=0, show_default=True, type=click.IntRange(0), help="Processes; 0: one a core.")
def main(seed: int, none: int, each: int, jobs: int) -> None:
    """The share of each label that its own cases show, and accusations where nothing is wrong."""
    todo = plans(none, each)
    answers = {}
    with progress("cases", len(todo)) as advance:
        for plan, found in work_here(partial(flagged, seed), todo, jobs):
            answers[plan] = found
            advance(1)
    for line in table({plan: answers[plan] for plan in todo}):
        click.echo(line)


if __name__ == "__main__":
    main()
