"""Console blocks of the documentation do what the pages show; hand-written words stay within their number."""

import re
from pathlib import Path

import click
import pytest

from docs.picture import described, written
from glider.tools.cli.main import cli
from tests.support.console import MOST_WORDS, PAGES, ROOT, blocks, differs, glider_commands, run_page, words_of

pytestmark = pytest.mark.computes(seconds=110)

RUN = [page for page in PAGES if any(not block.not_run for block in blocks(page.read_text(encoding="utf-8")))]


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", RUN, ids=name)
def test_the_console_blocks_of_a_page_show_what_the_commands_print(page, tmp_path):
    assert run_page(page, tmp_path) == []
    if page.stem == "first-diagnosis":  # the case of `make demo`, which README shows
        assert described(tmp_path / "walk" / "answer") == written(ROOT / "docs" / "pictures" / "diagnosis.png")


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_command_of_a_page_exists_with_its_options(page):
    for block in blocks(page.read_text(encoding="utf-8")):
        for line, _ in block.commands:
            for words in glider_commands(line):
                assert unknown_words(words) == [], line


def unknown_words(words: list[str]) -> list[str]:
    """Commands and options of a command line that `glider` does not have."""
    command: click.Command = cli
    while isinstance(command, click.Group) and words and not words[0].startswith("-"):
        found = command.get_command(click.Context(command), words[0])
        if found is None:
            return [words[0]]
        command, words = found, words[1:]
    options = {o for p in command.params for o in (*p.opts, *p.secondary_opts)} | {"--help", "-h", "--version", "--"}
    return [word for word in words if re.match(r"--?[a-z]", word) and word.partition("=")[0] not in options]


def test_a_command_that_does_not_exist_is_noticed():
    assert unknown_words(["gap", "guess"]) == ["guess"]
    assert unknown_words(["gap", "measure", "case", "--loud"]) == ["--loud"]
    assert unknown_words(["gap", "measure", "case", "--json"]) == []


def test_how_output_is_compared():
    assert differs("a 1.00\n...\nend\n", "a 1.01\nb\nc\nend\n") is None
    assert differs("a 1.00\n", "a 1.20\n") is not None
    assert differs("seconds ...\n", "seconds 28.1\n") is None
    assert differs("a\n", "a\nb\n") is not None
    assert differs("a\n...\n", "b\n") is not None


def test_hand_written_words_stay_within_their_number():
    assert sum(map(words_of, PAGES)) <= MOST_WORDS
