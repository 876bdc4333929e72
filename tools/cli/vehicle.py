"""`glider vehicle`: a first vehicle file by question and answer, and a vehicle at a glance."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

import click

from glider.tools.cli.common import compile_observer, json_option, print_json, print_lines, say
from glider.tools.data.errors import InputError
from glider.tools.data.files import check_writable, write_bytes

if TYPE_CHECKING:
    from glider.tools.data.first_vehicle import FirstVehicle, Question


@click.group()
def vehicle() -> None:
    """Make a first vehicle file, or look at one."""


@vehicle.command()
@click.argument("out", type=click.Path(path_type=Path, dir_okay=False))
@click.option("--name", help="Of the vehicle.  [default: the file's]")
@click.option(
    "--own", "of_own", is_flag=True, help="A commented skeleton of a model of your own: OUT and a .py beside it."
)
def new(out: Path, name: str | None, of_own: bool) -> None:
    """Ask for weighed masses, measured lengths and a swing test, one by one, and write a first vehicle file OUT.

    An empty answer takes the number in brackets and calls it assumed; < goes back. Answers may come from a pipe, a line
    each.

    Example: glider vehicle new mine.toml
    """
    out = out if out.suffix else out.with_suffix(".toml")
    if out.exists():
        raise InputError("is there already: name another file", source=out)
    check_writable(out.parent)
    if of_own:
        from glider.tools.own.skeleton import write_skeleton

        say(f"{write_skeleton(out)} and {out}: write your model there, then `glider vehicle check {out}`")
        return
    found = interview(sys.stdin, sys.stdin.isatty())
    write_bytes(out, found.text(name or out.stem).encode("utf-8"))
    say(f"{out}: fly it (`glider fly --vehicle {out}`), then `glider identify` on the logs")


def interview(answers: TextIO, person: bool) -> "FirstVehicle":
    """The questions one by one; a person is asked again where an answer is wrong, a pipe's is an InputError."""
    from glider.tools.data.first_vehicle import QUESTIONS, FirstVehicle

    found, n, observed = FirstVehicle(), 0, list[int]()
    say("Enter takes the number in brackets, which the file then calls assumed; < goes back a question.")
    while n < len(QUESTIONS):
        asked = QUESTIONS[n]
        if not found.asks(asked.key):
            n += 1
            continue
        number = f"{n + 1}/{len(QUESTIONS)}"
        usual = found.value(asked.key)
        source_words = "your answer" if asked.key in found.answers else found.source_words(asked.key)
        if usual is not None:
            hint = f" [{usual:.4g}, {source_words}]"
        else:
            hint = " [not done: scaled from the shipped vehicle]" if asked.key.endswith("_period") else ""
        click.echo(f"{number:>5} {asked.words[:1].upper()}{asked.words[1:]}, {asked.unit}{hint}: ", nl=False, err=True)
        line = answers.readline()
        if not person:
            say("")
        if not line:
            raise InputError(f"the answers end at question {number}: {asked.words}")
        said = line.strip()
        if said in ("<", "back"):
            wrong = None if observed else "this is the first question"
            n = observed.pop() if observed else n
        else:
            wrong = _take(found, asked, said)
            if wrong is None:
                observed.append(n)
                n += 1
        if wrong is not None:
            if not person:
                raise InputError(f"question {number}, {asked.words}: {wrong}")
            say(f"      {wrong}")
    return found


def _take(found: "FirstVehicle", asked: "Question", said: str) -> str | None:
    """An answer into what was found; what is wrong with it, in a line."""
    if not said:
        none = found.value(asked.key) is None and not asked.key.endswith("_period")
        return "there is no number to take: measure it, or < to go back" if none else None
    try:
        value = float(said.replace(",", "."))
    except ValueError:
        return f"not a number: {said!r} (expected {asked.low:g} to {asked.high:g} {asked.unit}, Enter, or <)"
    wrong = found.wrong(asked.key, value)
    if wrong is None:
        found.answers[asked.key] = value
    return wrong


@vehicle.command()
@click.argument("file", type=click.Path(path_type=Path, dir_okay=False))
@click.option(
    "--case", type=click.Path(path_type=Path, file_okay=False), help="Try it on the first run of this case too."
)
@json_option
def check(file: Path, case: Path | None, as_json: bool) -> None:
    """Try a model of one's own: FILE names it. What it declares, what can be asked of it, which causes it can have.

    Its functions are called: shapes, numbers, the same twice, smooth in the parameters. Exit code 2: one line says what
    is wrong and where.
    """
    from glider.tools.own.report_check import describe

    found = describe(file, case, compile_observer)
    print_lines(found["lines"], as_json, found)


@vehicle.command()
@click.argument("wanted", default="roughie", metavar="[NAME or FILE]")
@json_option
def show(wanted: str, as_json: bool) -> None:
    """A vehicle at a glance: masses, actuators, coefficients and how sure they are."""
    import msgspec

    from glider.tools.data.errors import InputError
    from glider.tools.data.sources import load_vehicle, read_text
    from glider.tools.inference.model import vehicle_model
    from glider.tools.own.files import is_own

    if Path(wanted).is_file() and is_own(read_text(Path(wanted))):
        raise InputError("a model of one's own: `glider vehicle check` shows it", source=wanted)
    loaded = load_vehicle(wanted)
    if as_json:
        print_json(msgspec.to_builtins(loaded))
        return
    from glider.firmware.model.vehicle import COEFFICIENTS, PLACES

    model, m, a = vehicle_model(wanted, loaded), loaded.mass, loaded.actuators
    click.echo(f"{loaded.name}: {m.m_t:g} kg, of which {m.m_r:g} turn and {m.m_s:g} slide; ballast at {m.x_b:g} m")
    for name, table, unit in (("servo", a.servo, "rad"), ("slider", a.slider, "m"), ("ballast", a.ballast, "kg")):
        low, high = table.range
        click.echo(f"  {name:<8} {low:g} to {high:g} {unit}, {table.rate:g} {unit}/s, lag {table.time_constant:g} s")
    for name in COEFFICIENTS:
        click.echo(f"  {name:<8} {model.P[PLACES[name]]:>9.4g} +- {model.sigma[PLACES[name]]:.2g}")
    if loaded.assumed:
        from glider.tools.data.first_vehicle import in_words

        click.echo(f"assumed: {in_words(loaded.assumed)} (`glider identify` finds them)")
    if loaded.identified is not None:
        found = loaded.identified
        click.echo(f"identified {found.date} from {found.runs} runs (data {found.data}) by {found.revision}")
