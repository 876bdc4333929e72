"""What all commands share: exit codes, results on standard output, messages and progress on standard error."""

import contextlib
import functools
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import click

from glider.tools.data.errors import BAD_INPUT, DONE, FAILED, STOPPED, InputError, MissingExtra, missing_extra
from glider.tools.data.plain import as_plain

SILENT_S = 15.0  # of a plain progress without a line
vehicle_option = click.option(
    "--vehicle", metavar="FILE", help="A shipped vehicle or a vehicle file, in the place of the case's own."
)
json_option = click.option("--json", "as_json", is_flag=True, help="Print the result alone, as JSON.")


def say(message: str) -> None:
    """A message for the person at the terminal, on standard error."""
    click.echo(message, err=True)


def say_assumed(name: str, assumed: Iterable[str]) -> None:
    """One note where a vehicle's numbers were never measured, and what to do about it."""
    from glider.tools.data.first_vehicle import in_words

    if words := in_words(assumed):
        say(f"note: {name} has assumed numbers ({words}): `glider identify` first; until then a gap may be theirs")


def show(line: str) -> None:
    """Print a line of the result that quotes a file: nothing in it steers the terminal."""
    click.echo("".join(letter if letter.isprintable() else "\ufffd" for letter in line))


def fail(message: str) -> None:
    """End with exit code 1: the thing asked about failed."""
    say(message)
    raise SystemExit(FAILED)


def print_json(result: Any) -> None:
    """The result, and nothing else, on standard output."""
    import json

    click.echo(json.dumps(as_plain(result), indent=1))


def print_lines(lines: Iterable[object], as_json: bool, answer: Any) -> None:
    """A result on standard output: its lines, or its answer alone as JSON."""
    if as_json:
        print_json(answer)
        return
    for line in lines:
        click.echo(line)


def print_result(found: Any, as_json: bool) -> None:
    """A result of the API on standard output: its sentences, or its answer alone as JSON."""
    if as_json:
        print_json(found.answer)
    else:
        click.echo(found.summary())


def _advance_bar(bar: Any, task: Any, n: int = 1) -> None:
    bar.update(task, advance=n)


@contextlib.contextmanager
def progress(label: str, total: int) -> Iterator[Callable[[int], None]]:
    """A progress bar with a clock on a terminal; elsewhere a line at every tenth, and after SILENT_S without one.

    Yields advance(n).
    """
    if sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

        parts = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
        with Progress(*parts, console=Console(stderr=True), transient=True) as shown_bar:
            task = shown_bar.add_task(label, total=total)
            yield functools.partial(_advance_bar, shown_bar, task)
        return
    done, shown, begin, ended, spoke = 0, 0, time.monotonic(), threading.Event(), threading.Event()

    def advance(n: int = 1) -> None:
        nonlocal done, shown
        done += n
        tenth = 10 * done // max(total, 1)
        if tenth > shown:
            shown = tenth
            spoke.set()
            say(f"{label}: {done}/{total}")

    def speak(out: Any) -> None:
        while not ended.wait(SILENT_S):
            if not spoke.is_set():
                click.echo(f"{label}: {done}/{total}, {time.monotonic() - begin:.0f} s", file=out)
            spoke.clear()

    speaker = threading.Thread(target=speak, args=(sys.stderr,), daemon=True)
    speaker.start()
    try:
        yield advance
    finally:
        ended.set()
        speaker.join()


def compile_diagnosis(case: Any) -> None:
    """Compile what the diagnosis of a case calls, unless that was done."""
    from glider.tools.data.vehicle_kinds import kind_of

    kind_of(case.vehicle).compile(say, progress)


def compile_observer() -> None:
    """Compile what observes a model of the user's, unless that was done."""
    from glider.tools.flight.precompile import ensure_compiled
    from glider.tools.own.precompile import OBSERVER

    ensure_compiled(OBSERVER, say, progress)


def compile_campaign() -> None:
    """Compile what flies many flights side by side, unless that was done."""
    from glider.tools.flight.precompile import ensure_compiled
    from glider.tools.study.precompile import CAMPAIGN

    ensure_compiled(CAMPAIGN, say, progress)


def report_errors(command: click.Command) -> int:
    """Run the command line; turn what a user can cause into one line and exit code 2."""
    from glider.hal.strict import ConfigError

    try:
        command(standalone_mode=False)
    except click.exceptions.Exit as error:
        return error.exit_code
    except click.ClickException as error:
        error.show()
        return BAD_INPUT
    except click.Abort as error:
        if isinstance(error.__context__, EOFError):
            say("glider: the input ended before all was asked")
            return BAD_INPUT
        say("stopped")
        return STOPPED
    except (ConfigError, InputError, MissingExtra) as error:
        say(f"glider: {error}")
        return BAD_INPUT
    except ModuleNotFoundError as error:
        missing = missing_extra(error)
        if missing is None and not (error.name or "").startswith("glider."):
            raise
        say(f"glider: {missing or f'{error.name} is not in the release that goes onboard: call this on the laptop'}")
        return BAD_INPUT
    except BrokenPipeError:
        return DONE
    except OSError as error:
        where = "" if error.filename is None else f"{error.filename}: "
        with contextlib.suppress(OSError):
            say(f"glider: {where}{error.strerror or error}")
        return BAD_INPUT
    except SystemExit as error:
        return int(error.code or 0) if not isinstance(error.code, str) else FAILED
    return DONE
