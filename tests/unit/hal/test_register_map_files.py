"""Register maps of one's own: what a driver could not read or write as the map says is refused by file and key."""

import subprocess
import sys

import pytest

from glider.hal.boardfile import decode_device_file
from glider.hal.spawn import ROOT
from glider.hal.strict import ConfigError
from tests.support.register_maps import ANALOG, DRIVE, ENCODER, PRESSURE, board_text, write_maps

MAPS = {"drive": DRIVE, "encoder": ENCODER, "analog": ANALOG, "pressure": PRESSURE}
# map, what it has, what it gets instead, what is said
REFUSED = [
    ("drive", 'status = { at = 1, type = "u32"', 'status = { at = 1, type = "f32"',
     "block.status.value.status.type: expected u16, i16, u32, i32, got f32"),
    ("drive", 'status = { at = 1, type = "u32"', 'status = { at = 1, scale = 0.5, type = "u32"',
     "block.status.value.status.scale: expected 1, got 0.5"),
    ("drive", 'at = 1, type = "u32"', 'at = 2, type = "u32"', "value.status: reaches past the block's 3 registers"),
    ("drive", 'at = 2, type = "i32"', 'at = 2, type = "f32"', "block.position.value.position.type: expected u16"),
    ("drive", 'at = 2, type = "u16"', 'at = 1, type = "u32"',
     "block.position_low.value.position.type: expected i16, i32, u16, because block.position has i32, got u32"),
    ("drive", 'at = 2, type = "u16", unit = "counts"', 'at = 2, type = "u16", unit = "counts", scale = 0.5',
     "block.position_low.value.position.scale: expected 1 as in block.position"),
    ("drive", "address = 0x0400\ncount = 11", "address = 0x0400\ncount = 12",
     "block.path.count: register 11 belongs to no value, and the path is written whole"),
    ("drive", 'speed = { at = 2, type = "u32"', 'speed = { at = 1, type = "u32"',
     "block.path.value.speed.at: register 1 is position's too"),
    ("drive", "value.mode", 'value.jerk = { at = 2, type = "u16" }\nvalue.mode',
     "block.path.value.jerk: the driver has nothing to write there; it knows mode, position"),
    ("drive", "auxiliary = 0x0501", "", "word.auxiliary: missing, role 'drive' needs it"),
    ("drive", "clear_alarm = 55", "", "command.clear_alarm: missing, role 'drive' needs it"),
    ("drive", "address = 0x0300", "address = 0xfffe", "count: 5 registers from 0xfffe reach past 0xffff"),
    ("encoder", 'at = 1, type = "i32"', 'at = 1, type = "f32"', "block.all.value.count.type: expected u16"),
    ("analog", "value.channel", "value.input", "block.all.value.channel: missing, role 'analog' needs it"),
    ("pressure", "", "[block.pressure]\naddress = 1\ncount = 1", "block.pressure.value.pressure: missing"),
]  # fmt: skip


def write(folder, name, old, new):
    """The maps, one of them changed; the board file's text."""
    paths = write_maps(folder)
    assert old in MAPS[name]
    (folder / f"{name}.toml").write_text(MAPS[name].replace(old, new, 1) if old else MAPS[name] + new)
    return board_text(paths)


def test_the_maps_are_read_as_they_stand(tmp_path):
    assert decode_device_file(write(tmp_path, "drive", "", ""), "board.toml").slider.rpm == 360


@pytest.mark.parametrize(("name", "old", "new", "said"), REFUSED, ids=[said for *_, said in REFUSED])
def test_what_no_driver_could_do_is_refused_by_file_and_key(tmp_path, name, old, new, said):
    text = write(tmp_path, name, old, new)
    with pytest.raises(ConfigError) as error:
        decode_device_file(text, "board.toml")
    assert str(error.value).startswith(str(tmp_path / f"{name}.toml"))
    assert said in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "old", "new", "board", "said"),
    [
        ("analog", "count = 12", "count = 9", None, "battery.channel: 'other-analog' "),
        ("drive", 'position = { at = 0, type = "i32"', 'position = { at = 0, type = "u32"', None,
         "slider.limits_m: -124000 counts "),
        ("drive", 'position = { at = 2, type = "i32"', 'position = { at = 2, type = "u32"', None,
         "slider.limits_m: -124000 counts "),
        ("drive", 'acceleration = { at = 4, type = "u16"', 'acceleration = { at = 4, scale = 0.001, type = "u16"',
         None, "slider.ramp_ms: 100 ms "),
        ("drive", "", "", ("counts_per_m = 2000000.0", "counts_per_m = 40000000000.0\ncounts_per_rev = 1000000"),
         "slider.limits_m: -2480000000 counts "),
    ],
)  # fmt: skip
def test_numbers_that_the_registers_cannot_hold_are_refused_by_board_file_and_key(
    tmp_path, name, old, new, board, said
):
    text = write(tmp_path, name, old, new)
    if board is not None:
        assert board[0] in text
        text = text.replace(*board, 1).replace("speed_m_s = 0.03", "speed_m_s = 0.0001", 1)
    with pytest.raises(ConfigError) as error:
        decode_device_file(text, "board.toml")
    assert str(error.value).startswith("board.toml")
    assert said in str(error.value)


def test_a_command_that_its_register_cannot_hold_is_refused(tmp_path):
    text = write(tmp_path, "drive", 'mode = { at = 9, type = "u32"', 'mode = { at = 9, type = "i16"')
    path = tmp_path / "drive.toml"
    path.write_text(path.read_text().replace("count = 11", "count = 10").replace("absolute = 3", "absolute = 40000"))
    with pytest.raises(ConfigError, match=r"command.absolute: 40000 .*i16 of block.path.value.mode"):
        decode_device_file(text, "board.toml")


def test_a_command_says_so_in_one_line(tmp_path):
    (tmp_path / "board.toml").write_text(write(tmp_path, *REFUSED[6][:3]))
    command = [
        sys.executable,
        "-m",
        "glider.tools.cli.main",
        "fly",
        "--board",
        str(tmp_path / "board.toml"),
        "--no-log",
    ]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 2
    (line,) = done.stderr.strip().splitlines()
    assert str(tmp_path / "drive.toml") in line
    assert "block.path.count: register 11" in line
