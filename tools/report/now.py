"""What to do now: the repairs to check, the numbers to enter in the vehicle file, or the run to fly next."""

import tomllib
from collections.abc import Container, Iterable, Mapping
from importlib.resources import files
from typing import Any
from urllib.parse import quote

from glider.tools.diagnose.record import DiagnosisRecord, Entry, number
from glider.tools.report import words

MOST_CHECKS = 4
OWN_CHECKS = {  # by the family of what a user's vehicle declares
    "input": "Command {name} by known steps on the bench and measure what it does.",
    "output": "Compare the reading of {name} with a second instrument or a known value.",
    "noise": "Look for what shakes the vehicle at {name}: waves, a propeller, a loose part, a control loop that hunts.",
    "parameter": "Look for what changes {name}: parts added, lost, loose or fouled since the vehicle was identified.",
}
LEAST_CHECKED = 0.1  # probability from which a cause that is not certain is worth a look at the vehicle


def checks() -> dict[str, str]:
    """By label of the catalogue, what to check on the vehicle: the gallery of causes has the same sentences."""
    return tomllib.loads(files("glider.tools.diagnose").joinpath("checks.toml").read_text(encoding="utf-8"))


def check_of(label: str, place: tuple[str, str] = ("", "")) -> list[str]:
    """What to check for a label, split at its code: by the place that a user's vehicle declares, or the catalogue's."""
    family, name = place
    said = OWN_CHECKS[family].format(name=name) if family in OWN_CHECKS else checks().get(label, "")
    return said.split("`")


def checks_of(labels: Iterable[str], certain: Container[str], places: Mapping[str, tuple[str, str]]) -> list[dict]:
    """The steps of a page: every label with something to check; places: of labels of a declared vehicle."""
    return [
        {"label": label, "text": text, "certain": label in certain}
        for label in dict.fromkeys(labels) if any(text := check_of(label, places.get(label, ("", ""))))
    ]  # fmt: skip


def steps(record: DiagnosisRecord) -> dict[str, Any]:
    """What the section `What to do now` says: identify, checks, enter, open (why a run is needed), nothing.

    Beside an unknown gap only what the readings show by themselves is certain: other effects are the nearest to it.
    """
    answer, why, known = record.answer, _open(record), checks()
    by_readings = {one.label for one in answer.readings}
    certain = [label for label in answer.selected if answer.verdict != "unknown" or label in by_readings]
    suspected = [one.label for one in answer.causes if one.probability >= LEAST_CHECKED] if why else []
    confounded = answer.cause(answer.main).group if answer.verdict == "cause" else []
    others = dict.fromkeys(label for label in [*confounded, *answer.selected, *suspected] if label in known)
    labels = [*certain, *(label for label in others if label not in certain)][:MOST_CHECKS]
    nothing = ""
    if not (why or labels):
        floor = words.number(number(answer.gap.floor["total"]))
        nothing = (
            "Nothing to repair or enter: the vehicle file explains these runs. An effect that moves them by less than "
            f"{floor} tolerances would not be seen."
        )
    return {
        "identify": answer.identify_first or words.guessed(record), "open": why, "nothing": nothing,
        "unknown": answer.verdict == "unknown", "parts": _parts(answer.next_run.parts),
        "enter": [_row(one) for one in answer.enter if one.label in certain and _moved(one)],
        "checks": checks_of(labels, certain, {}),
    }  # fmt: skip


def _parts(parts: list[str]) -> str:
    """The explanations that the next run distinguishes: by what they differ in, beside what all of them hold."""
    sets = [part.split("+") for part in parts]
    common = [label for label in sets[0] if all(label in one for one in sets)] if len(sets) > 1 else []
    own = ["+".join(label for label in one if label not in common) or "nothing more" for one in sets]
    return ", ".join(own) + (f", each beside {words.joined(common)}" if common else "")


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


def _moved(one: Entry) -> bool:
    """Whether the 90 % interval of a number leaves out what the file has."""
    return not min(map(number, one.ci90)) <= number(one.file) <= max(map(number, one.ci90))


def _row(one: Entry) -> dict[str, str]:
    """A number to enter, in SI as the file has it."""
    file, value, low, high = (words.number(number(v)) for v in (one.file, one.value, *one.ci90))
    unit = "" if one.unit == "1" else one.unit
    return {"key": one.key, "file": file, "value": value, "low": low, "high": high, "unit": unit}


def download(mission: str) -> str:
    """A mission file as a link that holds it; "" where there is none."""
    return f"data:application/toml;charset=utf-8,{quote(mission)}" if mission else ""
