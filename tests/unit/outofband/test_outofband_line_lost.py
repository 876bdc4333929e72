"""A line that is lost on the way up: what was written before may be gone, and is written again at once."""

import pytest
from pymodbus.client import ModbusSerialClient
from pymodbus.simulator import SimDevice

from glider.hal.board import BoardRequest, board_builder
from glider.hal.outofband.ascent import Ascent
from glider.tools.data.boards import load_board_file
from glider.tools.data.sources import load_vehicle
from glider.tools.flight.ascent_plan import make_plan
from tests.integration.test_independent_peers import PlainServer, registers

pytestmark = pytest.mark.realtime


def running_drives():
    """Two drives under way: such a drive is left alone for 5 s after its path was written."""
    return PlainServer([
        SimDevice(device, simdata=[
            registers(0x1003, [6]), registers(0x1014, [0, 0]), registers(0x1801, [0]), registers(0x6200, [0] * 8),
        ]) for device in (7, 8)
    ])  # fmt: skip


def trigger_of(server):
    """The last register of the slider's path."""
    client = ModbusSerialClient(server.path, baudrate=115_200, timeout=1.0, retries=0)
    assert client.connect()
    found = client.read_holding_registers(0x6207, count=1, device_id=7).registers
    client.close()
    return found


def test_a_path_is_written_again_after_the_line_was_lost(tmp_path):
    drives, vehicle = tmp_path / "drives", load_vehicle("roughie")
    text = load_board_file("roughie").text.replace("/dev/serial/by-id/usb-rs485-drives", str(drives))
    board = board_builder("devices")(BoardRequest(text=text, source="b.toml", vehicle=vehicle, water_density=1000.0))
    ascent = Ascent(make_plan(board, flight="x", settings=vehicle.supervisor, water_density=1000.0))
    with running_drives() as server:
        drives.symlink_to(server.path)
        assert "slider on its way" in ascent.step()
    drives.unlink()
    ascent.step()
    assert "slider: no" in ascent.step()
    with running_drives() as server:
        drives.symlink_to(server.path)
        ascent.step()
        ascent.close()
        assert trigger_of(server) == [0x10]
