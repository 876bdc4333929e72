"""A transmitter that nobody has met: one TOML file, in mbar and hundredths of a degree, read from a peer and a twin."""

import time

import pytest
from pymodbus.simulator import SimDevice

from glider.hal.board import BoardRequest, board_builder
from glider.hal.boardfile import BeaconTable, calibration_hash
from glider.hal.drivers.modbus_sensors import Beacon
from glider.hal.ports import Validity
from glider.hal.protocols.modbus_master import ModbusBus
from glider.hal.protocols.registers import preset
from glider.hal.strict import ConfigError
from glider.hal.transport.hub import Hub, SerialLink
from glider.hal.transport.port import SerialPort
from glider.sim_backend.twins.boardfile import decode_twin_file
from glider.tools.data.boards import load_board_file
from glider.tools.data.sources import load_vehicle
from tests.integration.test_independent_peers import PlainServer, registers

pytestmark = pytest.mark.realtime

TRANSMITTER = """
format = 1
name = "deepsense-20"
role = "pressure"
description = "fictitious transmitter of 20 bar: tenths of a mbar, hundredths of a degree"

[block.all]
function = 4
address = 0x0020
count = 4
value.pressure = { at = 0, type = "u32", unit = "mbar", scale = 0.1 }
value.temperature = { at = 2, type = "i16", unit = "deg C", scale = 0.01 }

[block.pressure]
function = 4
address = 0x0020
count = 2
value.pressure = { at = 0, type = "u32", unit = "mbar", scale = 0.1 }
"""


@pytest.fixture
def transmitter(tmp_path):
    path = tmp_path / "deepsense-20.toml"
    path.write_text(TRANSMITTER)
    return str(path)


def served(server, bus):
    link = SerialLink("p", SerialPort(server.path, 115_200), bus)
    link.open(time.monotonic())
    Hub([link], time.monotonic).serve(time.monotonic() + 1.0)
    link.port.close()


def test_a_plain_server_is_read_in_pascal(transmitter):
    tenths_of_mbar = 15_000  # 1.5 bar
    device = SimDevice(1, simdata=[registers(0x0020, [tenths_of_mbar >> 16, tenths_of_mbar & 0xFFFF, 1825, 0])])
    beacon = Beacon(BeaconTable(device=transmitter, port="p"), preset(transmitter))
    bus = ModbusBus(115_200, timeout_s=0.2, longest_s=0.2)
    bus.add(beacon.poll)
    with PlainServer([device]) as server:
        served(server, bus)
    assert beacon.validity == Validity.VALID
    assert beacon.values == pytest.approx((150_000.0, 18.25))


def board_text(transmitter):
    return load_board_file("twin").text.replace('device = "keller-33x"', f'device = "{transmitter}"')


def test_a_twin_of_it_is_read_by_the_real_driver(transmitter):
    request = BoardRequest(
        text=board_text(transmitter), source="mine.toml", vehicle=load_vehicle("roughie"), site_depth=5.0
    )
    board = board_builder("twin")(request)
    try:
        board.connect()
        assert board.wait_for_answers(10.0) == []
        end = time.monotonic() + 5.0
        while board.beacon.values[1] == 15.0 and time.monotonic() < end:  # it comes by a request of its own
            board.clock.sleep_until(board.clock.now() + 0.05)
        pressure, temperature = board.beacon.values
        depth = board.state()["z_m"]
    finally:
        board.close()
    assert pressure == pytest.approx(101_325.0 + 998.2 * 9.81 * depth, abs=500.0)
    assert temperature == pytest.approx(20.0, abs=0.1)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"mbar"', '"millibar"', "block.all.value.pressure.unit: expected Pa, .* got 'millibar'"),
        ('"mbar"', '"deg C"', "block.all.value.pressure.unit: expected Pa, .* got 'deg C'"),
        ('"deg C"', '"mbar"', "block.all.value.temperature.unit: .* got 'mbar'"),
        ("value.pressure", "value.depth", "block.all.value.pressure: missing"),
        ("[block.all]", "[block.every]", "block.all: missing"),
        ("scale = 0.1", "scale = 0.0", "expected `float` > 0.0"),
    ],
)
def test_what_a_transmitter_cannot_be_is_refused_by_file_and_key(tmp_path, old, new, said):
    path = tmp_path / "mine.toml"
    path.write_text(TRANSMITTER.replace(old, new))
    with pytest.raises(ConfigError, match=said) as error:
        decode_twin_file(board_text(path), "board.toml")
    assert str(error.value).startswith(str(path))


def test_a_transmitter_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ConfigError, match=r"nowhere\.toml: "):
        preset(str(tmp_path / "nowhere.toml"))


def test_another_unit_is_another_calibration(tmp_path):
    path = tmp_path / "mine.toml"
    hashes = set()
    for text in (TRANSMITTER, TRANSMITTER.replace("mbar", "kPa"), TRANSMITTER):
        path.write_text(text)
        hashes.add(calibration_hash(decode_twin_file(board_text(path), "board.toml")))
    assert len(hashes) == 2
