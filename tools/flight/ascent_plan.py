"""A plan for the out-of-band process, made of a board file at arming."""

from hal.boardfile import DeviceFile, DriveTable, WireTable, preset_of
from hal.devices import DeviceBoard
from hal.outofband.plan import AxisPlan, Plan, ServoPlan, WirePlan

NEAR_M = 0.0005  # an actuator so near its end has arrived


def make_plan(board: DeviceBoard, *, flight: str, watchdog: str = "", give_up_s: float = 0.0) -> Plan:
    """The board file's addresses, and the ends that its drivers would not pass either."""
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
    return Plan(flight=flight, axes=axes, servo=servo, watchdog=watchdog, give_up_s=give_up_s)


def _axis(file: DeviceFile, source: str, name: str, wire: str, end_m: float) -> AxisPlan:
    table: DriveTable = getattr(file, name)
    registers, port = preset_of(file, name, source), file.port[table.port]
    return AxisPlan(
        name="pump" if name == "ballast" else name,
        port=port.path, baud=port.baud, id=table.id,
        status=registers.block["status"].address, position=registers.block["position"].address,
        path=registers.block["path"].address, auxiliary=registers.word["auxiliary"],
        absolute=registers.command["absolute"], trigger=registers.command["trigger"],
        clear_alarm=registers.command["clear_alarm"],
        zero_counts=float(table.zero_counts), counts_per_m=float(table.counts_per_m), end_m=float(end_m),
        tolerance_m=NEAR_M, rpm=max(1, round(table.rpm)), ramp_ms=table.ramp_ms,
        wire=_wire(file, source, wire) if table.follow == "wire" else None,
    )  # fmt: skip


def _wire(file: DeviceFile, source: str, name: str) -> WirePlan:
    table: WireTable = getattr(file, name)
    registers, port = preset_of(file, name, source), file.port[table.port]
    block = registers.block["all"]
    encoder = registers.role == "encoder"
    low, high = table.range_m
    if table.broken_below is not None:  # a broken wire reads below this, whichever way it is mounted
        edge = (table.broken_below - table.zero) / table.per_m
        low, high = (max(low, edge), high) if table.per_m > 0.0 else (low, min(high, edge))
    return WirePlan(
        port=port.path, baud=port.baud, id=table.id, function=block.function,
        address=block.address + (0 if encoder else (table.channel or 1) - 1), words=2 if encoder else 1,
        zero=float(table.zero), per_m=float(table.per_m), low_m=float(low), high_m=float(high),
    )  # fmt: skip
