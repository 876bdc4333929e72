"""The twinned board: the real drivers, on virtual ports behind which twins answer and the plant moves."""

import contextlib
import json
import select
import shutil
import socket
import subprocess
import tempfile
from pathlib import Path

import msgspec

from glider.hal.board import BoardRequest
from glider.hal.devices import DeviceBoard
from glider.hal.ports import Board, BoardError, Hardware
from glider.hal.spawn import module_command, module_environment
from glider.sim_backend.twins.boardfile import TwinFile, decode_twin_file
from glider.sim_backend.twins.service import replaced_ports

START_S = 180.0  # for the twins to be there, their kernels compiled


class TwinBoard(DeviceBoard):
    """A board of kind "twin". `control` tells the twins what to do; `state` is the plant's truth."""

    hardware = Hardware.TWINNED

    def __init__(self, file: TwinFile, request: BoardRequest):
        self.folder = Path(tempfile.mkdtemp(prefix="glider-twin-"))
        self._request = request
        self._process: subprocess.Popen[bytes] | None = None
        self._last_state: dict[str, float] = {}
        super().__init__(replaced_ports(file, self.folder), request.source, request.vehicle, request.water_density)
        self.name, self.armed_depth = "twin", file.start.depth_m

    def connect(self) -> None:
        """Start the twins, then open their ports."""
        request = self._request
        config = {
            "text": request.text, "source": request.source, "folder": str(self.folder), "seed": request.seed,
            "effects": request.effects, "site_depth": request.site_depth,
            "vehicle": msgspec.to_builtins(request.vehicle),
        }  # fmt: skip
        self._process = subprocess.Popen(
            module_command("glider.sim_backend.twins.service"), stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            start_new_session=True, env=module_environment(),
        )  # fmt: skip
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(config).encode() + b"\n")
        self._process.stdin.flush()
        ready, _, _ = select.select([self._process.stdout], [], [], START_S)
        if not ready or not self._process.stdout.readline():
            self.close()
            raise BoardError("the twins did not start")
        super().connect()

    connect_available = connect  # the twins have to be started

    def control(self, command: str) -> str:
        """A command to the twins, and their answer; BoardError where they are gone."""
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as line:
                line.settimeout(5.0)
                line.connect(str(self.folder / "control"))
                line.sendall(command.encode() + b"\n")
                return line.makefile().readline().strip()
        except OSError as error:
            raise BoardError(f"the twins do not answer: {error}") from None

    def state(self) -> dict[str, float]:
        """Where the plant is; after closing, where it was then."""
        if self._process is not None and self._process.poll() is None:
            self._last_state = json.loads(self.control("state"))
        return self._last_state

    def close(self, *, stop: bool = False) -> None:
        """As any board; the twins end with it."""
        process = self._process
        if process is not None:
            with contextlib.suppress(BoardError, ValueError):
                self.state()
            super().close(stop=stop)
            self._process = None
            for pipe in (process.stdin, process.stdout):
                assert pipe is not None
                pipe.close()
            try:
                process.wait(5.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)


def build_board(request: BoardRequest) -> Board:
    """A twinned board from its file's text."""
    return TwinBoard(decode_twin_file(request.text, request.source), request)
