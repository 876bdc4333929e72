"""Board files of kind "twin": the devices of a real board, and the sea in which the plant behind them flies."""

from typing import Any

import msgspec

from glider.hal import boardfile
from glider.hal.boardfile import DeviceFile
from glider.hal.protocols.vn100 import FLIGHT_MASK, payload_size
from glider.hal.strict import ConfigError, decode
from glider.hal.units import BITS
from glider.sim_backend.core.effects.catalogue import check_board
from glider.sim_backend.twins.modbus_line import TURNAROUND_S
from glider.sim_backend.world import Environment, SampledSensor, Start

PLANT_HZ = 100.0


class TwinFile(DeviceFile):
    """A device file with the plant's [environment], [start] and [effects]; paths of ports are only names here."""

    environment: Environment = Environment()
    start: Start = Start()
    effects: dict[str, dict[str, float]] = msgspec.field(default_factory=dict)


def decode_twin_file(text: str, source: str) -> TwinFile:
    """A board file of kind "twin" or "devices" as one that twins can be made of."""
    file = decode(text, TwinFile, source)
    boardfile.check(file, source)
    check_board(file.effects, source)
    if file.imu.rate_hz > PLANT_HZ:
        raise ConfigError(source, f"the plant makes no more than {PLANT_HZ:g} samples a second", key="imu.rate_hz")
    return file


def _exchange_s(baud: int, reply: int) -> float:
    """From a request's end, which is the sample's time, to the whole reply."""
    return TURNAROUND_S + reply * BITS / baud


def simulated_sensors(file: DeviceFile) -> dict[str, SampledSensor]:
    """Rates and delays of a simulated board whose samples come as this board's lines bring them."""
    imu_line = file.port[file.imu.port].baud
    sensors = {
        "imu": SampledSensor(rate_hz=file.imu.rate_hz, delay_s=(6 + payload_size(FLIGHT_MASK)) * BITS / imu_line)
    }
    for name, reply in (("beacon", 13), ("slider_wire", 21), ("plunger_wire", 21)):
        table = getattr(file, name)
        sensors[name] = SampledSensor(rate_hz=table.rate_hz, delay_s=_exchange_s(file.port[table.port].baud, reply))
    return sensors


def simulated_board(file: TwinFile) -> dict[str, Any]:
    """The board file of kind "sim" with the same rates, delays and sea: what a twin's flight is compared with."""
    sea = {name: msgspec.to_builtins(getattr(file, name)) for name in ("environment", "start", "effects")}
    found = simulated_sensors(file)
    sensors = {name: {"rate_hz": one.rate_hz, "delay_s": round(one.delay_s, 6)} for name, one in found.items()}
    return {"format": 1, "kind": "sim", "loop_hz": file.loop_hz, "sensors": sensors, **sea}
