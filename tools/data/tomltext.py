"""Tables as TOML text, the one writer of TOML: the other way round of reading, for files that people go on editing."""

import json
from typing import Any

WIDTH = 110


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")  # which JSON allows, TOML does not
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(item)}" for key, item in value.items() if item is not None) + " }"
    parts = [_value(item) for item in value]
    line = "[" + ", ".join(parts) + "]"
    if len(line) <= WIDTH and not any(isinstance(item, list | tuple) for item in value):
        return line
    return "[\n" + "".join(f"  {part},\n" for part in parts) + "]"


def toml_text(table: dict[str, Any], inline: tuple[str, ...] = (), path: str = "") -> str:
    """A table and those below it; entries that are None are left out, tables within `inline` stand in one line each."""
    here, below = [], []
    for key, value in table.items():
        if value is None:
            continue
        if isinstance(value, dict) and path not in inline:
            below.append(toml_text(value, inline, f"{path}.{key}" if path else key))
        else:
            here.append(f"{key} = {_value(value)}\n")
    head = f"\n[{path}]\n" if path and here else ""
    return head + "".join(here) + "".join(below)
