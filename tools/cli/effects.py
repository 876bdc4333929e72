"""`glider effects`: what can be wrong with a simulated vehicle, and with a diagnosed one."""

import click

from glider.tools.cli.common import json_option, print_result


@click.command()
@click.argument("labels", metavar="[LABEL]...", nargs=-1)
@json_option
def effects(labels: tuple[str, ...], as_json: bool) -> None:
    """List the effects of the catalogue with their parameters: range, 1 sigma of the prior, unit.

    See docs/reference/effects.md.
    """
    from glider.tools import api

    print_result(api.effects(*labels), as_json)
