"""A computer that ssh reaches: commands on it, files to and from it, each going on where a broken connection left it.

Nothing is needed over there but a shell, coreutils and sshd. GLIDER_SSH names another ssh, with its options.
"""

import contextlib
import hashlib
import os
import shlex
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

PART = ".part"  # of a file that is not here as a whole, or not proved
PIECE = 1 << 18  # bytes read at once
LOST = 255  # ssh's own exit code; others are those of the command
OPTIONS = ("-o", "ServerAliveInterval=5", "-o", "ServerAliveCountMax=3")  # a dead line is noticed within 15 s

Progress = Callable[[int], None]


class RemoteError(RuntimeError):
    """What went wrong over there, in one line; `lost`: the connection, so that trying again may help."""

    def __init__(self, message: str, *, lost: bool = False):
        super().__init__(message)
        self.lost = lost


class RemoteHost:
    """A connection; `with remote.host(NAME) as vehicle`."""

    def __init__(self, name: str, folder: Path):
        self.name = name
        self._own = shlex.split(os.environ.get("GLIDER_SSH", "")) or ["ssh"]
        self._folder = folder
        self._ssh = [*self._own, *OPTIONS, "-o", f"ControlPath={folder}/%C"]

    def connect(self) -> None:
        """One connection for all commands to come, so that a password is asked for once; RemoteError without one."""
        said = self._folder / "said"
        with said.open("w") as file:  # the connection stays in the background: it would hold a pipe open
            command = [*self._ssh, "-o", "ControlMaster=yes", "-o", "ControlPersist=30", "--", self.name, "true"]
            done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=file)
        if done.returncode:
            raise self._error(done.returncode, said.read_text(errors="replace"))

    def disconnect(self) -> None:
        """Give it up."""
        command = [*self._ssh, "-O", "exit", "--", self.name]
        subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=20)

    def command(self, line: str, *, tty: bool = False) -> list[str]:
        """The words that run a shell's line over there."""
        return [*self._ssh, *(["-t"] if tty else []), "--", self.name, line]

    def forward(self, here: Path, there: str) -> list[str]:
        """The words that lead a socket here to one over there, for as long as they run; a connection of its own."""
        words = ["-S", "none", "-N", "-o", "ExitOnForwardFailure=yes", "-L", f"{here}:{there}", "--", self.name]
        return [*self._own, *OPTIONS, *words]

    def run(self, line: str) -> str:
        """A shell's line; what it printed. RemoteError with its last line where it failed."""
        done = subprocess.run(self.command(line), capture_output=True, text=True, stdin=subprocess.DEVNULL)
        if done.returncode:
            raise self._error(done.returncode, done.stderr)
        return done.stdout

    def put(self, files: dict[Path, str], progress: Progress = lambda n: None) -> None:
        """Bring files to their paths there, behind what is there of each, in one go; proved by `found` afterwards."""
        there = self.found(list(files.values()))
        parts = [(local, path, _kept(local, there.get(path))) for local, path in files.items()]
        parts = [(local, path, kept) for local, path, kept in parts if kept < local.stat().st_size or path not in there]
        folders = {os.path.dirname(path) or "." for _, path, _ in parts}
        lines = [f"mkdir -p {' '.join(map(shlex.quote, sorted(folders)))}"] if parts else []
        for local, path, kept in parts:
            lines.append(f"head -c {local.stat().st_size - kept} >{'>' if kept else ''}{shlex.quote(path)}")
        progress(sum(local.stat().st_size for local in files) - sum(p.stat().st_size - kept for p, _, kept in parts))
        if not parts:
            return
        with subprocess.Popen(
            self.command(" && ".join(lines)), stdin=subprocess.PIPE, stderr=subprocess.PIPE
        ) as process:
            assert process.stdin is not None
            assert process.stderr is not None
            with contextlib.suppress(BrokenPipeError):  # its exit code says why
                for local, _, kept in parts:
                    with local.open("rb") as file:
                        file.seek(kept)
                        while piece := file.read(PIECE):
                            process.stdin.write(piece)
                            progress(len(piece))
            with contextlib.suppress(BrokenPipeError):  # what it still held of the last piece
                process.stdin.close()
            said = process.stderr.read().decode(errors="replace")
        if process.returncode:
            raise self._error(process.returncode, said)

    def found(self, paths: list[str]) -> dict[str, tuple[int, str]]:
        """Size and SHA-256 of those files that are there."""
        quoted = " ".join(map(shlex.quote, paths))
        said = self.run(f'for f in {quoted}; do [ -f "$f" ] && wc -c <"$f" && sha256sum <"$f" && echo "$f"; done; true')
        words = iter(said.splitlines())
        return {path: (int(size), digest.split()[0]) for size, digest, path in zip(words, words, words, strict=True)}

    def digest(self, path: str, size: int) -> str:
        """SHA-256 of a file's first `size` bytes, hex."""
        return self.run(f"head -c {size} {shlex.quote(path)} | sha256sum").split()[0]

    def get(self, path: str, local: Path, size: int, progress: Progress = lambda n: None) -> None:
        """Bring a file's first `size` bytes here, behind what `local` has of them; nothing is proved here."""
        have = local.stat().st_size if local.exists() else 0
        progress(have)
        if have >= size:
            return
        line = f"tail -c +{have + 1} {shlex.quote(path)} | head -c {size - have}"
        with (
            local.open("ab") as file,
            subprocess.Popen(
                self.command(line), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE
            ) as process,
        ):
            assert process.stdout is not None
            assert process.stderr is not None
            while piece := process.stdout.read1(PIECE):  # type: ignore[attr-defined]
                file.write(piece)
                progress(len(piece))
            said = process.stderr.read().decode(errors="replace")
        if process.returncode:
            raise self._error(process.returncode, said)
        if local.stat().st_size < size:
            raise RemoteError(f"{self.name}:{path}: cut at byte {local.stat().st_size} of {size}", lost=True)

    def _error(self, code: int, said: str) -> RemoteError:
        last = (said.strip().splitlines() or [f"exit code {code}"])[-1]
        plain = "".join(letter if letter.isprintable() else "?" for letter in last)
        return RemoteError(f"{self.name}: {plain}", lost=code == LOST)


@contextlib.contextmanager
def host(name: str) -> Iterator[RemoteHost]:
    """A computer by the name that ssh knows, USER@HOST or an alias; RemoteError where that is an option or no name."""
    if not name or name.startswith("-") or any(letter.isspace() or not letter.isprintable() for letter in name):
        raise RemoteError(f"{name!r}: not a host")
    with tempfile.TemporaryDirectory(prefix="glider-ssh-") as folder:
        found = RemoteHost(name, Path(folder))
        found.connect()
        try:
            yield found
        finally:
            found.disconnect()


def _kept(local: Path, there: tuple[int, str] | None) -> int:
    """How many bytes of a file need not be brought again: all of what is there, if it is the file's beginning."""
    if there is None or there[0] > local.stat().st_size or there[1] != file_digest(local, there[0]):
        return 0
    return there[0]


def file_digest(path: Path, size: int | None = None) -> str:
    """SHA-256 of a file's first `size` bytes, or of all of it, hex."""
    digest, left = hashlib.sha256(), path.stat().st_size if size is None else size
    with path.open("rb") as file:
        while left > 0 and (piece := file.read(min(PIECE, left))):
            digest.update(piece)
            left -= len(piece)
    return digest.hexdigest()
