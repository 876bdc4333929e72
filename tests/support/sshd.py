"""A real sshd on the loopback, for whoever runs the tests: keys, settings and the way to it in one folder."""

import os
import shutil
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

SSHD = shutil.which("sshd", path=f"{os.environ.get('PATH', '')}:/usr/sbin:/usr/local/sbin")
NAME = "vehicle"  # what ssh calls it
# Passes a connection on, and breaks it off after so many bytes there or back: a cable that is pulled.
CABLE = """
import os, select, socket, sys
line = socket.create_connection(("127.0.0.1", int(sys.argv[1])))
left = {0: int(sys.argv[2]), line: int(sys.argv[3])}
while True:
    ready, _, _ = select.select([0, line], [], [])
    for one in ready:
        data = os.read(0, 65536) if one == 0 else line.recv(65536)
        left[one] -= len(data)
        if not data or left[one] < 0:
            sys.exit()
        line.sendall(data) if one == 0 else os.write(1, data)
"""


class Server:
    """`reached`: the environment in which ssh reaches it, over a cable that holds for so many bytes there and back."""

    def __init__(self, folder: Path, port: int):
        self.folder, self.port = folder, port
        (folder / "cable.py").write_text(CABLE)

    def reached(self, there: int = 1 << 60, back: int = 1 << 60) -> dict[str, str]:
        config = self.folder / f"config-{there}-{back}"
        config.write_text(
            f"Host {NAME}\n HostName 127.0.0.1\n IdentityFile {self.folder}/key\n IdentitiesOnly yes\n"
            f" UserKnownHostsFile {self.folder}/known\n StrictHostKeyChecking accept-new\n LogLevel ERROR\n"
            f" ProxyCommand {sys.executable} {self.folder}/cable.py {self.port} {there} {back}\n"
        )
        return {**os.environ, "GLIDER_SSH": f"ssh -F {config}"}


@contextmanager
def sshd(folder: Path):
    if SSHD is None or shutil.which("ssh") is None:
        pytest.skip("no sshd here (openssh-server)")
    if os.getuid() == 0:
        Path("/run/sshd").mkdir(exist_ok=True)  # where it separates its privileges; its service makes it elsewhere
    for name in ("host", "key"):
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", folder / name], check=True)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    (folder / "sshd_config").write_text(
        f"Port {port}\nListenAddress 127.0.0.1\nHostKey {folder}/host\nAuthorizedKeysFile {folder}/key.pub\n"
        "StrictModes no\nUsePAM no\nPidFile none\nPasswordAuthentication no\nPermitRootLogin prohibit-password\n"
    )
    command = [SSHD, "-D", "-f", folder / "sshd_config", "-E", folder / "sshd.log"]
    with subprocess.Popen(command) as process:
        try:
            for _ in range(500):
                with socket.socket() as line:
                    if line.connect_ex(("127.0.0.1", port)) == 0:
                        break
                assert process.poll() is None, (folder / "sshd.log").read_text()
                time.sleep(0.02)
            yield Server(folder, port)
        finally:
            process.terminate()
