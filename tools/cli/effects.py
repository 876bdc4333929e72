"""`glider effects`: what can be wrong with a simulated vehicle, and with a diagnosed one."""

import click

from glider.tools.cli.common import json_option, print_json


@click.command()
@click.argument("labels", metavar="[LABEL]...", nargs=-1)
@json_option
def effects(labels: tuple[str, ...], as_json: bool) -> None:
    """List the effects of the catalogue with their parameters: range, 1 sigma of the prior, unit (docs/EFFECTS.md)."""
    from glider.sim_backend.core.effects.catalogue import catalogue
    from glider.tools.data.errors import InputError

    known = catalogue()
    for label in labels:
        if label not in known:
            raise InputError(f"no effect '{label}'; glider effects lists them", source="effects")
    found = [known[label] for label in labels or known]
    if as_json:
        print_json([
            {
                "label": one.label, "subsystem": one.subsystem, "element": one.element, "summary": one.summary,
                "parameters": [
                    {"name": p.name, "unit": p.unit, "low": p.low, "high": p.high, "sigma": p.spread}
                    for p in one.parameters
                ],
            }
            for one in found
        ])  # fmt: skip
        return
    for one in found:
        click.echo(f"{one.label}  {one.summary} ({one.subsystem}: {one.element})")
        for p in one.parameters:
            unit = "" if p.unit in ("", "1") else f" {p.unit}"
            click.echo(f"    {p.name:<12} {p.low:g} to {p.high:g}{unit}, 1 sigma {p.spread:g}")
