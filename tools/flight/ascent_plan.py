"""A plan for the out-of-band process, made of a board file at arming."""

from glider.firmware.core.vehicle.layout import GRAVITY
from glider.firmware.model.supervisor_settings import SupervisorTable
from glider.hal.boardfile import DeviceFile, DriveTable, WireTable, preset_of
from glider.hal.devices import DeviceBoard
from glider.hal.outofband.plan import (
    AscentPlan,
    AxisPlan,
    NumberPlan,
    PathPlan,
    PressurePlan,
    ReadPlan,
    ServoPlan,
    WirePlan,
)
from glider.hal.protocols.registers import Block, Value, channel_of, step_of

NEAR_M = 0.0005  # an actuator so near its end has arrived


def make_plan(
    board: DeviceBoard, *, flight: str, settings: SupervisorTable, water_density: float, watchdog: str = "",
    give_up_s: float = 0.0,
) -> AscentPlan:  # fmt: skip
    """The board file's addresses, the ends that its drivers would not pass either, and the vehicle file's numbers for
    what counts as rising; water_density in kg/m3."""
    file, source = board.file, board.source
    axes = tuple(
        _axis(file, source, drive.name, wire, drive.limits[0] / drive.unit)
        for drive, wire in ((board.ballast, "plunger_wire"), (board.slider, "slider_wire"))
    )
    port = file.port[file.servo.port]
    servo = ServoPlan(
        port=port.path, baud=port.baud, channel=file.servo.channel, number=file.servo.number, crc=file.servo.crc,
        quarter_us=round(4.0 * file.servo.zero_us),
    )  # fmt: skip
    pressure = _pressure(file, source, settings, board.surface_pressure, GRAVITY * water_density)
    return AscentPlan(flight=flight, axes=axes, servo=servo, pressure=pressure, watchdog=watchdog, give_up_s=give_up_s)


def _pressure(
    file: DeviceFile, source: str, settings: SupervisorTable, surface_pa: float, pa_per_m: float
) -> PressurePlan:
    table = file.beacon
    registers, port = preset_of(file, "beacon", source), file.port[table.port]
    block = registers.block["pressure" if "pressure" in registers.block else "all"]
    return PressurePlan(
        port=port.path, baud=port.baud, id=table.id, reading=_reading(block, block.value["pressure"]),
        zero_pa=float(table.zero_pa),
        surface_pa=float(surface_pa), pa_per_m=float(pa_per_m), low_pa=float(table.range_pa[0]),
        high_pa=float(table.range_pa[1]), surface_m=float(settings.surface_m), step_m=float(settings.ascent_step_m),
        patience_s=float(settings.no_ascent_s),
    )  # fmt: skip


def _number(value: Value) -> NumberPlan:
    return NumberPlan(at=value.at, kind=value.type, step=float(step_of(value)))


def _reading(block: Block, value: Value) -> ReadPlan:
    """The block that the flight reads, and where the number stands in it."""
    return ReadPlan(function=block.function, address=block.address, words=block.count, number=_number(value))


def _path(block: Block) -> PathPlan:
    numbers = {name: _number(value) for name, value in block.value.items()}
    return PathPlan(address=block.address, words=block.count, **numbers)


def _axis(file: DeviceFile, source: str, name: str, wire: str, end_m: float) -> AxisPlan:
    table: DriveTable = getattr(file, name)
    registers, port = preset_of(file, name, source), file.port[table.port]
    return AxisPlan(
        name="pump" if name == "ballast" else name,
        port=port.path, baud=port.baud, id=table.id,
        status=_reading(registers.block["status"], registers.block["status"].value["status"]),
        position=_reading(registers.block["position"], registers.block["position"].value["position"]),
        path=_path(registers.block["path"]), auxiliary=registers.word["auxiliary"],
        absolute=registers.command["absolute"], trigger=registers.command["trigger"],
        clear_alarm=registers.command["clear_alarm"],
        zero_counts=float(table.zero_counts), counts_per_m=float(table.counts_per_m), end_m=float(end_m),
        last_m=float(table.limits_m[0]),
        tolerance_m=NEAR_M, rpm=max(1, round(table.rpm)), ramp_ms=table.ramp_ms,
        wire=_wire(file, source, wire) if table.follow == "wire" else None,
    )  # fmt: skip


def _wire(file: DeviceFile, source: str, name: str) -> WirePlan:
    table: WireTable = getattr(file, name)
    registers, port = preset_of(file, name, source), file.port[table.port]
    block = registers.block["all"]
    value = block.value["count"] if registers.role == "encoder" else channel_of(registers, table.channel or 1)
    low, high = table.range_m
    if table.broken_below is not None:  # a broken wire reads below this, whichever way it is mounted
        edge = (table.broken_below - table.zero) / table.per_m
        low, high = (max(low, edge), high) if table.per_m > 0.0 else (low, min(high, edge))
    return WirePlan(
        port=port.path, baud=port.baud, id=table.id, reading=_reading(block, value), zero=float(table.zero),
        per_m=float(table.per_m), low_m=float(low), high_m=float(high),
    )  # fmt: skip
