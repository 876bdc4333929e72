"""docs/reference/effects.md says of every label what the catalogue says, docs/reference/gap.md where it belongs."""

import re
from pathlib import Path

import pytest

from docs import gallery
from glider.sim_backend.core.effects.catalogue import catalogue

DOCS = Path(__file__).parents[3] / "docs"
TEXT = (DOCS / "reference" / "effects.md").read_text(encoding="utf-8")
ROWS = {line.split("|")[2].strip(): line for line in TEXT.splitlines() if line.startswith("|") and "---" not in line}


def row(label: str) -> str:
    """The line of the table that the catalogue asks for."""
    effect = catalogue()[label]
    parameters = []
    for p in effect.parameters:
        default = f", default {p.default:g}" if p.default else ""
        parameters.append(f"`{p.name}` {p.unit}: {p.low:.4g} to {p.high:.4g}; {p.spread:g}{default}")
    summary = effect.summary.replace("|", r"\|")
    return f"| {effect.subsystem} {effect.element} | {label} | {'<br>'.join(parameters)} | {summary} |"


@pytest.mark.parametrize("label", catalogue())
def test_the_table_has_the_labels_line(label):
    assert ROWS.get(label) == row(label)


def test_the_table_has_no_other_label():
    assert set(ROWS) - {"label"} == set(catalogue())


def test_every_label_is_said_to_change_something():
    assert all(len(effect.summary) > 10 for effect in catalogue().values())


def test_the_words_of_the_gap_have_every_label_in_its_place():
    table = (
        (DOCS / "reference" / "gap.md").read_text(encoding="utf-8").partition("## Words")[2].partition("## Windows")[0]
    )
    found, subsystem = {}, ""
    for line in [line for line in table.splitlines() if line.startswith("|")][2:]:
        first, elements, labels = (cell.strip() for cell in line.strip("|").split("|"))
        subsystem = first or subsystem
        places = [(subsystem, element) for element in elements.split(", ")]
        groups = labels.split("; ") if subsystem == "timing" else labels.split(", ") if len(places) > 1 else [labels]
        for place, group in zip(places, groups, strict=True):
            found |= dict.fromkeys(re.findall(r"`(\w+)`", group), place)
    assert found == {label: (effect.subsystem, effect.element) for label, effect in catalogue().items()}


def test_the_gallery_says_of_every_label_what_to_check():
    """`python docs/gallery.py` writes the table."""
    assert set(gallery.checks()) == set(catalogue())
    assert gallery.with_table(gallery.PAGE.read_text(encoding="utf-8")) == gallery.PAGE.read_text(encoding="utf-8")
