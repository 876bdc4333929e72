"""Watches of ocean gliders' missions against the truth: the figures of any watch, what acts alike, the velocity."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from glider.tools.data.errors import InputError
from glider.tools.data.intervals import NINETY
from glider.tools.data.plain import read_json
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.csvfile import read_table
from glider.tools.data.runs.run import run_name
from glider.tools.verify.challenge.score import share
from glider.tools.verify.challenge.watch_answer import MEANS, VELOCITY
from glider.tools.verify.challenge.watch_plan import CHANGED
from glider.tools.verify.challenge.watch_score import NEEDED, Watched, WatchScore, gather_watches, score_watches

NEEDED_OF_A_MISSION = (*NEEDED, "speed", "horizontal_mm_s", "every_s")
ON_DEPTH_ALONE = frozenset({"drag", "lift", "attitude_scale"})  # act alike where no speed was measured
ALWAYS_CONFOUNDED = frozenset({"net_buoyancy", "density_bias"})  # a density read wrong is a weight
MODELLED = 0.1  # m/s, 1 sigma: where the velocity says more of itself it says that it does not know


def twins(truth: dict[str, Any]) -> frozenset[str]:
    """The labels that no reading of this mission could tell from its own."""
    label = truth["label"]
    if label in ON_DEPTH_ALONE and not truth["speed"]:
        return ON_DEPTH_ALONE
    return ALWAYS_CONFOUNDED if label in ALWAYS_CONFOUNDED else frozenset({label})


def grouped(case: Watched) -> bool | None:
    """Whether what acts alike on depth alone is said to; None where speed was measured, or something else is named."""
    if case.truth["speed"] or case.main is None or case.main.label not in ON_DEPTH_ALONE:
        return None
    return {case.main.label, *case.main.group} >= ON_DEPTH_ALONE


class MeanSaid(msgspec.Struct):
    """Of a dive's mean horizontal speed, m/s."""

    u_m_s: float
    ci90: tuple[float, float]


class MeansSaid(msgspec.Struct):
    """A velocity.json."""

    runs: dict[str, MeanSaid] = {}


def speeds_held(case: Watched, folder: Path) -> list[bool]:
    """Of each watched dive without a change, whether its mean true horizontal speed is within the 90 % interval."""
    means = read_json(folder / MEANS, MeansSaid).runs if (folder / MEANS).is_file() else {}
    held = []
    for n, true in enumerate(case.truth["horizontal_mm_s"]):
        if case.changed[n]:
            continue
        files = sorted(folder.glob(f"run{n:02d}*.csv*")) + sorted(folder.glob(f"run{n:03d}*.csv*"))
        if not files:
            raise InputError(f"no velocity of run {n}", source=folder)
        said = means.get(run_name(files[0]))
        held.append(_mean_held(files[0], 1e-3 * np.array(true), float(case.truth["every_s"]), said))
    return held


def _mean_held(path: Path, true: np.ndarray, every: float, said: MeanSaid | None) -> bool:
    """Whether the mean of true speeds, one every so many s, where a velocity file is modelled, is in its interval.

    That is the one said of the mean; where nothing is said of it, 1.645 mean standard deviations of the rows.
    """
    table = read_table(path)
    t, u, sd = (table.numbers(name) for name in (names.TIME, "u_m_s", "sd_u_m_s"))
    good = np.isfinite(sd) & (sd < MODELLED)
    at = np.interp(t[good], every * np.arange(len(true)), true)
    if said is not None:
        return bool(said.ci90[0] <= np.mean(at) <= said.ci90[1])
    miss = float(np.mean(u[good] - at))
    return abs(miss) <= NINETY * float(np.mean(sd[good]))


def score_missions(cases: Sequence[Watched], held: Sequence[bool]) -> WatchScore:
    """Every figure over the missions; held: of each dive asked, whether its speed is in its interval."""
    found = score_watches(cases)
    known = [case for case in cases if case.kind == CHANGED]
    confounded = [case.main is not None and case.main.label in twins(case.truth) for case in known]
    parted = [mark for mark in (grouped(case) for case in cases) if mark is not None]
    own = [
        share("label_or_twin", "label right first, or one that acts alike", 0.90, confounded),
        share("one_group", "lift, drag, pitch scale one group on depth", 0.95, parted),
        share("velocity", "dives' speed within its 90 % interval", 0.85, held),
        share("velocity_most", "the same, not too often", 0.95, held, True),
    ]
    return WatchScore(found.cases, [*found.figures[:-1], *own, found.figures[-1]])


def judge_missions(cases: Path, answers: Path, said: Path, **how: Any) -> WatchScore:
    """Open, check and score what was said to every mission of a blind test's folder; how: as in gather_watches."""
    found = gather_watches(cases, answers, said, NEEDED_OF_A_MISSION, **how)
    held: list[bool] = []
    for case in found:
        if case.said is not None:
            held += speeds_held(case, said / case.name / VELOCITY)
    return score_missions(found, held)
