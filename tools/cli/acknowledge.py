"""`glider acknowledge`: a person has looked at the vehicle after a flight that did not end in order."""

from pathlib import Path

import click

from glider.tools.cli.common import fail, say
from glider.tools.cli.status import STATE


@click.command()
@STATE
def acknowledge(state: Path | None) -> None:
    """Let the next flight begin: the vehicle is ashore, and a person has looked at it.

    Refused (exit code 1) while a flight is under way, or the out-of-band process brings the vehicle up.
    """
    from glider.hal.heartbeat import run_folder, state_folder
    from glider.hal.sortie import SortieRefused
    from glider.tools.flight.keeper import acknowledge as set_back
    from glider.tools.flight.keeper import watch_facts

    try:
        before = set_back(state or state_folder(), watch_facts(state or run_folder()))
    except SortieRefused as refused:
        fail(f"glider: not acknowledged: {refused}")
    say(f"acknowledged: {before.describe()}")
