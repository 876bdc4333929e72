"""Peers that are not ours: a plain pymodbus client reads our twins, our drivers read a plain pymodbus server."""

import asyncio
import os
import struct
import subprocess
import sys
import threading
import time

import pytest
from pymodbus.client import ModbusSerialClient
from pymodbus.server import ModbusSerialServer
from pymodbus.simulator import DataType, SimData, SimDevice

from glider.hal.boardfile import BeaconTable, DriveTable, WireTable
from glider.hal.drivers.drive import Drive
from glider.hal.drivers.modbus_sensors import AnalogModule, Beacon, wire
from glider.hal.ports import Validity
from glider.hal.protocols.modbus_master import ModbusBus
from glider.hal.protocols.registers import preset
from glider.hal.transport.hub import Hub, SerialLink
from glider.hal.transport.port import SerialPort
from glider.sim_backend.twins.line import open_pty
from tests.support.twinned import until


# --- a plain client on our twins ------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def ports(tmp_path_factory):
    """`glider twin`, running."""
    folder = tmp_path_factory.mktemp("twins")
    command = [sys.executable, "-m", "glider.tools.cli.main", "twin", "--dir", str(folder), "--stand"]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    for line in process.stderr:
        if b"are there" in line:
            break
    else:
        pytest.fail("the twins did not start")
    yield folder
    process.communicate(b"quit\n", timeout=60)
    assert process.returncode == 0


@pytest.fixture
def client(ports, request):
    client = ModbusSerialClient(str(ports / request.param), baudrate=115_200, timeout=1.0, retries=0)
    assert client.connect()
    yield client
    client.close()


def floats(registers):
    return struct.unpack(f">{len(registers) // 2}f", struct.pack(f">{len(registers)}H", *registers))


@pytest.mark.parametrize("client", ["sensors"], indirect=True)
def test_a_plain_client_reads_the_transmitter_and_the_analog_module(client):
    pressure, temperature = floats(client.read_holding_registers(0x0100, count=4, device_id=1).registers)
    assert pressure == pytest.approx(1.0425, abs=0.005)  # bar, at 0.3 m
    assert temperature == pytest.approx(20.0)
    assert floats(client.read_holding_registers(0x0002, count=2, device_id=1).registers)[0] == pytest.approx(
        pressure, abs=0.005
    )
    channels = client.read_input_registers(0x0000, count=8, device_id=2).registers
    assert channels[0] == pytest.approx(12_000, abs=150)
    assert channels[2:4] == [4000, 14_800]
    assert client.read_holding_registers(0x1000, count=8, device_id=2).registers == [3] * 8


@pytest.mark.parametrize("client", ["sensors"], indirect=True)
def test_a_plain_client_is_told_of_an_address_that_is_not_there(client):
    reply = client.read_holding_registers(0x0200, count=4, device_id=1)
    assert reply.isError()
    assert reply.exception_code == 2


@pytest.mark.parametrize("client", ["drives"], indirect=True)
def test_a_plain_client_moves_the_slider(client):
    def position():
        high, low = client.read_holding_registers(0x1014, count=2, device_id=7).registers
        return struct.unpack(">i", struct.pack(">HH", high, low))[0]

    counts = -20_000  # -10 mm
    words = list(struct.unpack(">HH", struct.pack(">i", counts)))
    assert not client.write_registers(0x6200, [1, *words, 360, 100, 100, 0, 0x10], device_id=7).isError()
    end = time.monotonic() + 5.0
    while abs(position() - counts) > 20 and time.monotonic() < end:
        time.sleep(0.05)
    assert position() == pytest.approx(counts, abs=20)

    def status():
        return client.read_holding_registers(0x1003, count=1, device_id=7).registers[0] & 0b110111

    until(lambda: status() == 0b110010, 5.0)  # it stands, done
    assert not client.write_register(0x6002, 0x40, device_id=7).isError()
    assert client.write_registers(0x6200, [9, *words, 360, 100, 100, 0, 0x10], device_id=7).exception_code == 3


