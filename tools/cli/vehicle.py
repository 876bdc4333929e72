"""`glider vehicle`: a first vehicle file by question and answer, and a vehicle at a glance."""

from pathlib import Path

import click

from glider.tools.cli.common import json_option, print_json, say


@click.group()
def vehicle() -> None:
    """Make a first vehicle file, or look at one."""


@vehicle.command()
@click.argument("out", type=click.Path(path_type=Path, dir_okay=False))
@click.option("--name", help="Of the vehicle.  [default: the file's]")
def new(out: Path, name: str | None) -> None:
    """Ask for weighed masses and measured lengths, one by one, and write a first vehicle file OUT."""
    from glider.tools.data.errors import InputError
    from glider.tools.data.files import check_writable, write_bytes
    from glider.tools.data.first_vehicle import QUESTIONS, first_vehicle

    if out.exists():
        raise InputError("is there already: name another file", source=out)
    check_writable(out.parent)
    answers = {}
    for q in QUESTIONS:
        words = f"{q.words[:1].upper()}{q.words[1:]}, {q.unit}"
        answers[q.key] = click.prompt(words, default=q.usual, type=click.FloatRange(q.low, q.high), err=True)
    text = first_vehicle(name or out.stem, answers)
    write_bytes(out, text.encode("utf-8"))
    say(f"{out}: fly it (`glider fly --vehicle {out}`), then `glider identify` on the logs")


@vehicle.command()
@click.argument("wanted", default="roughie", metavar="[NAME or FILE]")
@json_option
def show(wanted: str, as_json: bool) -> None:
    """A vehicle at a glance: masses, actuators, coefficients and how sure they are."""
    import msgspec

    from glider.tools.data.sources import load_vehicle
    from glider.tools.inference.model import vehicle_model

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
    if loaded.identified is not None:
        found = loaded.identified
        click.echo(f"identified {found.date} from {found.runs} runs (data {found.data}) by {found.revision}")
