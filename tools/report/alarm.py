"""The alarm of an identification: what got worse, what the fit explains by noise, what the runs do not determine."""

from collections.abc import Mapping, Sequence
from typing import Any

from glider.tools.report import words

WORSE_RATIO = 1.05  # of a gap of runs left out, after over before: smaller differences are within what runs scatter
NOISE_FACTOR = 3.0  # times the case's own noise, from which more than noise is explained by it


def alarms(
    held: Mapping[str, Any] | None, noise: Mapping[str, float], notes: Sequence[str], open_directions: Sequence[str]
) -> list[dict[str, str]]:
    """What a reader has to know before the table of numbers: `head` and `text` of each, the gravest first.

    Args:
        held: gaps of runs left out as identified.json has them (`before`, `after`, `regimes`), in tolerances; or None.
        noise: by source of noise, the factor that was fitted over what the case says.
        notes: what the identification itself notes.
        open_directions: sentences about combinations that stay wide.
    """
    found = []
    if held is None:
        found.append({"head": "Not checked", "text": "No run was left out: nothing here is checked on other data."})
    else:
        worse = _worse("", held["before"], held["after"])
        for regime, one in held.get("regimes", {}).items():
            worse += _worse(f"{regime}, ", one["before"], one["after"])
        if worse:
            text = f"On runs left out the vehicle that is handed out is worse than the file in {'; '.join(worse)}."
            found.append({"head": "Worse", "text": text})
    found += [{"head": "Note", "text": words.upper(f"{text.removesuffix('.')}.")} for text in notes]
    large = [f"{name} {words.number(factor)} times" for name, factor in noise.items() if factor >= NOISE_FACTOR]
    if large:
        found.append({"head": "Noise", "text": (
            f"The fit needs more noise than the case says: {words.joined(large)}. It explains so what the vehicle's "
            "form or a reading leaves; the intervals hold only as far as that is random."
        )})  # fmt: skip
    if open_directions:
        found.append({"head": "Not determined", "text": " ".join(open_directions)})
    return found


def _worse(where: str, before: Mapping[str, float], after: Mapping[str, float]) -> list[str]:
    return [
        f"{where}{name} ({words.number(before[name])} to {words.number(after[name])} tolerances)"
        for name in after
        if name in before and after[name] > WORSE_RATIO * before[name]
    ]
