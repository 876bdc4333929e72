"""Changing a board file as its writer would: comments, order and layout stay, and the old file is kept beside."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomlkit

from glider.hal.boardfile import DeviceFile, calibration_hash, check
from glider.hal.strict import decode


def set_ports(text: str, paths: Mapping[str, str]) -> str:
    """The text of a board of kind "devices" with these paths of ports; a twin's sea is left out."""
    document = tomlkit.parse(text)
    document["kind"] = "devices"
    for table in ("environment", "start", "effects"):
        if table in document:
            del document[table]
    for name, path in paths.items():
        document["port"][name]["path"] = path  # type: ignore[index]
    return tomlkit.dumps(document)


def set_values(text: str, changes: Mapping[str, Any]) -> str:
    """The text with values set, keys as `slider.zero_counts`."""
    document = tomlkit.parse(text)
    for key, value in changes.items():
        table: Any = document
        *path, last = key.split(".")
        for part in path:
            table = table[part]
        table[last] = list(value) if isinstance(value, tuple) else value
    return tomlkit.dumps(document)


def accepted(text: str, source: str) -> str:
    """The text with the hash of its calibration as it stands; ConfigError where it is no good board file."""
    file = decode(text, DeviceFile, source)
    check(file, source)
    return set_values(text, {"calibration": calibration_hash(file)})


def keep_old(path: Path) -> Path:
    """Copy a file to the first free name `board.toml.1`, `.2`, ...; that name."""
    number = 1
    while (kept := path.with_name(f"{path.name}.{number}")).exists():
        number += 1
    shutil.copy2(path, kept)
    return kept
