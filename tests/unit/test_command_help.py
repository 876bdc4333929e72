"""The help of every command: an example that the command takes, lists of commands that are not cut."""

import shlex
from pathlib import Path

import click
import pytest

from glider.tools.cli.help import EXAMPLES
from glider.tools.cli.main import COMMANDS, cli
from tests.support.commands import glider


def walk(command=cli, name="", parent=None):
    """Every command with its name and context, groups among them."""
    context = click.Context(command, info_name=name.split(" ")[-1] or "glider", parent=parent)
    yield name, command, context
    if isinstance(command, click.Group):
        for sub in command.list_commands(context):
            yield from walk(command.get_command(context, sub), f"{name} {sub}".strip(), context)


ALL = {name: (command, context) for name, command, context in walk()}


def parsed(words: list[str]) -> str:
    """The command whose parser takes these words; click's error where it does not."""
    command, name, context = cli, "", None
    while True:
        context = command.make_context(name or "glider", list(words), parent=context)
        if not isinstance(command, click.Group):
            return " ".join(context.command_path.split(" ")[1:])
        name, command, words = command.resolve_command(context, [*context._protected_args, *context.args])


@pytest.mark.parametrize("name", ALL)
def test_every_help_has_an_example_that_the_command_takes(name):
    command, context = ALL[name]
    text = command.get_help(context)
    assert EXAMPLES[name], name
    for example in EXAMPLES[name]:
        assert f"\n    {example}\n" in f"{text}\n"
        program, *words = shlex.split(example)
        assert program == "glider"
        taken = parsed(words)
        assert taken == name or isinstance(command, click.Group), example
        assert taken in ALL


def test_every_example_is_of_a_command():
    assert set(EXAMPLES) == set(ALL)


@pytest.mark.parametrize("wrong", ["gap diagnose dives", "log export", "fly --missoin spiral", "tune --method best"])
def test_the_parser_refuses_what_a_command_does_not_take(wrong):
    with pytest.raises(click.UsageError):
        parsed(wrong.split())


@pytest.mark.parametrize("name", [name for name, (command, _) in ALL.items() if isinstance(command, click.Group)])
def test_lists_of_commands_are_not_cut(name):
    command, context = ALL[name]
    text = " ".join(command.get_help(context).split())
    for sub in command.list_commands(context):
        whole = COMMANDS[sub][2] if not name else command.get_command(context, sub).help.split("\n\n")[0]
        assert " ".join(whole.split(". ")[0].split()).removesuffix(".") in text


def test_a_mistyped_command_is_answered_with_the_nearest():
    for words, meant in (("flyy", "fly"), ("diagnos", ""), ("gap mesure", "measure"), ("idnetify", "identify")):
        done = glider(*words.split(), cwd=Path("/"))
        assert done.returncode == 2
        assert ("you mean" in done.stderr) == bool(meant)
        assert meant in done.stderr
