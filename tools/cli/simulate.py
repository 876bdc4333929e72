"""`glider simulate`: an open-loop nominal flight from a file of commands."""

import contextlib
import math
from pathlib import Path

import click

from glider.tools.cli.common import progress
from glider.tools.data.files import check_writable, write_bytes

LONG_STEPS = 5e6  # a few seconds of computing: from here on a person wants to see it move


class WaterVelocity(click.ParamType):
    """N,E: the water's velocity in m/s."""

    name = "N,E"

    def convert(self, value, param, ctx):
        if isinstance(value, tuple):
            return value
        try:
            north, east = (float(part) for part in value.split(","))
        except ValueError:
            self.fail(f"expected two numbers in m/s, north and east, such as 0.12,-0.07; got {value!r}", param, ctx)
        if not (math.isfinite(north) and math.isfinite(east)):
            self.fail(f"expected finite numbers, got {value!r}", param, ctx)
        return north, east


@click.command()
@click.argument("commands", type=click.Path(path_type=Path), metavar="COMMANDS.csv")
@click.option("--out", required=True, type=click.Path(path_type=Path, dir_okay=False), help="Where to put the CSV.")
@click.option("--vehicle", default="roughie", show_default=True, help="Shipped name or vehicle file.")
@click.option("--water", type=WaterVelocity(), default="0,0", help="Velocity of the water, m/s, north and east.")
@click.option("--dt", type=float, default=0.01, show_default=True, metavar="S", help="Longest integration step, s.")
def simulate(commands: Path, out: Path, vehicle: str, water: tuple[float, float], dt: float) -> None:
    """Fly COMMANDS.csv open loop with the nominal model.

    Columns: t_s, cmd_servo_rad, cmd_slider_m, cmd_ballast_kg, and the start in the state columns of the first row:
    X, Y, Z, phi, theta, psi, u, v, w (relative to the water), p, q, r, servo_rad, slider_m, ballast_kg. Each command
    holds from the row it stands in. The result has the same columns at the same times.
    """
    from glider.tools.data.sources import load_vehicle
    from glider.tools.flight.simulate import check_dt, expected_steps, fly_commands, read_commands, write_flight

    P = load_vehicle(vehicle).vector()
    check_dt(P, dt)
    check_writable(out.parent)
    table = read_commands(commands)
    long = expected_steps(table, dt) > LONG_STEPS
    with progress("simulate", len(table.times) - 1) if long else contextlib.nullcontext() as advance:
        states = fly_commands(P, table, water, dt, advance)
    write_bytes(out, write_flight(table, states).encode("utf-8"))
