"""A disk that refuses for a while: an error that ends has lost nothing. The errors are the kernel's own."""

import os
import resource

import pytest

from glider.hal.recorder import disk


@pytest.fixture
def limit():
    """Sets the largest file this process may write, as a full disk would."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (hard if size is None else size, hard))
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_what_a_full_disk_refused_is_there_once_it_has_room(tmp_path, limit):
    path = tmp_path / "x"
    file = disk.DiskFile(disk.create(str(path)))
    file.write(b"a" * 1000)
    assert file.sync()
    limit(1500)
    file.write(b"b" * 1000)
    for tries in range(1, 4):
        assert not file.sync()
        assert (file.errors, file.last_errno != 0) == (tries, True)
        file.write(b"c" * 10)
    assert file.tell() == 2030
    limit(None)
    assert file.sync()
    assert (file.errors, file.last_errno) == (3, 0)
    assert path.read_bytes() == b"a" * 1000 + b"b" * 1000 + b"c" * 30


def test_memory_has_a_bound(tmp_path, limit):
    file = disk.DiskFile(disk.create(str(tmp_path / "x")))
    limit(0)
    assert not file.full
    file.write(b"x" * (disk.KEPT_BYTES + 1))
    assert not file.sync()
    assert file.full
    limit(None)
    assert file.sync()
    assert not file.full


def test_nothing_is_written_over(tmp_path):
    path = tmp_path / "x"
    path.write_text("precious")
    with pytest.raises(FileExistsError):
        disk.create(str(path))
    assert path.read_text() == "precious"


@pytest.mark.parametrize("keep", [True, False])
def test_a_file_not_worth_keeping_disappears(tmp_path, keep):
    path = tmp_path / "x"
    disk.close(disk.create(str(path)), str(path), keep=keep)
    assert os.path.exists(path) == keep
