"""Bytes in order onto a disk that may refuse for a while: an error that ends has lost nothing."""

import errno
import os

KEPT_BYTES = 32_000_000  # kept while the disk refuses: about twenty minutes of flight


class DiskFile:
    """What a writer of MCAP needs of a file (write, tell, flush), and `sync`, which is when the disk is touched.

    What no fsync has confirmed is kept in memory: a failed fsync may have thrown the pages away, so all of it is
    written again, at its own place, the next time.
    """

    def __init__(self, fd: int):
        self._fd = fd
        self._kept = bytearray()  # everything after `_safe`
        self._safe = 0  # bytes known to be on the disk
        self.errors = 0
        self.last_errno = 0  # 0 while the disk is well

    def write(self, data: bytes) -> int:
        """Take bytes; touches no disk and never fails."""
        self._kept += data
        return len(data)

    def tell(self) -> int:
        """Bytes taken so far."""
        return self._safe + len(self._kept)

    def flush(self) -> None:
        """Part of the surface an MCAP writer expects; the disk is touched by `sync` alone."""

    @property
    def full(self) -> bool:
        """Whether so much is waiting that no more should be given."""
        return len(self._kept) > KEPT_BYTES

    def sync(self) -> bool:
        """Bring everything to the disk; False (and `errors`, `last_errno`) where it refused: call again later."""
        try:
            with memoryview(self._kept) as kept:
                done = 0
                while done < len(kept):
                    count = os.pwrite(self._fd, kept[done:], self._safe + done)
                    if count == 0:
                        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                    done += count
            os.fsync(self._fd)
        except OSError as error:
            self.errors += 1
            self.last_errno = error.errno or errno.EIO
            return False
        self._safe += len(self._kept)
        self._kept.clear()
        self.last_errno = 0
        return True


def create(path: str) -> int:
    """A new file's descriptor, its name on the disk already; FileExistsError rather than writing over one."""
    fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_CLOEXEC", 0), 0o644)
    folder = os.open(os.path.dirname(os.path.abspath(path)), os.O_RDONLY)
    try:
        os.fsync(folder)
    except OSError:
        pass  # not every file system lets a folder be synchronised; the file itself is, and says so if it can't
    finally:
        os.close(folder)
    return fd


def close(fd: int, path: str, *, keep: bool) -> None:
    """Close a file of `create`; one that is not worth keeping disappears."""
    os.close(fd)
    if not keep:
        os.unlink(path)
