"""Diagnoses of a blind test gathered and scored: sealed answers, what was said, and how far it closes the gap."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from glider.tools.data.errors import InputError
from glider.tools.data.runs.case import load_case_of_run
from glider.tools.data.runs.run import Run
from glider.tools.gap.measure import root_mean_square, run_gap
from glider.tools.inference.channels import ROUGHIE_MEASURES
from glider.tools.inference.load import load_model
from glider.tools.inference.model import NOMINAL
from glider.tools.inference.predict import as_run, predict
from glider.tools.verify.challenge.diagnosis import FILE, MODEL, TIMING, read_diagnosis
from glider.tools.verify.challenge.score import ChallengeScore, ScoredCase, score
from glider.tools.verify.challenge.seal import (
    MANIFEST,
    OF_A_DIAGNOSIS,
    Answers,
    check_seal,
    folder_digest,
    open_answers,
    read_manifest,
)
from glider.tools.verify.challenge.trial import total

LEAST_CLOSABLE_SHARE = 0.02
C = TypeVar("C")  # a case with what was said to it


def case_folders(cases: Path) -> tuple[Path, Path]:
    """The folders of the cases and of their held flights: DIR/cases and DIR/held, or DIR and held beside it."""
    if not cases.is_dir():
        raise InputError("no such folder", source=cases)
    if (cases / "cases").is_dir():
        return cases / "cases", cases / "held"
    return cases, cases.parent / "held"


def open_sealed(
    path: Path, manifest: Path | None, cases: Path, held: Path, needed: tuple[str, ...] = OF_A_DIAGNOSIS,
    wanted: bool = True, others: tuple[Path, ...] = (),
) -> Answers:  # fmt: skip
    """The answers, checked against the manifest if there is one: their own hash and those of the cases.

    wanted: whether the flights in `held` are, too: where nothing is flown on them, they need not be there. An
    archive without a manifest is an InputError: nobody could tell when it was written. others: further folders in which
    each case has runs.
    """
    answers = open_answers(path, needed)
    if answers.sha256 is None:
        return answers
    if manifest is None or not manifest.is_file():
        raise InputError("no manifest beside the cases to check the answers against", source=manifest or path)
    check_seal(answers, manifest)
    for name, declared in read_manifest(manifest).get("cases", {}).items():
        for kind, folder in (("cases", cases / name), *((one.name, one / name) for one in (held, *others))):
            if kind not in declared:
                raise InputError(f"the manifest is not of cases with '{kind}'", source=manifest)
            if kind == held.name and not wanted:
                continue
            if not folder.is_dir():
                raise InputError("the manifest names it, but it is not there", source=folder)
            if folder_digest(folder) != declared[kind]:
                raise InputError("not the case that the manifest declares: its files have changed", source=folder)
    return answers


def gather(
    answers: Answers, folder: Path, partial: bool, file: str, read: Callable[[Path], Any], case_of: Callable[..., C],
    advance: Callable[[int], None] = lambda n: None,
) -> list[C]:  # fmt: skip
    """What was said to every case; with `partial`, only to those answered. InputError where nothing was said at all.

    file: of an answer, in the folder of its case; read: reads it; case_of: takes name, truth and what was said.
    """
    if not folder.is_dir():
        raise InputError("no such folder", source=folder)
    found, answered = [], False
    for name, truth in sorted(answers.cases.items()):
        path, timing = folder / name / file, folder / name / TIMING
        said = read(path) if path.is_file() else None
        if said is not None or not partial:
            found.append(case_of(name, truth, said, seconds=_seconds(timing) if timing.is_file() else None))
            answered = answered or said is not None
        advance(1)
    if not answered:
        raise InputError(f"no {file} of any case in its folders", source=folder)
    return found


def _seconds(path: Path) -> float:
    try:
        return float(json.loads(path.read_bytes())["seconds"])
    except (ValueError, KeyError, TypeError):
        raise InputError("no number 'seconds' in it", source=path) from None


def predicted_total(path: Path, model: str | Path, vehicle: Path | None = None) -> float:
    """Total gap of a run file as `glider gap predict` predicts it with a model; vehicle: in the place of the case's."""
    case, recorded = load_case_of_run(path, None if vehicle is None else str(vehicle))
    Y = predict(case, load_model(str(model), case), [recorded])[0]
    return run_total(recorded, as_run(recorded, Y))


def run_total(measured: Run, predicted: Run) -> float:
    """Total gap of a prediction in run data: rms over its channels."""
    table = ROUGHIE_MEASURES.measured(predicted)
    return run_gap(ROUGHIE_MEASURES, measured, table, ROUGHIE_MEASURES.windows(measured.t)).total


def runs_of(folder: Path) -> list[Path]:
    """The run files of a case's folder; InputError where there are none."""
    runs = sorted(folder.glob("run*.csv*"))
    if not runs:
        raise InputError("no held runs of this case", source=folder)
    return runs


def closed_share(case: ScoredCase, held: Path, diagnoses: Path) -> float | None:
    """(before - after) / (before - perfect), totals over the held runs; 0 where there is no corrected model.

    None where a perfect model closes next to nothing (LEAST_CLOSABLE_SHARE of the gap), so that the share means
    nothing.

    before and after are `glider gap predict`'s with the nominal and with the corrected model, perfect is the sealed
    answer's, from true starts.
    """
    model = diagnoses / case.name / MODEL
    runs = runs_of(held / case.name)
    if case.said is None or not model.is_file():
        return 0.0
    before, perfect = held_total(runs, NOMINAL), total(case.truth["oracle"][case.truth["runs"] :])
    if before - perfect < LEAST_CLOSABLE_SHARE * before:
        return None
    after = held_total(runs, model)
    return (before - after) / (before - perfect)


def held_total(runs: list[Path], model: str | Path, vehicle: Path | None = None) -> float:
    """A model's total gap over runs: rms of theirs."""
    return root_mean_square([predicted_total(path, model, vehicle) for path in runs])


def manifest_beside(cases: Path) -> Path | None:
    """The manifest in or beside a folder of cases, if there is one."""
    return next((path for path in (cases / MANIFEST, cases.parent / MANIFEST) if path.is_file()), None)


def judge(
    cases: Path,
    answers: Path,
    diagnoses: Path,
    *,
    manifest: Path | None = None,
    partial: bool = False,
    closing: bool = True,
    advance: Callable[[int], None] = lambda n: None,
) -> ChallengeScore:
    """Open, check and score; closing: fly the corrected models on the held runs too, which takes the time."""
    folders = case_folders(cases)
    opened = open_sealed(answers, manifest or manifest_beside(cases), *folders, wanted=closing)
    found = gather(opened, diagnoses, partial, FILE, read_diagnosis, ScoredCase)
    for case in found:
        if closing and case.predictable:
            case.closed = closed_share(case, folders[1], diagnoses)
        advance(1)
    return score(found)
