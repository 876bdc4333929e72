"""Fixtures for the tuning's tests."""

import pytest

from glider.hal.strict import decode
from glider.sim_backend.board import SimBoardFile
from glider.tools.data.boards import load_board_file
from glider.tools.data.sources import load_vehicle


@pytest.fixture(scope="session")
def vehicle():
    return load_vehicle("roughie")


@pytest.fixture(scope="session")
def board():
    file = load_board_file("sim")
    return decode(file.text, SimBoardFile, file.source)
