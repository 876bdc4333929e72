"""`glider live`: a flight watched in Foxglove while it flies."""

import contextlib
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import click

from glider.tools.cli.common import DONE, fail, say
from glider.tools.data.errors import InputError, need

ONBOARD = "/run/glider/live"
FORWARD_S = 15.0


@click.command()
@click.argument("host", required=False)
@click.option("--socket", "path", help="The flight's socket.  [default: /run/glider/live on HOST, else here]")
@click.option("--port", default=8765, show_default=True, type=click.IntRange(0, 65535), help="On 127.0.0.1.")
@click.option("--layout", type=click.Path(path_type=Path, dir_okay=False), help="Write Foxglove's layout and stop.")
def live(host: str | None, path: str | None, port: int, layout: Path | None) -> None:
    """Show a flight that was started with --live in Foxglove: depth, attitude, references, commands, faults, events.

    In Foxglove: open connection, ws://localhost:8765; import the layout that --layout writes. HOST is what ssh knows,
    user@glider; without it a flight on this computer is shown. Ends with the flight, or by Ctrl-C; the flight does not
    notice.
    """
    from glider.hal.heartbeat import run_folder
    from glider.tools.flight import live_view

    if layout is not None:
        if layout.exists():
            raise InputError("is there already", source=layout)
        layout.write_text(live_view.layout(), encoding="utf-8")
        return
    need("live")
    with (
        _reach(host, path or ONBOARD)
        if host
        else contextlib.nullcontext(Path(path) if path else run_folder() / live_view.NAME) as socket
    ):
        line = live_view.LogLine(socket)
        view = live_view.View(line, port)
        say(f"{line.metadata.get('mission', 'a flight')}: ws://localhost:{view.server.port}")
        try:
            for record in line.records():
                view.show(record)
        except ValueError as error:
            fail(f"glider: {socket}: {error}")
        except KeyboardInterrupt:
            raise SystemExit(DONE) from None
        finally:
            view.close()
            line.close()
    say("the flight has ended")


@contextlib.contextmanager
def _reach(host: str, path: str) -> Iterator[Path]:
    """A socket here that leads to one there; exit 1 where ssh does not get there."""
    from glider.tools.data.remote import RemoteError
    from glider.tools.data.remote import host as connect

    try:
        with connect(host) as vehicle, tempfile.TemporaryDirectory(prefix="glider-live-") as folder:
            here = Path(folder, "live")
            with subprocess.Popen(vehicle.forward(here, path), stdin=subprocess.DEVNULL) as tunnel:
                end = time.monotonic() + FORWARD_S
                while not here.exists() and tunnel.poll() is None and time.monotonic() < end:
                    time.sleep(0.02)
                try:
                    yield here
                finally:
                    tunnel.terminate()
    except RemoteError as error:
        fail(f"glider: {error}")
