"""From what a user types, a name or a path, to a decoded file."""

from pathlib import Path
from typing import Any

from glider.firmware.guidance.mission import Mission, decode_mission
from glider.firmware.model.library import shipped
from glider.firmware.model.vehicle import Vehicle
from glider.hal.strict import ConfigError
from glider.tools.data.errors import InputError
from glider.tools.data.vehicle_kinds import UNNAMED, kind_of, kind_of_file, kinds, shipped_vehicles

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


def load_vehicle(wanted: str, base: Path | None = None) -> Vehicle:
    """A vehicle by shipped name or path; `base` is the folder of the file that names it. ConfigError: another kind."""
    found = load_any_vehicle(wanted, base)
    if not isinstance(found, Vehicle):
        ours, theirs = kinds()[UNNAMED].noun, kind_of(found).noun
        raise ConfigError(wanted, f"{theirs}: this command flies or asks {ours}", key="kind")
    return found


def load_any_vehicle(wanted: str, base: Path | None = None) -> Any:
    """A vehicle of any kind, as load_vehicle."""
    text, source = vehicle_text(wanted, base)
    return kind_of_file(text, source).decode(text, source)


def vehicle_text(wanted: str, base: Path | None = None) -> tuple[str, str]:
    """Text and source of a vehicle, as load_vehicle."""
    return name_or_path(wanted, "vehicle", "model/vehicles", base, shipped_vehicles())


def load_mission(wanted: str) -> tuple[str, str, Mission]:
    """A mission by shipped name or path: its text, its source, and the mission."""
    text, source = name_or_path(wanted, "mission", "guidance/missions")
    return text, source, decode_mission(text, source)
