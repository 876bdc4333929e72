"""The strict reader of TOML, under the name by which vehicle and mission files use it; it stands in hal/strict.py
because board files are read below the firmware."""

from hal.strict import MAX_BYTES, MAX_DEPTH, ConfigError, Table, decode, locate

__all__ = ["MAX_BYTES", "MAX_DEPTH", "ConfigError", "Table", "decode", "locate"]
