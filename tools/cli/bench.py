"""`glider bench`: the serial bench console."""

import sys
from pathlib import Path

import click

from glider.tools.data.errors import InputError, need


@click.command()
@click.option("--board", required=True, help="Board file (or shipped name: twin).")
@click.option("--vehicle", default="roughie", show_default=True, help="Vehicle: shipped name or file.")
@click.option("--script", type=click.Path(path_type=Path), help="Run the commands of this file, then leave.")
@click.option("--out", type=click.Path(path_type=Path), default=Path("."), help="Folder for sweeps.")
def bench(board: str, vehicle: str, script: Path | None, out: Path) -> None:
    """Read, jog, sweep and calibrate the devices of a board.

    At a terminal a prompt with completion and history (kept in the file that GLIDER_BENCH_HISTORY names); commands from
    --script or from a pipe run until one fails. Nothing moves before `enable`, limits always hold, and losing the
    console stops the actuators. Exit code 1: a command of a script failed; 2: one was not understood.
    """
    need("bench")
    from glider.tools.bench.client import Bench
    from glider.tools.bench.console import Console, hang_up_ends
    from glider.tools.data.boards import load_board_file
    from glider.tools.data.sources import load_vehicle, read_text

    load_vehicle(vehicle)
    found = load_board_file(board)
    if found.kind == "sim":
        raise InputError("a simulated board has no devices; try --board twin", source=board)
    path = Path(board) if Path(board).is_file() else None
    lines = read_text(script).splitlines() if script is not None else None
    out.mkdir(parents=True, exist_ok=True)
    hang_up_ends()
    with Bench(found.text, found.source, found.kind, vehicle, path) as the_bench:
        console = Console(the_bench, out)
        if lines is not None:
            code = console.run_lines(iter(lines), str(script))
        elif sys.stdin.isatty():
            code = console.run_prompt()
        else:
            code = console.run_lines(sys.stdin, "standard input")
    raise SystemExit(code)
