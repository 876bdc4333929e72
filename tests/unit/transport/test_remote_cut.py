"""A cable that is pulled while files go over: said as a lost connection, whatever was held back for writing."""

import pytest

from glider.tools.data.remote import RemoteError, RemoteHost

CUT = """#!/bin/sh
for line in "$@"; do :; done
case "$line" in *head*) head -c {bytes} >/dev/null; exit 255 ;; *) exec sh -c "$line" ;; esac
"""


@pytest.mark.parametrize("taken", [0, 1, 5000, 100_000])
@pytest.mark.parametrize("sizes", [(3,), (200_000, 3), (70_000, 6000)])
def test_a_cut_while_files_go_over_is_a_lost_connection(taken, sizes, tmp_path, monkeypatch):
    ssh = tmp_path / "ssh"
    ssh.write_text(CUT.format(bytes=taken))
    ssh.chmod(0o700)
    monkeypatch.setenv("GLIDER_SSH", str(ssh))
    files = {}
    for n, size in enumerate(sizes):
        path = tmp_path / f"file{n}"
        path.write_bytes(b"x" * size)
        files[path] = str(tmp_path / "there" / f"file{n}")
    for _ in range(5):  # whether the pipe is closed before the last write or behind it is chance
        with pytest.raises(RemoteError) as told:
            RemoteHost("vehicle", tmp_path).put(files)
        assert told.value.lost
