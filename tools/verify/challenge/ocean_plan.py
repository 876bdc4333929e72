"""Which missions of ocean gliders a blind test of `glider gap watch` holds: vehicle, speed log, what changes, when."""

from dataclasses import dataclass

import numpy as np

from glider.tools.verify.challenge.watch_plan import (
    CHANGED,
    EPISODE,
    EVERY_OUTSIDE,
    GROWING,
    OUTSIDE,
    STEP,
    UNCHANGED,
    VehiclePlan,
    WatchCounts,
    draw_span,
)

MISSIONS = WatchCounts(vehicles=60, unchanged=12, runs=40, reference=12)
CRAFTS = ("slocum", "seaglider", "seaexplorer")
# Labels with whether they grow; what does not is a step that stays or an episode, in turn.
CHANGES = (
    ("drag", False), ("drag", True), ("attitude_scale", False), ("net_buoyancy", False), ("density_bias", False),
    ("lift", False),
)  # fmt: skip
# What no label names, a step that stays or an episode in turn (docs/explanation/blind-tests.md): a thruster that helps
# in the upper
# water, a line that something at the surface holds, wings grown over on one side, mud from the sea floor.
OUTSIDE_CHANGES = ("x_thruster", "x_line", "x_fouled_wing", "x_mud")
# The other two glide near their best: less lift moves their depth rate by a few mm/s until there is no glide at all.
LIFT_SHOWS = "seaglider"
# A Slocum's dive is too short to tell a change that no label names from the label that is nearest to it.
OUTSIDE_SHOWS = ("seaglider", "seaexplorer")
STEEP_SHOWS = ("x_fouled_wing",)  # of Seagliders: the flatter glide of the other takes it for a bias of the pitch


@dataclass(frozen=True)
class MissionPlan(VehiclePlan):
    """One mission before anything is drawn for it; runs are its dives."""

    vehicle_class: str = CRAFTS[0]
    speed: bool = False  # whether speed through the water was measured


def ocean_plan(seed: int, counts: WatchCounts) -> list[MissionPlan]:
    """The missions in their order; every other one of each change with speed, vehicles in turn where all show it."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, 11]))
    changed = counts.vehicles - counts.unchanged
    outside = changed // EVERY_OUTSIDE
    drawn: list[tuple[str | None, str | None, bool]] = [(None, None, n % 2 == 1) for n in range(counts.unchanged)]
    for n in range(changed - outside):
        turn, which = divmod(n, len(CHANGES))
        label, grows = CHANGES[which]
        course = GROWING if grows else (STEP, EPISODE)[(turn // 2 + which) % 2]
        drawn.append((label, course, (turn + which) % 2 == 1))
    for n in range(outside):
        turn, which = divmod(n, len(OUTSIDE_CHANGES))
        drawn.append((OUTSIDE_CHANGES[which], (STEP, EPISODE)[(turn + which // 2) % 2], (turn + which) % 2 == 1))
    crafts = [CRAFTS[n % len(CRAFTS)] for n in rng.permutation(len(drawn))]
    crafts = [
        LIFT_SHOWS if label == "lift" else vehicle_class
        for vehicle_class, (label, _, _) in zip(crafts, drawn, strict=True)
    ]
    for n in range(outside):  # the last that were drawn
        shows = OUTSIDE_SHOWS[:1] if drawn[n - outside][0] in STEEP_SHOWS else OUTSIDE_SHOWS
        crafts[n - outside] = shows[(n + n // len(OUTSIDE_CHANGES)) % len(shows)]
    plans = []
    for number, n in enumerate(rng.permutation(len(drawn))):
        label, course, speed = drawn[n]
        first, last = (None, None) if course is None else draw_span(rng, course, counts.judged)
        kind = UNCHANGED if label is None else OUTSIDE if label in OUTSIDE_CHANGES else CHANGED
        plans.append(MissionPlan(number, kind, label, course, first, last, False, crafts[n], speed))
    return plans
