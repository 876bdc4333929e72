"""What to do now: the repairs to check, the numbers to enter in the vehicle file, or the run to fly next."""

import tomllib
from importlib.resources import files
from typing import Any
from urllib.parse import quote

from glider.tools.diagnose.record import DiagnosisRecord, number
from glider.tools.report import words

MOST_CHECKS = 4
LEAST_CHECKED = 0.1  # probability from which a cause that is not certain is worth a look at the vehicle


def checks() -> dict[str, str]:
    """By label of the catalogue, what to check on the vehicle: the gallery of causes has the same sentences."""
    return tomllib.loads(files("glider.tools.diagnose").joinpath("checks.toml").read_text(encoding="utf-8"))


def steps(record: DiagnosisRecord) -> dict[str, Any]:
    """What the section `What to do now` says: identify, checks, enter, open (why a run is needed), nothing."""
    answer = record.answer
    identify, why = words.guessed(record), _open(record)
    suspected = [
        cause.label for cause in answer.causes
        if cause.probability >= LEAST_CHECKED and cause.label in checks() and cause.label not in answer.selected
    ] if why else []  # fmt: skip
    alike = [label for label in answer.cause(answer.main).group if label in checks()] if answer.selected else []
    labels = list(dict.fromkeys([*answer.selected, *alike, *suspected]))[:MOST_CHECKS]
    found = {
        "identify": identify, "open": why, "enter": _enter(record), "nothing": "",
        "checks": [
            {"label": label, "text": checks()[label], "what": "" if label in answer.selected else "as well for "}
            for label in labels
        ],
    }  # fmt: skip
    if not (identify or why or labels):
        floor = words.number(number(answer.gap.floor["total"]))
        found["nothing"] = (
            f"Nothing to repair or enter: the vehicle file explains these runs. An effect that moves them by less than "
            f"{floor} tolerances would not be seen."
        )
    return found


def _open(record: DiagnosisRecord) -> str:
    """Why another run is needed; "" where the answer is settled."""
    answer = record.answer
    group = [label for label in answer.cause(answer.main).group if label != answer.main]
    if answer.verdict == "unknown":
        return "no effect of the catalogue explains the gap"
    if group:
        return f"these runs cannot distinguish {answer.main} from {words.joined(group)}"
    if answer.causes[0].probability < words.SURE_PROBABILITY:
        return f"the answer is only {words.sure(answer.causes[0].probability)} sure"
    return ""


def _enter(record: DiagnosisRecord) -> list[dict[str, str]]:
    """The rows of numbers to enter, in SI as the file has them."""
    rows = []
    for one in record.answer.enter:
        file, value, low, high = (words.number(number(v)) for v in (one.file, one.value, *one.ci90))
        rows.append({"key": one.key, "file": file, "value": value, "low": low, "high": high,
                     "unit": "" if one.unit == "1" else one.unit})  # fmt: skip
    return rows


def download(mission: str) -> str:
    """A mission file as a link that holds it; "" where there is none."""
    return f"data:application/toml;charset=utf-8,{quote(mission)}" if mission else ""
