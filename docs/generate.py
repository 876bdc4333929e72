"""Generated pages of the reference: tables of what the code defines, written before Sphinx reads the pages.

`python -m docs.generate` writes the results of sealed sets into the committed pages (docs/blind_sets.py).
"""

import typing
from collections.abc import Iterator
from pathlib import Path

import msgspec

from glider.firmware.faults import markdown_rows
from glider.firmware.model.vehicle import Vehicle
from glider.tools.diagnose.record import AnswerRecord, Details
from glider.tools.inference.channels import Channel
from glider.tools.inference.hyperparameters import SECTIONS, listed
from glider.tools.inference.kinds import kind_of
from glider.tools.verify.challenge.ocean_cases import shipped_vehicle


def write_all(folder: Path) -> None:
    """Write every generated page into the folder; a page that is as it was keeps its time of change."""
    folder.mkdir(exist_ok=True)
    pages = {
        "tolerances.md": tolerances(), "faults.md": faults(), "vehicle-file.md": vehicle_file(),
        "answers.md": answers(), "commands.md": commands(), "hyperparameters.md": hyperparameters(),
    }  # fmt: skip
    for name, text in pages.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def table(head: tuple[str, ...], rows: list[tuple[object, ...]]) -> str:
    """Render a Markdown table."""
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("| " + " | ".join(str(cell).replace("|", r"\|") for cell in row) + " |" for row in lines) + "\n"


def tolerances() -> str:
    """The channels of both kinds of vehicles with their tolerances and windows."""
    from glider.tools.data.sources import load_any_vehicle

    text = "# Channels and tolerances\n\nGenerated from `tools/inference`. One tolerance is the unit of a gap.\n"
    for title, vehicle in (
        ("ROUGHIE class", load_any_vehicle("roughie")),
        ("Ocean gliders", shipped_vehicle("slocum")),
    ):
        measures = kind_of(vehicle).measures
        rows = [(f"`{c.name}`", _tolerance(c)) for c in measures.channels]
        text += (
            f"\n## {title}\nWindows of {measures.window:g} s, of which the first {measures.look_in:g} s initialise.\n\n"
        )
        text += table(("channel", "tolerance"), rows)
    return text


def hyperparameters() -> str:
    """Every number that decides, with what it is and where its value comes from."""
    text = (
        "# Hyperparameters\n\nGenerated from `tools/inference/hyperparameters.py`. Another value of one of these\n"
        "numbers moves a probability, a verdict, a selection or an event of a diagnosis or a watch while fits stay\n"
        "as they are; no other number of these modules does. Budgets of the search, numerical steps and bounds of the\n"
        f"data are in `tests/data/other_numbers.toml`. There are {len(list(listed()))} here.\n"
    )
    for title in SECTIONS:
        rows = [
            (f"`{one.name}`", f"{value:g}", one.metadata["unit"], one.metadata["meaning"], one.metadata["source"])
            for section, one, value in listed() if section == title
        ]  # fmt: skip
        text += f"\n## {title}\n\n" + table(("name", "value", "unit", "prior or bound of", "source"), rows)
    return text


def _tolerance(channel: Channel) -> str:
    return f"{channel.tolerance * channel.scale:.4g} {channel.unit}"


def faults() -> str:
    """The fault table of the supervisor."""
    head = ("row", "fault", "detected by", "within, s", "reaction", "cleared by")
    return (
        "# Fault table\n\nGenerated from `firmware/faults.py`.\n\n"
        + table(head, [])
        + "\n".join(markdown_rows())
        + "\n"
    )


def vehicle_file() -> str:
    """Every key of a vehicle file with its type."""
    text = "# Keys of a vehicle file\n\nGenerated from `firmware/model/vehicle.py`. Unknown keys are refused.\n\n"
    return text + table(("key", "type", "default"), list(_keys(Vehicle, "")))


def answers() -> str:
    """Every key of diagnosis.json and report.json."""
    text = "# Keys of a diagnosis\n\nGenerated from `tools/diagnose/record.py`. A number that is not finite is null.\n"
    for name, record in (("diagnosis.json", AnswerRecord), ("report.json", Details)):
        text += f"\n## {name}\n\n" + table(("key", "type", "default"), list(_keys(record, "")))
    return text


def _keys(struct: type, prefix: str) -> Iterator[tuple[str, str, str]]:
    """The keys of a record, those of the records in it behind theirs."""
    hints = typing.get_type_hints(struct)
    for field in msgspec.structs.fields(struct):
        kind = hints[field.name]
        inner = [part for part in (kind, *typing.get_args(kind)) if isinstance(part, type) and _is_struct(part)]
        default = "" if field.required else "" if field.default is msgspec.NODEFAULT else f"`{field.default!r}`"
        if inner:
            many = "[]" if typing.get_origin(kind) is list else ""
            yield (f"`{prefix}{field.encode_name}{many}`", "table", "" if field.required else "optional")
            yield from _keys(inner[0], f"{prefix}{field.encode_name}{many}.")
        else:
            yield (f"`{prefix}{field.encode_name}`", f"`{_type(kind)}`", default if len(default) < 40 else "")


def _is_struct(kind: type) -> bool:
    return issubclass(kind, msgspec.Struct)


def _type(kind: object) -> str:
    return kind.__name__ if isinstance(kind, type) and not typing.get_args(kind) else str(kind).replace("typing.", "")


def commands() -> str:
    """A directive for every command, which sphinx-click fills in."""
    from glider.tools.cli.main import COMMANDS

    text = "# Every command and option\n\nGenerated from the command line.\n"
    for name, (module, attribute, _) in COMMANDS.items():
        directive = f".. click:: glider.tools.{module}:{attribute}\n   :prog: glider {name}\n   :nested: full\n"
        text += f"\n```{{eval-rst}}\n{directive}```\n"
    return text


if __name__ == "__main__":
    from docs import blind_sets

    blind_sets.write_pages()
