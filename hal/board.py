"""The board registry: boards announce themselves as entry points, so nothing is chosen when a module is imported."""

from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.metadata import entry_points
from typing import Any

from glider.hal.ports import Board, BoardError

GROUP = "glider.boards"


@dataclass(frozen=True)
class BoardRequest:
    """What a board is built from: its file's text, the vehicle it carries, and what concerns simulation only."""

    text: str
    source: str
    vehicle: Any
    seed: int = 0
    realtime: bool = False
    site_depth: float = 0.0  # m; 0: unknown
    water_density: float = 998.2  # kg/m3, by which net ballast mass is plunger travel
    effects: dict[str, dict[str, float]] = field(default_factory=dict)


def board_kinds() -> list[str]:
    """Names of the kinds of boards that are installed."""
    return sorted({entry.name for entry in entry_points(group=GROUP)})


def board_builder(kind: str) -> Callable[[BoardRequest], Board]:
    """The function that builds a board of this kind; BoardError if no installed package has one."""
    for entry in entry_points(group=GROUP):
        if entry.name == kind:
            return entry.load()
    raise BoardError(f"no board of kind '{kind}'; installed: {', '.join(board_kinds()) or 'none'}")
