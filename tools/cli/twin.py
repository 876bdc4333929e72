"""`glider twin`: wire-level twins of a board's devices on virtual serial ports, flown by the simulated plant."""

import asyncio
import signal
import tempfile
from pathlib import Path

import click

from glider.tools.cli.common import say
from glider.tools.data.errors import InputError, need


@click.command()
@click.option("--board", default="twin", show_default=True, help="Board: shipped name or file of real devices.")
@click.option("--vehicle", default="roughie", show_default=True, help="Vehicle: shipped name or file.")
@click.option("--dir", "folder", type=click.Path(path_type=Path, file_okay=False), help="Folder for the ports.")
@click.option("--seed", default=0, show_default=True, type=click.IntRange(0), help="Seed of everything random.")
@click.option("--stand", is_flag=True, help="Keep the vehicle on its stand: only the actuators move.")
@click.option("--fault", "faults", multiple=True, metavar="'DEVICE KIND [N]'", help="Begin with a fault.")
@click.option("--print-sim", is_flag=True, help="Print the simulated board of the same rates and delays, and stop.")
def twin(board, vehicle, folder, seed, stand, faults, print_sim) -> None:
    """Start twins of a board's devices and leave them running until Ctrl-C or `quit`.

    Every port of the board file gets a virtual one of the same name in the folder, and board.toml there is the board
    file with these ports: other programs, `glider bench` or `glider fly` among them, use it as if it were real. The
    vehicle stands still until the servo is first commanded. Commands on standard input or the socket `control`:
    `help` lists them.
    """
    from glider.hal.board import BoardError
    from glider.sim_backend.twins.boardfile import decode_twin_file, simulated_board
    from glider.sim_backend.twins.service import TwinService, replaced_ports
    from glider.tools.data.boards import load_board_file
    from glider.tools.data.sources import load_vehicle
    from glider.tools.data.tomltext import toml_text

    found = load_board_file(board)
    if found.kind == "sim":
        raise InputError("a simulated board has no wires; name one of kind devices or twin", source=board)
    file = decode_twin_file(found.text, found.source)
    if print_sim:
        click.echo(toml_text(simulated_board(file), inline=("sensors",)), nl=False)
        return
    need("bench")
    from glider.tools.bench.boardtext import set_ports, set_values

    the_vehicle = load_vehicle(vehicle)
    folder = Path(tempfile.mkdtemp(prefix="glider-twin-")) if folder is None else folder
    folder.mkdir(parents=True, exist_ok=True)
    folder = folder.resolve()
    if len(str(folder)) > 90:
        raise InputError("too long a path for a socket in it", source=folder)
    board_text = set_ports(found.text, {name: str(folder / name) for name in file.port})
    board_text = set_values(board_text, {"armed_depth_m": file.start.depth_m})  # where the plant floats before it dives
    (folder / "board.toml").write_text(board_text, encoding="utf-8")

    async def serve() -> None:
        service = TwinService(replaced_ports(file, folder), found.source, the_vehicle, folder, seed, let_go=not stand)
        for fault in faults:
            said = service.command(f"fault {fault}")
            if said != "ok":
                raise InputError(said.removeprefix("error: "), source="--fault")
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            loop.add_signal_handler(number, service.stop)
        service.plant.step()

        def ready() -> None:
            for name in sorted(file.port):
                click.echo(folder / name)
            say(f"twins of {found.source} are there; their board file: {folder / 'board.toml'}; Ctrl-C ends them")

        stdin = asyncio.create_task(service.obey_stdin(end_stops=False, answer=click.echo))
        await service.run(ready)
        stdin.cancel()

    try:
        asyncio.run(serve())
    except BoardError as error:
        raise InputError(str(error), source=board) from None
