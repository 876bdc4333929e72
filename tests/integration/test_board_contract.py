"""What every board promises, whatever carries it: simulated and twinned; with --board FILE a real one, on its stand.

Actuators are sent to the ends of their ranges: hands and cables clear.
"""

import math
import time

import numpy as np
import pytest

from glider.hal.board import BoardRequest, board_builder
from glider.hal.ports import SLOTS, ActuatorPort, Clock, Hardware, SensorPort, Validity, empty_frame
from glider.hal.recorder.recorder import NullRecorder
from glider.tools.data.boards import load_board_file
from glider.tools.data.sources import load_vehicle

VEHICLE = load_vehicle("roughie")
FITTED = ("imu", "beacon", "slider_wire", "plunger_wire")
ACTUATORS = ("servo", "slider", "ballast")
BOARDS = ("sim", "twin")


def pytest_generate_tests(metafunc):
    if "board" in metafunc.fixturenames:
        wanted = metafunc.config.getoption("--board")
        metafunc.parametrize("board", [wanted] if wanted else BOARDS, indirect=True, scope="module")


def build(name):
    file = load_board_file(name)
    return board_builder(file.kind)(BoardRequest(text=file.text, source=file.source, vehicle=VEHICLE, site_depth=5.0))


@pytest.fixture(scope="module")
def board(request):
    board = build(request.param)
    board.open()
    yield board
    board.close()
    board.close()  # twice does no harm


def wait(board, seconds):
    """Let time pass as the runtime does, tick by tick."""
    begin = board.clock.now()
    for tick in range(1, round(seconds * board.loop_hz) + 1):
        board.clock.sleep_until(begin + tick / board.loop_hz)


def test_ports_have_the_shape_of_ports(board):
    assert isinstance(board.clock, Clock)
    for name in ACTUATORS:
        assert isinstance(getattr(board, name), ActuatorPort)
    for name in SLOTS:
        port = getattr(board, name)
        assert port is None or isinstance(port, SensorPort)
    assert all(getattr(board, name) is not None for name in FITTED)
    assert board.loop_hz > 0
    assert isinstance(board.hardware, Hardware)
    assert board.check_calibration()
    inputs = {name for name in ("leak", "battery") if getattr(board, name) is not None}
    assert set(board.periods) == {"imu", "beacon", "wires"} | inputs
    assert all(period > 0.0 for period in board.periods.values())
    assert 80_000 < board.surface_pressure < 110_000


def test_a_board_says_how_it_is_and_where_its_plant_is(board):
    """A board without devices has no health; one with nothing real behind it knows where it is."""
    wait(board, 0.2)
    assert board.silent() == []
    devices = {name for name in SLOTS if getattr(board, name) is not None}
    assert set(board.health()) == (set() if board.hardware is Hardware.NONE else devices)
    where = board.state()
    assert set(where) >= {"x_m", "y_m", "z_m", "servo_rad", "slider_m", "ballast_kg"} or board.hardware is Hardware.REAL
    assert all(math.isfinite(value) for value in where.values())


def test_what_a_board_records_is_recorded_once_a_tick(board):
    recorder = NullRecorder(board.records)
    recording = board.recording(recorder.channel)
    assert len(recording) == len(board.records)
    for spec, record in zip(board.records, recording, strict=True):
        record(board.clock.now())
        assert np.isfinite(recorder.channel(spec.topic).values[1:]).all()


def test_time_never_runs_back_and_deadlines_are_kept(board):
    before = board.clock.now()
    for tick in range(1, 20):
        board.clock.sleep_until(before + 0.02 * tick)
        assert board.clock.now() >= before + 0.02 * tick - 1e-9


def test_a_deadline_that_is_gone_is_not_waited_for(board):
    now, real = board.clock.now(), time.monotonic()
    board.clock.sleep_until(now - 1.0)
    assert board.clock.now() >= now
    assert time.monotonic() - real < 0.1


def test_every_fitted_sensor_delivers_valid_samples_with_their_time(board):
    frame = empty_frame()
    wait(board, 0.5)
    for name in FITTED:
        slot = SLOTS[name]
        getattr(board, name).read(frame[slot.all])
        assert frame[slot.validity] == Validity.VALID, name
        assert 0.0 <= frame[slot.time] <= board.clock.now(), name
        assert board.clock.now() - frame[slot.time] < 0.25, name
        assert np.isfinite(frame[slot.values]).all(), name


def test_samples_go_on_coming_and_their_times_never_run_back(board):
    frame, times = empty_frame(), {name: [] for name in FITTED}
    for _ in range(50):
        wait(board, 0.02)
        for name in FITTED:
            getattr(board, name).read(frame[SLOTS[name].all])
            times[name].append(frame[SLOTS[name].time])
    for name, seen in times.items():
        assert seen == sorted(seen), name
        assert len(set(seen)) > 8, name  # of 25 or more, on a machine that may be busy


def test_values_are_those_of_a_vehicle_near_the_surface(board):
    frame = empty_frame()
    wait(board, 0.2)
    for name in FITTED:
        getattr(board, name).read(frame[SLOTS[name].all])
    assert np.abs(frame[SLOTS["imu"].values][:2]).max() < math.radians(90.0)
    assert 90_000 < frame[SLOTS["beacon"].values][0] < 200_000
    assert -5.0 < frame[SLOTS["beacon"].values][1] < 45.0


def test_reading_waits_for_nothing(board):
    frame = empty_frame()
    begin = time.perf_counter()
    for _ in range(1000):
        board.imu.read(frame[SLOTS["imu"].all])
        board.beacon.read(frame[SLOTS["beacon"].all])
    assert time.perf_counter() - begin < 0.1


def test_actuators_go_where_they_are_sent_as_their_draw_wires_see(board):
    """Slider to 10 mm and ballast to 50 g, together, and back."""
    kg_per_m = 998.2 * VEHICLE.actuators.ballast.plunger_area
    goals = {"slider": ("slider_wire", 0.01, 1.0), "ballast": ("plunger_wire", 0.05, kg_per_m)}
    frame = empty_frame()
    for share in (1.0, 0.0):
        for name, (_, place, _) in goals.items():
            getattr(board, name).command(share * place)
        apart = {}
        for _ in range(60):
            wait(board, 0.2)
            for name, (wire, place, unit) in goals.items():
                getattr(board, wire).read(frame[SLOTS[wire].all])
                apart[name] = abs(frame[SLOTS[wire].values][0] - share * place / unit)
            if max(apart.values()) < 0.0012:
                break
        assert max(apart.values()) < 0.0012, apart


@pytest.mark.parametrize("name", ACTUATORS)
@pytest.mark.parametrize("share", [-5.0, -1.0, 0.0, 0.5, 1.0, 5.0])
def test_an_actuator_says_what_it_was_sent_and_it_is_within_range(board, name, share):
    low, high = getattr(VEHICLE.actuators, name).range
    wanted = share * high
    sent = getattr(board, name).command(wanted)
    assert low <= sent <= high
    assert sent == pytest.approx(min(max(wanted, low), high))
