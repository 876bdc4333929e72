"""Board files are changed as their writer would: comments and order stay, the old one is kept, never half a file."""

import pytest

from glider.hal.boardfile import calibration_hash, decode_device_file
from glider.hal.strict import ConfigError
from glider.tools.bench.boardtext import accepted, keep_old, set_ports, set_values
from tests.unit.hal.test_boardfile import TEXT, TWIN


def test_only_what_is_set_changes():
    changed = set_values(TEXT, {"slider_wire.zero": 12010.5, "imu.mount_deg": (1.0, -2.0, 0.0)})
    old, new = TEXT.splitlines(), changed.splitlines()
    assert len(old) == len(new)
    assert [line for line, before in zip(new, old, strict=True) if line != before] == [
        "mount_deg = [1.0, -2.0, 0.0]     # roll, pitch, yaw of the sensor in the level hull; the bench's `zero imu`",
        "zero = 12010.5",
    ]


def test_an_accepted_file_has_its_own_hash():
    file = decode_device_file(accepted(TEXT, "board.toml"), "board.toml")
    assert file.calibration == calibration_hash(file)


def test_a_change_that_makes_no_good_file_is_refused():
    with pytest.raises(ConfigError, match="per_m"):
        accepted(set_values(TEXT, {"slider_wire.per_m": 0.0}), "board.toml")


def test_old_files_are_all_kept(tmp_path):
    path = tmp_path / "board.toml"
    for number in range(3):
        path.write_text(f"version {number}")
        assert keep_old(path).name == f"board.toml.{number + 1}"
        path.write_text(f"version {number + 1}")
    assert sorted(file.read_text() for file in tmp_path.glob("board.toml.*")) == ["version 0", "version 1", "version 2"]
    assert path.read_text() == "version 3"
    assert len(list(tmp_path.iterdir())) == 4


def test_a_twins_file_with_real_ports_is_a_device_file():
    names = ("imu", "servo", "sensors", "drives")
    file = decode_device_file(set_ports(TWIN, {name: f"/tmp/p/{name}" for name in names}), "board.toml")
    assert file.port["imu"].path == "/tmp/p/imu"
    assert file.calibration == calibration_hash(file)
