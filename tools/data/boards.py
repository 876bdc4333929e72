"""Board files, found by name or path; what is in one beyond its kind, that kind's reader says."""

from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Annotated

import msgspec

from glider.hal.board import board_kinds
from glider.hal.strict import ConfigError, decode
from glider.tools.data.errors import InputError
from glider.tools.data.sources import read_text


class BoardKind(msgspec.Struct):
    """The one key that every board file has; the rest is its kind's."""

    kind: Annotated[str, msgspec.Meta(min_length=1, max_length=100)]


@dataclass
class BoardFile:
    """A board file's text, where it came from, and its kind."""

    text: str
    source: str
    kind: str


def load_board_file(wanted: str) -> BoardFile:
    """A board by shipped name ("sim") or path."""
    folders = [files("glider.sim_backend").joinpath("boards"), files("glider.hal").joinpath("boards")]
    shipped = [file for folder in folders if (file := folder.joinpath(f"{wanted}.toml")).is_file()]
    if shipped and "/" not in wanted:
        text, source = shipped[0].read_text(encoding="utf-8"), f"{wanted} (shipped)"
    elif Path(wanted).is_file():
        text, source = read_text(Path(wanted)), wanted
    else:
        names = sorted(
            entry.name.removesuffix(".toml") for folder in folders for entry in folder.iterdir() if "." in entry.name
        )
        raise InputError(f"no board '{wanted}': neither a file nor one of {', '.join(names)}")
    kind = decode(text, BoardKind, source).kind
    if kind not in board_kinds():
        raise ConfigError(source, f"no board of kind '{kind}'; installed: {', '.join(board_kinds())}", key="kind")
    return BoardFile(text, source, kind)
