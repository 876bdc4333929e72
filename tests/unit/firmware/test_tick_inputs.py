"""A tick is a function of what is recorded: the raw frame, the runtime's inputs, the operator's stop."""

import numpy as np
import pytest

from glider.firmware.core.control.telemetry import REC_FRAME
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.telemetry import RAW, TICK
from glider.hal.ports import FRAME_SIZE, SLOTS, Validity
from glider.hal.recorder.recorder import NullRecorder
from glider.sim_backend.faults import break_in
from glider.tools.flight.compose import build_flight, build_runtime, record_specs


@pytest.fixture
def flown():
    """A simulated flight, armed, and the tick's record."""
    flight = build_flight(mission="sawtooth")
    flight.broken = break_in(flight.board)
    recorder = NullRecorder(record_specs(flight))
    flight.board.open()
    runtime = build_runtime(flight, recorder)
    runtime.arm()
    try:
        yield flight, runtime, recorder.channel("/tick").values
    finally:
        runtime.disarm()


def test_the_operators_stop_is_one_number_that_the_next_tick_takes(flown):
    flight, runtime, values = flown
    pilot = flight.autopilot
    for _ in range(100):
        runtime.tick()
    before = pilot.ap.copy()
    pilot.give_up()
    changed = (pilot.ap != before) & ~(np.isnan(pilot.ap) & np.isnan(before))
    assert np.flatnonzero(changed).tolist() == [ctl.STOP_REQUESTED]
    assert values[TICK.index("stop")] == 0.0
    runtime.tick()
    assert values[TICK.index("stop")] == 1.0
    assert (pilot.mode, pilot.reason) == ("aborted", "asked to by the operator")


def test_a_stop_that_comes_after_the_kernel_is_the_next_ticks(flown):
    """A signal handler may run between two kernels of one tick: what is recorded is what the kernel saw."""
    flight, runtime, values = flown
    runtime.tick()
    honest = flight.supervisor.guard

    def interrupted(t):
        flight.autopilot.give_up()
        honest(t)

    flight.supervisor.guard = interrupted
    runtime.tick()
    assert values[TICK.index("stop")] == 0.0
    assert values[TICK.index("mode")] != ctl.ABORTED
    runtime.tick()
    assert values[TICK.index("stop")] == 1.0
    assert values[TICK.index("mode")] == ctl.ABORTED


def test_the_frame_is_recorded_as_it_was_before_screening(flown):
    flight, runtime, values = flown
    slot = SLOTS["beacon"]
    for _ in range(100):
        runtime.tick()
    flight.board.beacon.begin("jump", (1e9, 0.0))
    for _ in range(4):
        runtime.tick()
    raw = values[REC_FRAME : REC_FRAME + FRAME_SIZE]
    assert raw[slot.validity] == Validity.VALID
    assert raw[slot.start + 2] > 1e9
    assert flight.autopilot.frame[slot.validity] == Validity.FAULT


def test_leak_battery_validity_and_conditions_have_names_in_the_record(flown):
    _, runtime, values = flown
    names = [name for name, _, _ in RAW]
    assert len(names) == FRAME_SIZE
    assert {"raw_leak_wet", "raw_battery_voltage", "raw_imu_validity", "raw_slider_condition"} <= set(names)
    for _ in range(100):
        runtime.tick()
    assert values[TICK.index("raw_leak_wet")] == 0.0
    assert values[TICK.index("raw_battery_voltage")] > 0.0


def test_what_the_runtime_tells_the_supervisor_and_what_was_asked_of_the_actuators_is_recorded(flown):
    flight, runtime, values = flown
    runtime.tick()
    flight.supervisor.G[sup.RECORDER], flight.supervisor.G[sup.GROWTH] = 1.0, 2.0
    runtime.tick()
    assert values[TICK.index("recorder")] == 1.0
    assert values[TICK.index("growth")] == 2.0
    for _ in range(100):
        runtime.tick()
    runtime._send = (*runtime._send[:2], lambda value: 0.5 * value)  # a pump that takes half
    runtime.tick()
    asked, taken = values[TICK.index("asked_ballast_kg")], values[TICK.index("cmd_ballast_kg")]
    assert asked != 0.0
    assert taken == 0.5 * asked
