"""Files that are whole or not there; places that are tried before anything is computed for them."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from glider.tools.data import files
from glider.tools.data.errors import InputError
from glider.tools.data.files import check_writable, whole, write_files

TOO_LARGE = """
import resource, sys
from pathlib import Path
from glider.tools.data.files import write_files
resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))
try:
    write_files({Path(sys.argv[1], "small"): b"x", Path(sys.argv[1], "large"): b"x" * 20_000})
except OSError as error:
    print(error.strerror, error.filename)
"""


def test_files_of_one_answer_are_all_there_or_none(tmp_path):
    write_files({tmp_path / "a": b"1", tmp_path / "b": b"2"})
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"a": b"1", "b": b"2"}
    with pytest.raises(OSError, match=os.strerror(errno.ENOENT)) as found:
        write_files({tmp_path / "a": b"3", tmp_path / "nowhere" / "b": b"4"})
    assert found.value.filename == str(tmp_path / "nowhere" / "b")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"a": b"1", "b": b"2"}


def test_a_file_that_does_not_fit_is_named_and_nothing_is_left(tmp_path):
    done = subprocess.run([sys.executable, "-c", TOO_LARGE, str(tmp_path)], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["File", "too", "large", str(tmp_path / "large")]
    assert list(tmp_path.iterdir()) == []


def half(path: Path) -> None:
    """Half a file on a disk that is full then, as a library of pictures says it."""
    with whole(path) as (part,):
        part.write_bytes(b"half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_an_error_without_a_name_gets_that_of_the_file(tmp_path):
    with pytest.raises(OSError, match=os.strerror(errno.ENOSPC)) as found:
        half(tmp_path / "a.png")
    assert found.value.filename == str(tmp_path / "a.png")
    assert list(tmp_path.iterdir()) == []


def test_what_hdf5_says_of_the_disk_is_an_error_of_the_file(tmp_path):
    with pytest.raises(OSError, match=os.strerror(errno.ENOSPC)) as found, whole(tmp_path / "a.nc"):
        raise RuntimeError("Can't decrement id ref count (unable to extend file properly, errno = 28, error message)")
    assert (found.value.errno, found.value.filename) == (errno.ENOSPC, str(tmp_path / "a.nc"))
    with pytest.raises(RuntimeError, match="a defect"), whole(tmp_path / "a.nc"):
        raise RuntimeError("a defect")


def test_a_place_is_tried_and_left_as_it_was(tmp_path):
    check_writable(tmp_path / "new" / "folder")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"file: "):
        check_writable(tmp_path / "file" / "folder")


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no /proc on this machine")
def test_a_place_that_takes_no_files_is_refused():
    with pytest.raises(InputError, match=r"/proc: "):
        check_writable(Path("/proc/answer"))


def test_a_place_without_room_is_refused(tmp_path, monkeypatch):
    free = os.statvfs(tmp_path)
    monkeypatch.setattr(files, "LEAST_FREE", free.f_bavail * free.f_frsize + 10**12)
    with pytest.raises(InputError, match=r"MB .* MB: "):
        check_writable(tmp_path)
