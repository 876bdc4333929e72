"""What every --help has beside its text: examples (examples.toml), and group lists with whole sentences."""

import inspect
import re
import tomllib
from importlib.resources import files

import click

# command -> lines that can be typed as they stand
EXAMPLES: dict[str, list[str]] = tomllib.loads(files(__package__).joinpath("examples.toml").read_text(encoding="utf-8"))


def first_sentence(text: str) -> str:
    """The first sentence of a command's help, without its full stop."""
    paragraph = " ".join(inspect.cleandoc(text).split("\n\n")[0].split())
    return re.split(r"\.\s+(?=[A-Z`])", paragraph)[0].removesuffix(".")


def complete(command: click.Command, name: str) -> click.Command:
    """Give a command and those below it their examples and, for the list of their group, their first sentence whole."""
    if command.short_help is not None:  # done before
        return command
    command.short_help = first_sentence(command.help or "")
    if name in EXAMPLES:
        lines = ["Examples:", *(f"  {line}" for line in EXAMPLES[name])]
        own = "" if command.epilog is None else f"{command.epilog}\n\n"
        command.epilog = own + "\b\n" + "\n".join(lines)
    if isinstance(command, click.Group):
        for sub in command.commands.values():
            complete(sub, f"{name} {sub.name}".strip())
    return command
