"""Files that are whole or not there, and places that are tried before anything is computed for them."""

import contextlib
import errno
import os
import re
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

from glider.tools.data.errors import InputError

UNFINISHED = ".tmp"
LEAST_FREE = 1_000_000  # bytes that a place must have left: an answer with its report and pictures takes less


@contextlib.contextmanager
def whole(*paths: Path) -> Iterator[list[Path]]:
    """Yield temporary paths beside `paths`; renamed to them at the end, removed where anything goes wrong.

    An OSError of the work inside names the file that was to be written.
    """
    temporary = [path.with_name(f".{path.name}.{os.getpid()}{UNFINISHED}") for path in paths]
    try:
        yield temporary
        for part, path in zip(temporary, paths, strict=True):
            os.replace(part, path)
    except (OSError, RuntimeError) as problem:
        error = problem if isinstance(problem, OSError) else of_hdf5(problem)
        names = {str(part): str(path) for part, path in zip(temporary, paths, strict=True)}
        named = names.get(str(error.filename)) or (str(error.filename) if error.filename else str(paths[0]))
        raise OSError(error.errno or errno.EIO, reason(error), named) from problem
    finally:
        for part in temporary:
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)


def of_hdf5(error: RuntimeError) -> OSError:
    """What HDF5 says of the disk in a RuntimeError, as an OSError; the error itself is raised where it says nothing."""
    found = re.search(r"errno = (\d+)", str(error))
    if found is None:
        raise error
    return OSError(int(found[1]), os.strerror(int(found[1])))


def reason(error: OSError) -> str:
    """Why, in the system's words where it has some."""
    return os.strerror(error.errno) if error.errno else str(error)


def require_file(path: Path, most: int | None = None) -> None:
    """InputError where a path is no file, or one of more than `most` bytes."""
    if not path.is_file():
        raise InputError("not a file" if path.exists() else "no such file", source=path)
    if most is not None and path.stat().st_size > most:
        raise InputError(f"longer than {most} bytes", source=path)


def write_bytes(path: Path, data: bytes, *, kept: bool = False) -> None:
    """Write a file, whole or not at all; `kept`: on the disk when this returns."""
    write_files({path: data}, kept=kept)


def write_files(files: Mapping[Path, bytes], *, kept: bool = False) -> None:
    """Write files of one answer: none takes its name before all are written."""
    with whole(*files) as temporary:
        for part, (path, data) in zip(temporary, files.items(), strict=True):
            try:
                with part.open("wb") as file:
                    file.write(data)
                    if kept:
                        file.flush()
                        os.fsync(file.fileno())
            except OSError as error:
                raise OSError(error.errno, reason(error), str(path)) from error


def check_writable(folder: Path) -> None:
    """Raise InputError where a folder, or a new one of this name, cannot take files; asked before computing."""
    there = folder
    while not there.exists() and there != there.parent:
        there = there.parent
    if not there.is_dir():
        raise InputError("not a folder", source=there)
    try:
        with tempfile.TemporaryFile(dir=there, prefix=".glider-"):
            room = os.statvfs(there)
    except OSError as error:
        raise InputError(f"cannot be written to: {reason(error)}", source=there) from None
    free = room.f_bavail * room.f_frsize
    if room.f_blocks and free < LEAST_FREE:
        raise InputError(f"{free / 1e6:.1f} MB free there, less than {LEAST_FREE / 1e6:g} MB: make room", source=there)
