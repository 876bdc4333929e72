"""An onboard log where a case is asked for: every command says what to type first."""

import pytest

from tests.support.commands import glider


@pytest.mark.parametrize(
    "command",
    [
        "gap measure X.mcap", "gap readings X.mcap", "gap diagnose X.mcap --out o", "gap watch X.mcap --out o",
        "identify X.mcap", "gap velocity X.mcap --out o",
    ],
)  # fmt: skip
def test_a_log_is_to_be_exported_first(tmp_path, command):
    (tmp_path / "X.mcap").write_bytes(b"\x89MCAP0\r\n")
    done = glider(*command.split(), cwd=tmp_path)
    assert done.returncode == 2
    assert "glider log export X.mcap" in done.stderr.splitlines()[-1]
