"""`glider status`: the health page of the flight under way."""

from pathlib import Path

import click

from glider.tools.cli.common import DONE, FAILED, json_option, print_json

STATE = click.option(
    "--state",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder of state and heartbeat.  [default: the vehicle's own, else of the newest flight on twins]",
)


@click.command()
@STATE
@json_option
def status(state: Path | None, as_json: bool) -> None:
    """Show how a flight on devices does: loop, recorder, out-of-band process, depth, voltage.

    At a terminal the page is renewed once a second until Ctrl-C. Exit code 1: something is not well.
    """
    from glider.tools.flight.status import find_folder, show, snapshot

    folder = find_folder(state)
    if as_json:
        print_json(snapshot(folder))
    else:
        show(folder)
    raise SystemExit(FAILED if snapshot(folder)["problems"] else DONE)
