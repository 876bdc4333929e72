"""`glider gap isolability`: which effects planned flights could show and distinguish."""

import click

from glider.tools.cli.common import json_option, print_lines, progress
from glider.tools.data.errors import InputError, need


def _names(context: click.Context, option: click.Parameter, value: str | None) -> tuple[str, ...] | None:
    """Split a list at its commas."""
    return None if value is None else tuple(part.strip() for part in value.split(",") if part.strip())


@click.command()
@click.option(
    "--columns", callback=_names, metavar="A,B,...", help="Columns of the planned log (default: all onboard)."
)
@click.option("--vehicle", default="roughie", show_default=True, help="Shipped name or vehicle file.")
@click.option("--manoeuvres", callback=_names, metavar="A,B,...", help="Manoeuvres to fly (default: all five).")
@click.option(
    "--labels", callback=_names, metavar="A,B,...", help="Effects to show (default: all that the log could show)."
)
@json_option
def isolability(
    columns: tuple[str, ...] | None,
    vehicle: str,
    manoeuvres: tuple[str, ...] | None,
    labels: tuple[str, ...] | None,
    as_json: bool,
) -> None:
    """Compute which effects a planned log could show and distinguish, before anything is flown.

    The nominal vehicle is simulated; the answer follows from sensitivities. For every effect at 1 sigma of its prior:
    the log evidence that five flights of 90 s would give (12 nat are needed), the smallest visible size in units of
    that sigma (`glider effects`), and the effects that it would be confused with. Leave a column out to see what its
    sensor is needed for. See docs/reference/causes.md.
    """
    from glider.sim_backend.core.effects.catalogue import catalogue
    from glider.tools.data.sources import load_vehicle
    from glider.tools.data.spelling import did_you_mean
    from glider.tools.diagnose.isolability import ONBOARD, check_columns, isolability_of
    from glider.tools.diagnose.next_run import MANOEUVRES

    need("analysis")
    wanted, known = columns or ONBOARD, {one.name: one for one in MANOEUVRES}
    check_columns(wanted)
    for option, given, there in (("--manoeuvres", manoeuvres, known), ("--labels", labels, catalogue())):
        for name in given or ():
            if name not in there:
                raise InputError(f"no '{name}'{did_you_mean(name, there)}", source=option)
    flown = [known[name] for name in manoeuvres or known]
    with progress("isolability", 2) as advance:
        found = isolability_of(load_vehicle(vehicle), wanted, flown, labels, advance)
    lines = [f"{'effect':<22}{'nat':>10}{'smallest':>10}  confused with"]
    for one in found:
        near = ", ".join(one.confused_with) if one.visible else "not visible"
        smallest = f"{one.smallest:10.2g}" if one.visible else " " * 10
        lines.append(f"{one.label:<22}{one.evidence:10.3g}{smallest}  {near}".rstrip())
    print_lines(lines, as_json, {
        "format": 1, "vehicle": vehicle, "columns": list(wanted), "manoeuvres": [one.name for one in flown],
        "effects": [
            {"label": one.label, "evidence": one.evidence, "visible": one.visible,
             "smallest": one.smallest, "confused_with": list(one.confused_with)}
            for one in found
        ],
    })  # fmt: skip
