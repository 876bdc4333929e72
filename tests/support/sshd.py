"""A real sshd on the loopback: keys, settings and the way to it in one folder.

Who logs in is whoever runs the tests, or, where root does and may mount, an account made for it: of its own home and
Python, in a namespace of the server's, so that this machine knows of no new user.
"""

import os
import pwd
import shutil
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import dataclass
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


PILOT, PILOT_ID = "glider-pilot", 61437
# What the server sees: accounts with one more, its home, and this Python, which may lie where only root looks.
AN_ACCOUNT = """
mount -t tmpfs -o mode=755 tmpfs /mnt
mkdir /mnt/pilot /mnt/python
mount --bind "$1/home" /mnt/pilot
mount --bind "$2" /mnt/python
mount --bind "$1/passwd" /etc/passwd
mount --bind "$1/group" /etc/group
shift 2
exec "$@"
"""


@dataclass(frozen=True)
class Account:
    """Who logs in: user's number, home as it is seen here and there, and Python there."""

    user: int
    home: Path
    home_there: str
    python_there: str


class Server:
    """`reached`: the environment in which ssh reaches it, over a cable that holds for so many bytes there and back."""

    def __init__(self, folder: Path, port: int, account: Account):
        self.folder, self.port, self.account = folder, port, account
        (folder / "cable.py").write_text(CABLE)

    def reached(self, there: int = 1 << 60, back: int = 1 << 60) -> dict[str, str]:
        config = self.folder / f"config-{there}-{back}"
        config.write_text(
            f"Host {NAME}\n HostName 127.0.0.1\n User {login_name(self.account.user)}\n"
            f" IdentityFile {self.folder}/key\n IdentitiesOnly yes\n"
            f" UserKnownHostsFile {self.folder}/known\n StrictHostKeyChecking accept-new\n LogLevel ERROR\n"
            f" ProxyCommand {sys.executable} {self.folder}/cable.py {self.port} {there} {back}\n"
        )
        return {**os.environ, "GLIDER_SSH": f"ssh -F {config}"}


def login_name(user: int) -> str:
    return PILOT if user == PILOT_ID else pwd.getpwuid(user).pw_name


def may_mount() -> bool:
    mount = ["unshare", "--mount", "mount", "-t", "tmpfs", "tmpfs", "/mnt"]
    return os.getuid() == 0 and subprocess.run(mount).returncode == 0


def new_account(folder: Path) -> Account:
    """A user of its own, as the server will see it."""
    home = folder / "home"
    (home / ".ssh").mkdir(parents=True)
    shutil.copy(folder / "key.pub", home / ".ssh" / "authorized_keys")
    for path in (home, home / ".ssh", home / ".ssh" / "authorized_keys"):
        os.chown(path, PILOT_ID, PILOT_ID)
    lines = {"passwd": f"{PILOT}:*:{PILOT_ID}:{PILOT_ID}::/mnt/pilot:/bin/sh", "group": f"{PILOT}:x:{PILOT_ID}:"}
    for name, line in lines.items():
        (folder / name).write_text(f"{Path('/etc', name).read_text()}{line}\n")
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    return Account(PILOT_ID, home, "/mnt/pilot", f"/mnt/python/bin/python{version}")


def own_account(folder: Path) -> Account:
    """Whoever runs the tests, in a folder of his own."""
    (folder / "home").mkdir()
    return Account(os.getuid(), folder / "home", str(folder / "home"), sys.executable)


@contextmanager
def sshd(folder: Path, *, apart: bool = False):
    """`apart`: an account made for it, where that can be."""
    if SSHD is None or shutil.which("ssh") is None:
        pytest.skip("no sshd here (openssh-server)")
    if os.getuid() == 0:
        Path("/run/sshd").mkdir(exist_ok=True)  # where it separates its privileges; its service makes it elsewhere
    for name in ("host", "key"):
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", folder / name], check=True)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    apart = apart and may_mount()
    account = new_account(folder) if apart else own_account(folder)
    keys = ".ssh/authorized_keys" if apart else folder / "key.pub"
    (folder / "sshd_config").write_text(
        f"Port {port}\nListenAddress 127.0.0.1\nHostKey {folder}/host\nAuthorizedKeysFile {keys}\n"
        "StrictModes no\nUsePAM no\nPidFile none\nPasswordAuthentication no\nPermitRootLogin prohibit-password\n"
        # No start-up file of whoever runs the tests: some take a second a login.
        + ("" if apart else f"SetEnv HOME={account.home_there}\n")
    )
    command = [SSHD, "-D", "-f", folder / "sshd_config", "-E", folder / "sshd.log"]
    if apart:
        command = ["unshare", "--mount", "sh", "-ec", AN_ACCOUNT, "sh", folder, sys.base_prefix, *command]
    with subprocess.Popen(command) as process:
        try:
            for _ in range(500):
                with socket.socket() as line:
                    if line.connect_ex(("127.0.0.1", port)) == 0:
                        break
                assert process.poll() is None, (folder / "sshd.log").read_text()
                time.sleep(0.02)
            yield Server(folder, port, account)
        finally:
            process.terminate()
