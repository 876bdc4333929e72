"""Exit codes of every command: 130 after Ctrl-C, 2 where the input ended or the disk says no, and one line."""

import errno

import click
import pytest

from glider.tools.cli.common import report_errors


def ended(monkeypatch, error: BaseException | type[BaseException]) -> int:
    """The exit code of a command that ends in an error."""

    @click.command()
    def command() -> None:
        raise error

    monkeypatch.setattr("sys.argv", ["glider"])
    return report_errors(command)


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (KeyboardInterrupt, 130, "stopped"),
        (click.Abort(), 130, "stopped"),
        (EOFError, 2, "glider: the input ended before all was asked"),
        (OSError(errno.ENOSPC, "No space left on device", "a/b.csv"), 2, "glider: a/b.csv: No space left on device"),
        (OSError(errno.ENOSPC, "No space left on device"), 2, "glider: No space left on device"),
        (OSError("a library's own words"), 2, "glider: a library's own words"),
    ],
)
def test_what_a_command_ends_with(monkeypatch, capsys, error, code, line):
    assert ended(monkeypatch, error) == code
    said = capsys.readouterr()
    assert (said.out, said.err.strip()) == ("", line)


def test_ctrl_c_at_a_question_is_no_end_of_the_input(monkeypatch, capsys):
    def interrupted(prompt: str) -> str:
        raise KeyboardInterrupt

    monkeypatch.setattr("click.termui.visible_prompt_func", interrupted)
    command = click.Command("ask", callback=lambda: click.prompt("mass"))
    monkeypatch.setattr("sys.argv", ["glider"])
    assert report_errors(command) == 130
    assert "stopped" in capsys.readouterr().err
