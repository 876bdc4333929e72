"""Logs off the vehicle, over ssh: each goes on where a broken connection left it, and counts only under its check sum.

Nothing is ever deleted or written onboard. Here a log is `NAME.part` until it is whole and proved.
"""

import fnmatch
import os
import shlex
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from glider.tools.data.remote import PART, Progress, RemoteError, RemoteHost, file_digest


@dataclass(frozen=True)
class Fetched:
    """What became of a log: `fetched`, `here` (it was), `grew` (fetched on; it may still be written), or `refused`."""

    name: str
    bytes: int
    became: str
    sha256: str = ""
    message: str = ""


def list_logs(vehicle: RemoteHost, folder: str, patterns: tuple[str, ...]) -> dict[str, int]:
    """Name -> bytes of the logs in a vehicle's folder, by name; RemoteError where there is no such folder."""
    quoted = shlex.quote(folder)
    said = vehicle.run(
        f'cd {quoted} && for f in *.mcap; do [ -f "$f" ] && printf \'%s %s\\n\' "$(wc -c <"$f")" "$f"; done; '
        f"[ -d {quoted} ]"
    )
    sizes = {name: int(size) for size, _, name in (line.partition(" ") for line in said.splitlines())}
    # A name is a name here too: what could lead out of the folder, or steer a terminal, is left alone.
    plain = {name: size for name, size in sizes.items() if PurePosixPath(name).name == name and name.isprintable()}
    wanted = patterns or ("*",)
    chosen = {n: s for n, s in plain.items() if any(fnmatch.fnmatchcase(n, p) or n == f"{p}.mcap" for p in wanted)}
    return dict(sorted(chosen.items()))


def fetch(
    vehicle: RemoteHost, folder: str, sizes: dict[str, int], out: Path,
    tell: Callable[[Fetched], None] = lambda one: None, progress: Progress = lambda n: None,
) -> list[Fetched]:  # fmt: skip
    """Bring logs into a folder here, the shortest first; RemoteError where the connection breaks: call it again."""
    out.mkdir(parents=True, exist_ok=True)
    done = []
    for name, size in sorted(sizes.items(), key=lambda item: item[1]):
        one = _fetch(vehicle, f"{folder}/{name}", size, out / name, progress)
        done.append(one)
        tell(one)
    return done


def _fetch(vehicle: RemoteHost, path: str, size: int, local: Path, progress: Progress) -> Fetched:
    """One log: behind what is here of it, if that is its beginning."""
    part = local.with_name(local.name + PART)
    have = local.stat().st_size if local.exists() else None
    if have is not None:
        if have > size or vehicle.digest(path, have) != file_digest(local):
            message = f"{local} is here and is another one: it stays; name another folder with --out"
            return Fetched(local.name, size, "refused", message=message)
        if have == size:
            progress(size)
            return Fetched(local.name, size, "here", file_digest(local))
        shutil.copyfile(local, part)  # a log that has grown: what is here stays until the longer one is proved
    elif part.exists():
        begun = part.stat().st_size
        if begun > size or vehicle.digest(path, begun) != file_digest(part):
            part.unlink()  # the beginning of another one
    vehicle.get(path, part, size, progress)
    digest = file_digest(part)
    if digest != vehicle.digest(path, size):
        part.unlink()
        return Fetched(
            local.name, size, "refused", message=f"{path}: another check sum than the onboard one: fetch it again"
        )
    with part.open("rb") as file:
        os.fsync(file.fileno())
    part.replace(local)
    return Fetched(local.name, size, "fetched" if have is None else "grew", digest)


__all__ = ["Fetched", "RemoteError", "fetch", "list_logs"]
