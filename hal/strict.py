"""Strict reading of TOML: every unknown, missing, wrong-typed, non-finite or out-of-range key is refused by name.

Pure: text in, object out. Who opens files is in `tools`. The error names the source, the line, the key and what was
expected, in one line.
"""

import math
import re
import tomllib
from typing import TYPE_CHECKING, Any, TypeVar

import msgspec

T = TypeVar("T")
MAX_DEPTH = 8
MAX_BYTES = 1_000_000
_AT_LINE = re.compile(r"\(at line (\d+), column (\d+)\)|\(at end of document\)")
_AT_PATH = re.compile(r" - at `(\$[^`]*)`$")
_FIELD = re.compile(r"(unknown|required) field `(.*)`", re.DOTALL)
_HEADER = re.compile(r"^\s*(\[\[?)\s*([^\]]+?)\s*\]\]?\s*(#.*)?$")
_KEY = re.compile(r"""^\s*((?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*'))*)\s*=""")


class ConfigError(ValueError):
    """A file that cannot be used: `source:line: key: what was expected`."""

    def __init__(self, source: str, message: str, *, key: str = "", line: int | None = None):
        self.source, self.key, self.line, self.message = source, key, line, message
        where = f"{source}:{line}" if line else source
        whole = f"{where}: {key}: {message}" if key else f"{where}: {message}"
        # a key may hold any character; the error stays one line
        super().__init__("".join(char if char.isprintable() else repr(char)[1:-1] for char in whole))


if TYPE_CHECKING:
    # msgspec hands `frozen` down to subclasses, a type checker wants it said again at each of them.
    class Table(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
        """As below."""

else:

    class Table(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
        """Base of every table read from a file: no unknown keys, no change after reading."""


def _split_path(path: str) -> list[str | int]:
    """`$.leg[2].depth_m` as ['leg', 2, 'depth_m']."""
    found = re.findall(r"\.([^.\[]+)|\[(\d+|\.\.\.)\]", path)
    return [int(index) if index else name for name, index in found if index != "..."]


def _parts(dotted: str) -> list[str]:
    return [part.strip().strip("\"'") for part in dotted.split(".")]


def locate(text: str, path: list[str | int]) -> int | None:
    """Line (from 1) on which the longest known beginning of a key path stands; None if nothing of it does."""
    best: tuple[int, int] | None = None
    table: list[str | int] = []
    arrays: dict[str, int] = {}
    for number, line in enumerate(text.split("\n"), start=1):  # lines as TOML counts them
        header, key = _HEADER.match(line), _KEY.match(line)
        if header:
            table = list(_parts(header.group(2)))
            if header.group(1) == "[[":
                name = header.group(2)
                arrays[name] = arrays.get(name, -1) + 1
                table = [*table, arrays[name]]
            candidate = table
        elif key:
            candidate = [*table, *_parts(key.group(1))]
        else:
            continue
        common = 0
        while common < min(len(candidate), len(path)) and candidate[common] == path[common]:
            common += 1
        if common and common == min(len(candidate), len(path)) and (best is None or common > best[0]):
            best = (common, number)
    return best[1] if best else None


def _dotted(path: list[str | int]) -> str:
    out = ""
    for part in path:
        out += f"[{part}]" if isinstance(part, int) else (f".{part}" if out else part)
    return out


def _refuse_nonfinite(value: Any, path: list[str | int], text: str, source: str) -> None:
    if len(path) > MAX_DEPTH:
        key = _dotted(path[:3])
        raise ConfigError(source, f"tables nested deeper than {MAX_DEPTH}", key=key, line=locate(text, path))
    if isinstance(value, float) and not math.isfinite(value):
        raise ConfigError(source, f"expected a finite number, got {value}", key=_dotted(path), line=locate(text, path))
    if isinstance(value, dict):
        for name, item in value.items():
            _refuse_nonfinite(item, [*path, name], text, source)
    elif isinstance(value, list):
        for index, item in enumerate(value):
            _refuse_nonfinite(item, [*path, index], text, source)


def decode(text: str, kind: type[T], source: str) -> T:
    """`text` as an object of `kind` (a Table); raises ConfigError, never anything else."""
    if len(text) > MAX_BYTES:
        raise ConfigError(source, f"longer than {MAX_BYTES} characters")
    try:
        raw = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        found = _AT_LINE.search(str(error))
        line = int(found.group(1)) if found and found.group(1) else max(1, len(text.splitlines()))
        raise ConfigError(source, f"not TOML: {_AT_LINE.sub('', str(error)).strip()}", line=line) from None
    except ValueError:  # tomllib lets Python's own limit on the digits of an integer through
        lines = text.split("\n")
        longest = max(range(len(lines)), key=lambda index: len(lines[index]))
        raise ConfigError(source, "not TOML: a number with too many digits", line=longest + 1) from None
    except RecursionError:
        raise ConfigError(source, f"tables nested deeper than {MAX_DEPTH}") from None
    _refuse_nonfinite(raw, [], text, source)
    try:
        return msgspec.convert(raw, kind, strict=True)
    except msgspec.ValidationError as error:
        raise _explain(str(error), text, source) from None


def _explain(message: str, text: str, source: str) -> ConfigError:
    at = _AT_PATH.search(message)
    path = _split_path(at.group(1)) if at else []
    message = _AT_PATH.sub("", message)
    field = _FIELD.search(message)
    if field:
        path = [*path, field.group(2)]
        message = "unknown key" if field.group(1) == "unknown" else "missing key"
    return ConfigError(source, message[:1].lower() + message[1:], key=_dotted(path), line=locate(text, path))
