"""Prose held by one file a report: tests/data/golden/NAME. Reworded on purpose, it is written anew by
`GOLDEN=write pytest TEST`, and its difference read."""

import os
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "data" / "golden"


def check_golden(name: str, text: str) -> None:
    """The text is the file's."""
    path = FOLDER / name
    if os.environ.get("GOLDEN") == "write":
        FOLDER.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
    assert text == path.read_text(encoding="utf-8")
