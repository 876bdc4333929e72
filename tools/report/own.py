"""The report of a diagnosis of a user's vehicle, drawn from its diagnosis.json."""

import json
from pathlib import Path
from typing import Any

from glider.tools.data.errors import InputError
from glider.tools.data.files import write_bytes
from glider.tools.own.diagnose import ANSWER, NONE, UNKNOWN, sentence
from glider.tools.report import words
from glider.tools.report.now import checks_of
from glider.tools.report.page import REPORT, render

MOST_RANKED, LEAST_PROBABILITY = 8, 0.005
MEANS = {NONE: "nothing that healthy runs have not", UNKNOWN: "more than healthy runs leave, and no label explains it"}


def _cells(gap: dict[str, Any], name: str) -> list[str]:
    values = (gap[key].get(name) for key in ("before", "recalibrated", "after", "floor"))
    return ["-" if value is None else words.number(value) for value in values]


def own_report_html(answer: dict[str, Any]) -> str:
    """The page's text; MissingExtra without jinja2."""
    gap, places = answer["gap"], {one["element"]: one["subsystem"] for one in answer["where"]}
    highest = max(gap["before"]["total"], gap["after"]["total"], 1e-9)
    stages = [("identified", gap["before"]["total"])]
    if answer["selected"]:
        stages.append((" ".join(f"+ {label}" for label in answer["selected"]), gap["after"]["total"]))
    sizes = [
        {"name": label, "value": words.number(size["estimate"]), "low": words.number(size["ci90"][0]),
         "high": words.number(size["ci90"][1]), "unit": "" if size["unit"] == "1" else size["unit"]}
        for cause in answer["causes"] for label, size in cause["parameters"].items()
        if label in answer["selected"] or label == answer["causes"][0]["label"]
    ]  # fmt: skip
    confounded = answer["causes"][0]["group"] if answer["verdict"] == "cause" else []
    context = {
        "which": "the case's runs", "blind": False, "runs": "run",
        "asked": "Probabilities of the main change from the identified vehicle.",
        "floor": "what the identified vehicle leaves of healthy runs", "case": answer["case"],
        "verdict": answer["verdict"], "sentence": words.upper(sentence(answer)) + ".",
        "ranking": [
            {"label": one["label"], "percent": 100.0 * one["probability"],
             "shown": words.small_percent(one["probability"]),
             "means": MEANS.get(one["label"]) or f"of the {' '.join(_place(one['label'], places))}"}
            for n, one in enumerate(answer["causes"][:MOST_RANKED]) if one["probability"] >= LEAST_PROBABILITY or n < 3
        ],
        "sizes": sizes, "cautions": [words.upper(line) for line in answer["cautions"]], "skipped": {},
        "stages": [
            {"name": name, "total": words.number(total), "percent": 100.0 * total / highest} for name, total in stages
        ],
        "table": [{"name": name, "cells": _cells(gap, name)} for name in gap["before"]],
        "steps": checks_of(
            [*answer["selected"], *confounded], answer["selected"],
            {label: _place(label, places) for label in [*answer["selected"], *confounded]},
        ),
        "next_run": "",
    }  # fmt: skip
    return render("pooled.html", context).replace(" %", "\N{NO-BREAK SPACE}%")


def _place(label: str, places: dict[str, str]) -> tuple[str, str]:
    """Family and name that a label is of: the longest declared name that it begins with."""
    names = [name for name in places if label == name or label.startswith(f"{name}_")]
    name = max(names, key=len, default=label)
    return places.get(name, "vehicle"), name


def write_own_report(folder: Path) -> str:
    """Draw the report of a diagnosis of a user's vehicle from its folder, into it; the verdict, in a sentence."""
    path = folder / ANSWER
    try:
        answer = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(str(error), source=path) from None
    write_bytes(folder / REPORT, own_report_html(answer).encode("utf-8"))
    return sentence(answer)
