"""docs/EFFECTS.md says of every label what the catalogue says."""

from pathlib import Path

import pytest

from sim_backend.effects.catalogue import catalogue

TEXT = (Path(__file__).parents[3] / "docs" / "EFFECTS.md").read_text(encoding="utf-8")
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
