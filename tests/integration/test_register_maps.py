"""Devices with a register map of their own: flight and out-of-band process read and write what the map says.

Once on a plain Modbus server, whose registers are written down by hand; once on twins, which move.
"""

import time

import pytest
from pymodbus.client import ModbusSerialClient
from pymodbus.simulator import SimDevice

from glider.hal.board import BoardRequest, board_builder
from glider.hal.outofband.ascent import Ascent
from glider.hal.outofband.plan import NAME, read_plan, write_plan
from glider.tools.data.sources import load_vehicle
from glider.tools.flight.ascent_plan import make_plan
from tests.integration.test_independent_peers import PlainServer, registers
from tests.integration.test_outofband_pressure import brought_up, under_water
from tests.support.register_maps import board_text, write_maps
from tests.support.twinned import twins, until

pytestmark = pytest.mark.realtime(seconds=60)
VEHICLE = load_vehicle("roughie")
COUNTS = [0x0001, 0x86A0]  # 100,000
MINUS = [0xFFFF, 0xB1E0]  # -20,000


def drive_registers(device):
    return SimDevice(device, simdata=[
        registers(0x0200, [9, 0, 2]), registers(0x0300, [9, 9, *COUNTS, 9]), registers(0x0400, [0] * 11),
        registers(0x0500, [0, 0]),
    ])  # fmt: skip


def build(text, kind="devices"):
    return board_builder(kind)(
        BoardRequest(text=text, source="own.toml", vehicle=VEHICLE, water_density=1000.0, site_depth=5.0)
    )


@pytest.fixture
def server():
    with PlainServer(
        [drive_registers(7), drive_registers(8), SimDevice(3, simdata=[registers(0x10, [9, *MINUS, 9])])]
    ) as it:
        yield it


@pytest.fixture
def text(server, tmp_path):
    """The board file whose drives and plunger wire are on the plain server; the other ports are not there."""
    return board_text(write_maps(tmp_path)).replace("/dev/serial/by-id/usb-rs485-drives", server.path)


def path_of(server, device):
    """What stands in a drive's path."""
    # a reply to the board, which left in the middle, may still stand in the line: the question is put again
    client = ModbusSerialClient(server.path, baudrate=115_200, timeout=1.0, retries=5)
    assert client.connect()
    try:
        return (
            client.read_holding_registers(0x0400, count=11, device_id=device).registers,
            client.read_holding_registers(0x0500, count=2, device_id=device).registers,
        )
    finally:
        client.close()


def path(counts, rpm):
    """Position, speed in tenths, both ramps, pause, trigger, mode."""
    return [counts >> 16 & 0xFFFF, counts & 0xFFFF, 0, 10 * rpm, 100, 100, 0, 0, 7, 0, 3]


# The plunger wire reads -10 mm, 50,000 counts of the drive, which itself counts 100,000: its zero is 150,000 off.
PUMP_ZERO = 150_000


def served(board, condition):
    """The board is served until something is so."""
    end = time.monotonic() + 20.0
    while not condition() and time.monotonic() < end:
        board.serve(time.monotonic() + 0.05)
    assert condition()


def test_the_flights_drivers_use_the_map(server, text):
    board = build(text)
    board.connect_available()
    drives = (board.slider, board.ballast)
    try:
        served(board, lambda: all(one.status and one._drift_known for one in drives[1:]) and board.slider.status)
        assert board.plunger_wire.values[0] == pytest.approx(-0.01)
        assert (board.slider.counts, board.ballast.counts) == (100_000, 100_000)
        assert (board.slider.status, board.ballast.status) == (2, 2)
        board.enable(True)
        board.slider.command(0.03)
        board.ballast.command(0.01 * board.ballast.unit)
        served(board, lambda: all(one._mover._written is not None for one in drives))
        board.slider.stop()
        served(board, lambda: not board.slider._mover.stop_wanted)
    finally:
        board.close()
    written, (control, _) = path_of(server, 7)
    assert (written, control) == (path(60_000, 360), 9)
    assert path_of(server, 8)[0] == path(PUMP_ZERO + 50_000, 300)


