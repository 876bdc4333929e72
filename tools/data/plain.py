"""Results as JSON knows them."""

import math
from collections.abc import Mapping
from typing import Any


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