# --- our drivers on a plain server ----------------------------------------------------------------------------------
class PlainServer:
    """pymodbus's serial server, as its documentation starts it, in a thread with a loop of its own."""

    def __init__(self, devices):
        self.outer, self._outer_slave, self.path = open_pty()
        self.inner, self._inner_slave, self._server_path = open_pty()
        self._devices = devices
        self._stop = threading.Event()
        self._ready = threading.Event()
        self.thread = threading.Thread(target=lambda: asyncio.run(self._run()), daemon=True)

    async def _run(self):
        server = ModbusSerialServer(self._devices, port=self._server_path, baudrate=115_200)
        await server.serve_forever(background=True)
        loop = asyncio.get_running_loop()
        for source, sink in ((self.outer, self.inner), (self.inner, self.outer)):
            loop.add_reader(source, lambda a=source, b=sink: os.write(b, os.read(a, 4096)))
        self._ready.set()
        while not self._stop.is_set():
            await asyncio.sleep(0.02)
        await server.shutdown()

    def __enter__(self):
        self.thread.start()
        assert self._ready.wait(5.0)
        return self

    def __exit__(self, *exception):
        self._stop.set()
        self.thread.join(5.0)
        for fd in (self.outer, self._outer_slave, self.inner, self._inner_slave):
            os.close(fd)


def registers(start, values):
    return SimData(start, values=list(values), datatype=DataType.REGISTERS)


def test_our_drivers_read_and_move_what_a_plain_server_has():
    words = [struct.unpack(">2H", struct.pack(">f", value)) for value in (1.5, 18.25)]
    transmitter = SimDevice(1, simdata=[registers(0x0100, [*words[0], *words[1]])])
    module = SimDevice(2, simdata=[registers(0, [16_000, 12_000, 4000, 14_800, 0, 0, 0, 0])])
    drive_sim = SimDevice(
        7, simdata=[registers(0x1003, [2]), registers(0x1014, [0, 5000]), registers(0x1801, [0]),
                    registers(0x6002, [0]), registers(0x6200, [0] * 8)],
    )  # fmt: skip
    with PlainServer([transmitter, module, drive_sim]) as server:
        bus = ModbusBus(115_200, timeout_s=0.2, longest_s=0.2)
        beacon = Beacon(BeaconTable(device="keller-33x", port="p"), preset("keller-33x"))
        slider_wire = wire("slider_wire", WireTable(device="waveshare-8ai", port="p", per_m=80_000.0, zero=12_000.0))
        table = DriveTable(
            device="leadshine-cs2rs", port="p", id=7, counts_per_m=2e6, limits_m=(-0.06, 0.06), speed_m_s=0.03
        )
        drive = Drive("slider", table, preset("leadshine-cs2rs"), 1.0, (-0.06, 0.06), None)
        bus.add(beacon.poll)
        bus.add(AnalogModule(2, preset("waveshare-8ai"), [(1, slider_wire)]).poll)
        drive.join(bus)
        drive.enabled = True
        drive.command(0.03)
        link = SerialLink("p", SerialPort(server.path, 115_200), bus)
        link.open(time.monotonic())
        hub = Hub([link], time.monotonic)
        hub.serve(time.monotonic() + 1.0)
        assert beacon.validity == slider_wire.validity == Validity.VALID
        assert beacon.values == (150_000.0, 18.25)
        assert slider_wire.values[0] == pytest.approx(0.05)
        assert drive.counts == 5000
        drive.stop()
        hub.serve(time.monotonic() + 0.5)
        link.port.close()
        client = ModbusSerialClient(server.path, baudrate=115_200, timeout=1.0, retries=0)
        assert client.connect()
        assert client.read_holding_registers(0x6200, count=8, device_id=7).registers == [
            1, 0, 60_000, 360, 100, 100, 0, 0x10,
        ]  # fmt: skip
        assert client.read_holding_registers(0x6002, count=1, device_id=7).registers == [0x40]
        client.close()
    assert bus.counts.replies > 30
    assert bus.counts.wrong == bus.counts.damaged == 0
