"""Board files: strict, checked across tables, and hashed."""

from importlib.resources import files
from pathlib import Path

import pytest

from glider.hal.boardfile import DRIVERS, calibration_hash, decode_device_file, driver_builder, known_devices
from glider.hal.ports import SLOTS
from glider.hal.strict import ConfigError
from glider.sim_backend.twins.boardfile import decode_twin_file, simulated_board
from glider.sim_backend.twins.service import LINE_TWINS
from glider.tools.data.tomltext import toml_text

TEXT = files("glider.hal").joinpath("boards", "roughie.toml").read_text(encoding="utf-8")
TWIN = files("glider.sim_backend").joinpath("boards", "twin.toml").read_text(encoding="utf-8")


def test_the_documented_example_reads():
    file = decode_device_file(TEXT, "roughie.toml")
    assert file.slider.rpm == 360
    assert file.calibration == ""  # nobody's vehicle: it has to be looked through


def test_the_shipped_twin_is_the_example_and_accepted():
    twin, example = decode_twin_file(TWIN, "twin.toml"), decode_device_file(TEXT, "roughie.toml")
    assert calibration_hash(twin) == calibration_hash(example) == twin.calibration


REFUSED = [
    ("loop_hz = 50.0", "loop_hz = 50.0\ncolour = 1", r"board.toml:\d+: colour: unknown key"),
    ("per_m = 80000.0", "per_m = 0.0", "slider_wire: per_m: 0 would lose the measurement"),
    ("per_m = 80000.0", "per_m = nan", "slider_wire.per_m: expected a finite number"),
    ("per_m = 80000.0\n", "", "slider_wire.per_m: missing key"),
    ("channel = 1\n", "", "slider_wire.channel: missing key"),
    ("channel = 2", "channel = 1", "plunger_wire.id: is slider_wire's on port 'sensors' too"),
    ("id = 8", "id = 7", "ballast.id: is slider's on port 'drives' too"),
    ('device = "keller-33x"', 'device = "keller"', "beacon.device: no device 'keller'; known: keller-33x"),
    ('device = "keller-33x"', 'device = "leadshine-cs2rs"', "beacon.device: 'leadshine-cs2rs' is no pressure"),
    ('device = "vn100"', 'device = "vn300"', "imu.device: no device 'vn300'; known: vn100"),
    ('[slider]                        # positive: mass forward\ndevice = "leadshine-cs2rs"\nport = "drives"',
     '[slider]\ndevice = "leadshine-cs2rs"\nport = "imu"', "imu.port: shares port 'imu' with slider"),
    ('port = "servo"', 'port = "rudder"', r"servo.port: no \[port.rudder\]"),
    ("usb-maestro-command", "usb-imu", "another port's path too"),
    ("limits_us = [850.0, 2150.0]", "limits_us = [850.0, 1400.0]", "servo: limits_us: expected zero_us inside"),
    ("limits_m = [-0.062, 0.062]", "limits_m = [0.062, -0.062]", "slider: limits_m: expected .low, high."),
    ("speed_m_s = 0.03", "speed_m_s = 30.0", "slider: speed_m_s: 30 m/s is 360000 rpm"),
    ("rate_hz = 100.0", "rate_hz = 70.0", "imu: rate_hz: expected a divisor of the sensor's 800 Hz"),
    ("id = 1\n", "id = 248\n", "beacon.id"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "said"), REFUSED, ids=[new.split("\n")[0] or "left out" for _, new, _ in REFUSED]
)
def test_what_cannot_be_is_refused_by_file_and_key(old, new, said):
    assert old in TEXT
    with pytest.raises(ConfigError, match=said) as error:
        decode_device_file(TEXT.replace(old, new, 1), "board.toml")
    assert str(error.value).startswith("board.toml")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ("zero = 12000.0", "zero = 12001.0", False),
        ("counts_per_m = 2000000.0", "counts_per_m = -2000000.0", False),
        ("limits_m = [-0.062, 0.062]", "limits_m = [-0.05, 0.05]", False),
        ("mount_deg = [0.0, 0.0, 0.0]", "mount_deg = [0.0, 0.0, 180.0]", False),
        ('path = "/dev/serial/by-id/usb-imu"', 'path = "/dev/ttyUSB3"', True),
        ("# A ROUGHIE on real devices", "# Ours", True),
    ],
)
def test_the_hash_sees_calibration_and_nothing_else(old, new, same):
    file, changed = decode_device_file(TEXT, "a"), decode_device_file(TEXT.replace(old, new), "a")
    assert (calibration_hash(file) == calibration_hash(changed)) == same


def test_the_simulated_board_of_a_twin_has_its_rates_and_reads():
    from glider.hal.strict import decode
    from glider.sim_backend.board import SimBoardFile

    text = TWIN.replace("temperature_c = 20.0", "temperature_c = 12.0\nwave = [{ height_m = 0.3, period_s = 4.0 }]")
    file = decode(toml_text(simulated_board(decode_twin_file(text, "twin.toml"))), SimBoardFile, "sim")
    assert file.sensors.imu.rate_hz == 100.0
    assert file.sensors.beacon.rate_hz == 25.0
    assert 0.002 < file.sensors.beacon.delay_s < 0.01
    assert file.environment.temperature_c == 12.0
    assert file.environment.wave[0].height_m == 0.3


def test_every_device_that_a_board_file_may_name_stands_in_the_documents_and_has_a_driver():
    rows = [f"| `[{place}]` | {', '.join(f'`{name}`' for name in known_devices(place))} |" for place in SLOTS]
    document = (Path(__file__).parents[3] / "docs" / "reference" / "devices.md").read_text(encoding="utf-8")
    assert "\n".join(rows) in document
    for place, drivers in DRIVERS.items():
        assert all(callable(driver_builder(place, name)) for name in drivers)
        assert set(drivers) <= set(LINE_TWINS)
