"""Results as JSON knows them."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from glider.tools.data.errors import InputError
from glider.tools.data.files import require_file


def as_plain(value: Any) -> Any:
    """Numbers and arrays as JSON knows them; what is not finite becomes null."""
    if isinstance(value, Mapping):
        return {str(key): as_plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [as_plain(item) for item in value]
    if hasattr(value, "tolist"):
        return as_plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def read_json(path: Path, kind: Any, most: int | None = None) -> Any:
    """A JSON file as a msgspec type; InputError where it is none or has more than `most` bytes."""
    require_file(path, most)
    try:
        return msgspec.json.decode(path.read_bytes(), type=kind)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise InputError(str(error), source=path) from None