def test_the_low_words_are_those_of_the_map(text):
    """What is asked while a reply to the whole number may still come."""
    board = build(text)
    for item, (_, low), words, count in (
        (board.slider, board.slider._position._variants, [9, 9, 0x86A0], 100_000),
        (board.slider, board.slider._position._variants, [9, 9, 0x0001], 131_073),
    ):
        item._took_position(None, [9, 9, *COUNTS, 9], 1.0, 1.0)
        item._took_position(low, words, 1.1, 1.1)
        assert item.counts == count


def test_the_out_of_band_process_uses_the_map(server, text, tmp_path):
    plan = make_plan(build(text), flight="x", settings=VEHICLE.supervisor, water_density=1000.0)
    write_plan(tmp_path / NAME, plan)
    ascent = Ascent(read_plan(tmp_path / NAME))
    try:
        said = ascent.step()
    finally:
        ascent.close()
    assert said.startswith("pump on its way, slider on its way")
    pump, slider = plan.axes
    assert path_of(server, 8) == (path(PUMP_ZERO + round(5e6 * pump.end_m), 300), [0, 0])
    assert path_of(server, 7) == (path(round(2e6 * slider.end_m), 360), [0, 0])


def test_an_alarm_is_cleared_by_the_map(text, server):
    """The status bits stand in the second of three registers' numbers."""
    client = ModbusSerialClient(server.path, baudrate=115_200, timeout=1.0, retries=0)
    assert client.connect()
    client.write_registers(0x0200, [0, 0, 1], device_id=8)
    client.close()
    ascent = Ascent(make_plan(build(text), flight="x", settings=VEHICLE.supervisor, water_density=1000.0))
    ascent.step()
    ascent.close()
    assert path_of(server, 8)[1] == [0, 55]


# --- on twins -------------------------------------------------------------------------------------------------------
def test_a_flights_board_moves_twins_with_these_maps(tmp_path):
    board = build(board_text(write_maps(tmp_path)), "twin")
    try:
        board.connect()
        assert board.wait_for_answers(10.0) == []
        board.enable(True)
        goals = {"slider": 0.02, "ballast": -0.015 * board.ballast.unit}
        for name, goal in goals.items():
            board.actuators[name].command(goal)
        end = time.monotonic() + 20.0

        def near(name):
            drive = board.actuators[name]
            return all(abs(where * drive.unit - goals[name]) < 0.001 for where in (drive.position(), drive.measured()))

        while not all(near(name) for name in goals) and time.monotonic() < end:
            board.serve(time.monotonic() + 0.02)
        state = board.state()
        assert (state["slider_m"], state["ballast_kg"]) == pytest.approx((goals["slider"], goals["ballast"]), abs=0.005)
        assert board.health()["slider"]["error"] == board.health()["ballast"]["error"] == ""
        assert board.battery.values[0] == pytest.approx(14.8, abs=0.01)
        assert board.leak.values == (0.0,)
        pressure, temperature = board.beacon.values
        assert pressure == pytest.approx(101_325.0 + 998.2 * 9.81 * state["z_m"], abs=500.0)
        assert temperature == pytest.approx(20.0, abs=0.1)
    finally:
        board.close()


def test_the_out_of_band_process_brings_twins_with_these_maps_up(tmp_path):
    (tmp_path / "own.toml").write_text(board_text(write_maps(tmp_path)))
    with twins(tmp_path / "t", "--stand", "--board", str(tmp_path / "own.toml")) as sea:
        under_water(sea, 2.0)
        with brought_up(sea, tmp_path) as said:
            until(lambda: "under water" in said(), 20.0)
            under_water(sea, 0.1)
            until(lambda: "pump at its end, slider at its end, servo centred, at the surface" in said(), 40.0)
        pump, slider = read_plan(tmp_path / NAME).axes
        state = sea.state()
        area = VEHICLE.actuators.ballast.plunger_area
        assert state["ballast_kg"] == pytest.approx(pump.end_m * 1000.0 * area, abs=0.005)
        assert state["slider_m"] == pytest.approx(slider.end_m, abs=0.001)
