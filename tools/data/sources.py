"""From what a user types, a name or a path, to a decoded file."""

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from glider.firmware.guidance.mission import Mission, decode_mission
from glider.firmware.model.library import shipped
from glider.firmware.model.vehicle import Vehicle, decode_vehicle
from glider.hal.strict import ConfigError
from glider.sim_backend.ocean.vehicle import KIND, OceanVehicle, decode_ocean_vehicle, shipped_vehicles
from glider.tools.data.errors import InputError

T = TypeVar("T")
MAX_TEXT_CHARACTERS = 256_000_000  # characters of any text file


def read_text(path: Path) -> str:
    """A text file's content; InputError where it cannot be read."""
    try:
        with path.open(encoding="utf-8") as file:
            text = file.read(MAX_TEXT_CHARACTERS + 1)
        if len(text) > MAX_TEXT_CHARACTERS:
            raise InputError(f"longer than {MAX_TEXT_CHARACTERS} characters", source=path)
        return text
    except UnicodeDecodeError as error:
        raise InputError(f"not UTF-8 text (byte {error.start})", source=path) from None
    except OSError as error:
        raise InputError(error.strerror or str(error), source=path) from None


def name_or_path(
    wanted: str, kind: str, folder: str, base: Path | None = None, more: dict[str, str] | None = None
) -> tuple[str, str]:
    """Text and source of a shipped name or of a path (relative to `base` first, then to the working directory).

    more: name -> text of others that are shipped.
    """
    library = shipped(folder) | (more or {})
    if wanted in library:
        return library[wanted], f"{wanted} (shipped)"
    for candidate in ([base / wanted] if base else []) + [Path(wanted)]:
        if candidate.is_file():
            return read_text(candidate), str(candidate)
    raise InputError(f"no {kind} '{wanted}': neither a file nor one of {', '.join(library) or 'none'}")


def _load(wanted: str, kind: str, folder: str, decode: Callable[[str, str], T], base: Path | None) -> T:
    text, source = name_or_path(wanted, kind, folder, base)
    return decode(text, source)


def load_vehicle(wanted: str, base: Path | None = None) -> Vehicle:
    """A vehicle by shipped name or path; `base` is the folder of the file that names it. ConfigError: another kind."""
    found = load_any_vehicle(wanted, base)
    if isinstance(found, OceanVehicle):
        raise ConfigError(wanted, "an ocean glider: this command flies or asks a ROUGHIE-like vehicle", key="kind")
    return found


def load_any_vehicle(wanted: str, base: Path | None = None) -> Vehicle | OceanVehicle:
    """A vehicle of any kind, as load_vehicle."""
    text, source = name_or_path(wanted, "vehicle", "model/vehicles", base, shipped_vehicles())
    return decode_ocean_vehicle(text, source) if _kind_of(text) == KIND else decode_vehicle(text, source)


def _kind_of(text: str) -> object:
    """The kind that a vehicle file names; None where it names none or is no TOML (its own reader then says so)."""
    try:
        return tomllib.loads(text).get("kind")
    except (ValueError, RecursionError):
        return None


def load_mission(wanted: str) -> tuple[str, str, Mission]:
    """A mission by shipped name or path: its text, its source, and the mission."""
    text, source = name_or_path(wanted, "mission", "guidance/missions")
    return text, source, decode_mission(text, source)
