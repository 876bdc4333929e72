"""Diagnoses of vehicles of another form scored: the causes, how far the change was closed, and the identification."""

from collections.abc import Callable
from pathlib import Path

from glider.tools.inference.model import NOMINAL
from glider.tools.verify.challenge.diagnosis import FILE, MODEL, read_diagnosis
from glider.tools.verify.challenge.form_make import HEALTHY
from glider.tools.verify.challenge.judge import (
    LEAST_CLOSABLE_SHARE,
    case_folders,
    gather,
    held_total,
    manifest_beside,
    open_sealed,
    runs_of,
)
from glider.tools.verify.challenge.score import ChallengeScore, ScoredCase, score_forms
from glider.tools.verify.challenge.watch_answer import IDENTIFIED, REFERENCE, VEHICLE_FILE


def closed_change(held: list[Path], healthy: float, vehicle: Path, model: Path) -> float | None:
    """(before - after) / (before - healthy), total gaps.

    before: of the identified vehicle over the changed held runs; after: of the corrected model on top of it; healthy:
    of the identified vehicle over healthy runs.

    0 without a corrected model; None where the change adds next to nothing (LEAST_CLOSABLE_SHARE of the gap).
    """
    before = held_total(held, NOMINAL, vehicle)
    if before - healthy < LEAST_CLOSABLE_SHARE * before:
        return None
    return (before - held_total(held, model, vehicle)) / (before - healthy) if model.is_file() else 0.0


def judge_forms(
    cases: Path, answers: Path, diagnoses: Path, *, manifest: Path | None = None, partial: bool = False,
    closing: bool = True, advance: Callable[[int], None] = lambda n: None,
) -> ChallengeScore:  # fmt: skip
    """Open, check and score; closing: fly identified and corrected models on the runs left out too."""
    folder, held = case_folders(cases)
    healthy = folder.parent / HEALTHY
    others = (folder.parent / REFERENCE, healthy)
    opened = open_sealed(answers, manifest or manifest_beside(cases), folder, held, wanted=closing, others=others)
    found, gaps = gather(opened, diagnoses, partial, FILE, read_diagnosis, ScoredCase), []
    for case in found:
        if closing:
            pair = judge_identified(case, healthy, diagnoses)
            if pair is None:
                case.closed = 0.0 if case.predictable else None
            else:
                gaps.append(pair)
                if case.predictable:
                    vehicle = diagnoses / case.name / IDENTIFIED / VEHICLE_FILE
                    runs, model = runs_of(held / case.name), diagnoses / case.name / MODEL
                    case.closed = closed_change(runs, pair[1], vehicle, model)
        advance(1)
    return score_forms(found, gaps)


def judge_identified(case: ScoredCase, healthy: Path, diagnoses: Path) -> tuple[float, float] | None:
    """Total gaps of the file's and of the identified vehicle over healthy runs left out; None without a vehicle."""
    vehicle = diagnoses / case.name / IDENTIFIED / VEHICLE_FILE
    if not vehicle.is_file():
        return None
    runs = runs_of(healthy / case.name)
    return held_total(runs, NOMINAL), held_total(runs, NOMINAL, vehicle)
