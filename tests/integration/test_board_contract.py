"""What every board promises, whatever carries it: simulated today; run with --board FILE on another."""

import numpy as np
import pytest

from hal.board import BoardRequest, board_builder
from hal.ports import SLOTS, ActuatorPort, Clock, SensorPort, Validity, empty_frame
from tools.compose import load_board_file
from tools.sources import load_vehicle

VEHICLE = load_vehicle("roughie")
FITTED = ("imu", "beacon", "slider_wire", "plunger_wire")


@pytest.fixture
def board(request):
    file = load_board_file(request.config.getoption("--board"))
    board = board_builder(file.kind)(BoardRequest(text=file.text, source=file.source, vehicle=VEHICLE, site_depth=5.0))
    board.open()
    yield board
    board.close()


def test_ports_have_the_shape_of_ports(board):
    assert isinstance(board.clock, Clock)
    for name in ("servo", "slider", "ballast"):
        assert isinstance(getattr(board, name), ActuatorPort)
    for name in SLOTS:
        port = getattr(board, name)
        assert port is None or isinstance(port, SensorPort)
    assert all(getattr(board, name) is not None for name in FITTED)
    assert board.loop_hz > 0


def test_time_never_runs_back_and_deadlines_are_kept(board):
    before = board.clock.now()
    for tick in range(1, 20):
        board.clock.sleep_until(before + 0.02 * tick)
        assert board.clock.now() >= before + 0.02 * tick - 1e-9


def test_every_fitted_sensor_delivers_valid_samples_with_their_time(board):
    frame = empty_frame()
    board.clock.sleep_until(0.5)
    for name in FITTED:
        slot = SLOTS[name]
        getattr(board, name).read(frame[slot.all])
        assert frame[slot.validity] == Validity.VALID, name
        assert 0.0 <= frame[slot.time] <= board.clock.now(), name
        assert np.isfinite(frame[slot.values]).all(), name


def test_samples_go_on_coming(board):
    frame, times = empty_frame(), []
    for tick in range(50):
        board.clock.sleep_until(0.02 * tick)
        board.imu.read(frame[SLOTS["imu"].all])
        times.append(frame[SLOTS["imu"].time])
    assert len(set(times)) > 20


@pytest.mark.parametrize("name", ["servo", "slider", "ballast"])
@pytest.mark.parametrize("share", [-5.0, -1.0, 0.0, 0.5, 1.0, 5.0])
def test_an_actuator_says_what_it_was_sent_and_it_is_within_range(board, name, share):
    low, high = getattr(VEHICLE.actuators, name).range
    wanted = share * high
    sent = getattr(board, name).command(wanted)
    assert low <= sent <= high
    assert sent == pytest.approx(min(max(wanted, low), high))


def test_closing_twice_does_no_harm(board):
    board.close()
    board.close()
