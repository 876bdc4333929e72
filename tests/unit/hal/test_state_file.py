"""The state of the flight before: two copies, torn ones seen, the worse one counts. Every byte of a write is a cut."""

import pytest

from glider.hal.sortie import SortieState
from glider.hal.state_file import BLOCK, NAMES, StateFile, StateRecord, decode, encode


@pytest.fixture
def state(tmp_path):
    return StateFile(tmp_path / "state")


def write_raw(state, index, data):
    state.paths[index].write_bytes(data)


def test_a_new_folder_is_ashore_and_what_is_written_is_read(state):
    assert state.read() == StateRecord(SortieState.ASHORE)
    for number, phase in enumerate(SortieState, start=1):
        state.write(phase, flight="sawtooth-001", reason="öl")
        assert StateFile(state.folder).read() == StateRecord(phase, "sawtooth-001", "?l", number)


@pytest.mark.parametrize("after", list(SortieState))
@pytest.mark.parametrize("before", list(SortieState))
def test_a_write_cut_at_any_byte_never_reads_better_than_both(state, before, after):
    """The power goes while a phase is written: into the first copy, between both, into the second."""
    state.write(before, flight="a flight")
    old, new = state.paths[0].read_bytes(), encode(StateRecord(after, "a flight", "why", 2))
    least = min(before, after)
    every = (
        1 if (before, after) == (SortieState.ASHORE, SortieState.ARMED) else 32
    )  # each byte once, the others by samples
    for index, other in ((0, old), (1, new)):
        write_raw(state, 1 - index, other)
        for place in range(0, BLOCK + 1, every):
            torn = new[:place] + old[place:]
            write_raw(state, index, torn)
            found = state.read()
            assert found.state >= least
            if place in (0, BLOCK):
                assert found.state in (before, after)
            elif isinstance(decode(torn), str):
                assert found.state.must_ascend
                assert NAMES[index] in found.trouble
    write_raw(state, 0, new)
    write_raw(state, 1, old)  # both whole: the worse
    assert state.read().state == max(before, after)


@pytest.mark.parametrize("bit", range(8))
def test_a_flipped_bit_anywhere_is_a_torn_copy(bit):
    block = bytearray(encode(StateRecord(SortieState.DIVING, "x", "y", 7)))
    for place in range(BLOCK):
        block[place] ^= 1 << bit
        assert isinstance(decode(bytes(block)), str)
        block[place] ^= 1 << bit
    assert decode(bytes(block)) == StateRecord(SortieState.DIVING, "x", "y", 7)


@pytest.mark.parametrize("data", [b"", b"\0" * BLOCK, b"x" * BLOCK, b"\xff" * 5000])
def test_a_torn_copy_beside_any_other_means_no_mission(state, data):
    for phase in SortieState:
        for index in (0, 1):
            state.write(phase)
            write_raw(state, index, data)
            found = state.read()
            assert found.state.must_ascend
            assert found.state >= phase
            assert str(state.paths[index]) in found.trouble


def test_a_missing_copy_is_as_bad_and_both_torn_is_unknown(state):
    state.write(SortieState.ASHORE)
    state.paths[1].unlink()
    assert state.read().state == SortieState.UNKNOWN
    write_raw(state, 0, b"")
    write_raw(state, 1, b"")
    assert state.read().state == SortieState.UNKNOWN
    state.write(SortieState.ASHORE)  # a person has looked
    assert state.read().state.may_arm


def test_what_a_check_sum_covers_and_is_no_state_is_not_believed():
    import json
    import zlib

    for magic in (b"glider-state-1 ", b"glider-state-2 "):
        for fields in ([9, 1, "", ""], ["x", 1, "", ""], [1], {}, [True], None):
            head = (magic + json.dumps(fields).encode()).ljust(BLOCK - 9)
            assert decode(head + f"{zlib.crc32(head):08x}\n".encode()) == "not understood"


def test_a_file_of_the_version_before_is_read():
    import json
    import zlib

    for number, wanted in enumerate(("ASHORE", "HELD", "ARMED", "DIVING", "ABORTED", "UNKNOWN")):
        head = (b"glider-state-1 " + json.dumps([number, 3, "dive", "why"]).encode()).ljust(BLOCK - 9)
        found = decode(head + f"{zlib.crc32(head):08x}\n".encode())
        assert found == StateRecord(SortieState[wanted], "dive", "why", 3)


def test_long_texts_are_cut_and_a_folder_that_cannot_be_written_is_an_error(state, tmp_path):
    state.write(SortieState.HELD, flight="f" * 1000, reason="\n" * 1000)
    assert len(state.read().reason) == 160
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        StateFile(tmp_path / "file" / "state")
