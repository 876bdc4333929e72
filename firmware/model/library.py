"""The files shipped with the package: vehicles and missions by name."""

from importlib.resources import files


def shipped(kind: str) -> dict[str, str]:
    """Name -> text of the shipped TOML files of a kind: 'model/vehicles' or 'guidance/missions'."""
    folder = files("glider.firmware").joinpath(*kind.split("/"))
    return {
        entry.name.removesuffix(".toml"): entry.read_text(encoding="utf-8")
        for entry in sorted(folder.iterdir(), key=lambda item: item.name)
        if entry.name.endswith(".toml")
    }
