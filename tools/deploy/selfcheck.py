"""`python -m glider.tools.deploy.selfcheck`: is this release fit to take over on the glider's computer?

Asked of a release that is installed beside the one that flies, before it is switched to. It changes nothing but its
own kernels' cache: no port is opened, and what flies goes on.
"""

import argparse
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable
from pathlib import Path

from glider.hal.state_file import StateFile
from glider.tools.cli.common import DONE, FAILED, progress, say

READY_S = 20.0  # for the out-of-band process to say READY=1 and feed the watchdog
FLIGHT_S = 300.0
PLAIN_PATIENCE = 10.0  # times as long as plain Python: in an emulator, beside other work
PLUNGE = """format = 1
name = "selfcheck"
time_limit_s = 60.0
[site]
name = "simulated pool"
depth_m = 6.0
[[leg]]
duration_s = 4.0
pitch_deg = -20.0
ballast_kg = 0.05
"""


class Unfit(RuntimeError):
    """What a release cannot do; str() says it in a line."""


def see_state(folder: Path) -> str:
    """Nobody is to be brought up: the process that does would be replaced under way."""
    if not folder.is_dir():
        return "none yet"
    found = StateFile(folder).read()
    if found.state.must_ascend:
        raise Unfit(f"{folder}: {found.describe()}; bring it up and look at it first")
    return found.state.name.lower()


def see_kernels(plain: bool) -> str:
    """Compiled for this release, so that its first flight need not; as plain Python only where that is asked for."""
    from glider.firmware.core.jit import CACHE_DIR
    from glider.tools.flight.precompile import FLIGHT, ensure_compiled

    if CACHE_DIR is None and not plain:
        raise Unfit("plain Python (GLIDER_JIT=0) is too slow to fly with")
    ensure_compiled(FLIGHT, say, progress)
    return "plain Python (GLIDER_JIT=0)" if CACHE_DIR is None else str(CACHE_DIR)


def see_files(folder: Path) -> str:
    """The vehicle's own board, vehicle and missions are read, and go together: a newer version may be stricter."""
    from glider.tools.flight.compose import build_flight

    board, vehicle = folder / "board.toml", folder / "vehicle.toml"
    missions = [path for path in sorted(folder.glob("*.toml")) if "leg" in tomllib.loads(path.read_text())]
    for mission in missions:
        build_flight(mission=str(mission), vehicle=str(vehicle), board=str(board))
    return f"{len(missions)} missions" if missions else "no mission yet"


def flight_command(mission: str, log: str) -> list[str]:
    """The flight's words, behind `glider`."""
    return ["fly", "--json", "--mission", mission, "--log", log]


def see_flight(kept: Path | None, patience: float) -> str:
    """A short flight on the simulated board, recorded and read back; its log stays where `kept` says."""
    from glider.tools.data.log.reader import read_log

    with tempfile.TemporaryDirectory() as folder:
        mission, log = Path(folder, "selfcheck.toml"), kept or Path(folder, "selfcheck.mcap")
        mission.write_text(PLUNGE)
        log.unlink(missing_ok=True)
        command = [sys.executable, "-m", "glider.tools.cli.main", *flight_command(str(mission), str(log))]
        done = subprocess.run(command, capture_output=True, text=True, timeout=patience * FLIGHT_S)
        try:
            result = json.loads(done.stdout)
        except ValueError:
            raise Unfit((done.stderr.strip().splitlines() or ["it said nothing"])[-1]) from None
        if done.returncode or not read_log(log).complete:
            raise Unfit(result["reason"] or "its log is not complete")
    return f"{result['ticks']} ticks, log complete"


def see_out_of_band(patience: float) -> str:
    """The process that brings the vehicle up starts, feeds systemd's watchdog and ends in order."""
    with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as line:
        line.bind(f"{folder}/notify")
        line.settimeout(patience * READY_S)
        command = [sys.executable, "-m", "glider.hal.outofband", "--service", "--run", folder, "--state", folder]
        environment = {**os.environ, "NOTIFY_SOCKET": f"{folder}/notify"}
        with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) as process:
            try:
                missing = {"READY=1", "WATCHDOG=1"}
                while missing:
                    missing.discard(line.recv(1000).decode())
            except TimeoutError:
                raise Unfit(f"no {' and '.join(sorted(missing))} within {patience * READY_S:g} s") from None
            finally:
                process.send_signal(signal.SIGTERM)
                process.communicate(timeout=patience * 10.0)
        if process.returncode:
            raise Unfit(f"exit code {process.returncode}")
    return "starts, feeds the watchdog, ends"


def main() -> int:
    """Every check, a line each; exit 1 where one fails."""
    from glider.hal.ports import BoardError
    from glider.hal.strict import ConfigError
    from glider.tools.data.errors import InputError

    parser = argparse.ArgumentParser(prog="python -m glider.tools.deploy.selfcheck", description=__doc__)
    parser.add_argument("--files", type=Path, required=True, help="folder of board.toml, vehicle.toml, missions")
    parser.add_argument("--state", type=Path, required=True, help="folder of the vehicle's state")
    look = "as plain Python, with patience, for a look: never on a vehicle; LOG: its flight's"
    parser.add_argument("--plain", type=Path, metavar="LOG", help=look)
    options = parser.parse_args()
    plain: Path | None = options.plain
    patience = 1.0 if plain is None else PLAIN_PATIENCE
    checks: tuple[tuple[str, Callable[[], str]], ...] = (
        ("state", lambda: see_state(options.state)), ("files", lambda: see_files(options.files)),
        ("out of band", lambda: see_out_of_band(patience)), ("kernels", lambda: see_kernels(plain is not None)),
        ("flight", lambda: see_flight(plain, patience)),
    )  # fmt: skip
    for name, check in checks:
        try:
            say(f"self-check: {name}: {check()}")
        except (Unfit, InputError, ConfigError, BoardError, OSError, subprocess.TimeoutExpired) as error:
            say(f"self-check: {name}: FAILED: {error}")
            return FAILED
    return DONE


if __name__ == "__main__":
    sys.exit(main())
