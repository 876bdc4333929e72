"""The sample frame: every port has a place of its own, and what was never read is missing."""

import numpy as np
import pytest

from glider.hal import ports
from glider.hal.board import board_builder, board_kinds
from glider.hal.ports import FRAME_SIZE, SLOTS, BoardError, Validity, empty_frame


def test_slots_fill_the_frame_and_do_not_overlap():
    owner = np.zeros(FRAME_SIZE, dtype=int)
    for slot in SLOTS.values():
        owner[slot.all] += 1
        assert len(slot.names) == len(slot.units)
        assert slot.validity == slot.time + 1
    assert (owner == 1).all()


@pytest.mark.parametrize("name", SLOTS)
def test_the_kernels_know_the_slots_by_the_same_numbers(name):
    assert getattr(ports, name.upper()) == SLOTS[name].start


def test_an_empty_frame_holds_no_sample():
    frame = empty_frame()
    for slot in SLOTS.values():
        assert frame[slot.validity] == Validity.MISSING
        assert np.isnan(frame[slot.values]).all()


def test_boards_register_themselves():
    assert "sim" in board_kinds()
    with pytest.raises(BoardError, match=r"'submarine'; .*sim"):
        board_builder("submarine")
