"""The state of the flight before: two copies, torn ones seen, the worse one counts. Every byte of a write is a cut."""

import pytest

from hal.state_file import BLOCK, NAMES, FlightState, Phase, StateFile, decode, encode


@pytest.fixture
def state(tmp_path):
    return StateFile(tmp_path / "state")


def write_raw(state, index, data):
    state.paths[index].write_bytes(data)


def test_a_new_folder_is_ashore_and_what_is_written_is_read(state):
    assert state.read() == FlightState(Phase.ASHORE)
    assert state.read().may_start
    for number, phase in enumerate(Phase, start=1):
        state.write(phase, flight="sawtooth-001", reason="öl")
        assert StateFile(state.folder).read() == FlightState(phase, "sawtooth-001", "?l", number)


def test_only_ashore_may_start_and_all_behind_held_ascends():
    assert [FlightState(phase).may_start for phase in Phase] == [True] + [False] * 5
    assert [FlightState(phase).must_ascend for phase in Phase] == [False] * 2 + [True] * 4


@pytest.mark.parametrize("after", list(Phase))
@pytest.mark.parametrize("before", list(Phase))
def test_a_write_cut_at_any_byte_never_reads_better_than_both(state, before, after):
    """The power goes while a phase is written: into the first copy, between both, into the second."""
    state.write(before, flight="a flight")
    old, new = state.paths[0].read_bytes(), encode(FlightState(after, "a flight", "why", 2))
    least = min(before, after)
    every = 1 if (before, after) == (Phase.ASHORE, Phase.ARMED) else 32  # each byte once, the others by samples
    for index, other in ((0, old), (1, new)):
        write_raw(state, 1 - index, other)
        for place in range(0, BLOCK + 1, every):
            torn = new[:place] + old[place:]
            write_raw(state, index, torn)
            found = state.read()
            assert found.phase >= least
            if place in (0, BLOCK):
                assert found.phase in (before, after)
            elif isinstance(decode(torn), str):
                assert found.must_ascend
                assert NAMES[index] in found.trouble
    write_raw(state, 0, new)
    write_raw(state, 1, old)  # both whole: the worse
    assert state.read().phase == max(before, after)


@pytest.mark.parametrize("bit", range(8))
def test_a_flipped_bit_anywhere_is_a_torn_copy(bit):
    block = bytearray(encode(FlightState(Phase.DIVING, "x", "y", 7)))
    for place in range(BLOCK):
        block[place] ^= 1 << bit
        assert isinstance(decode(bytes(block)), str)
        block[place] ^= 1 << bit
    assert decode(bytes(block)) == FlightState(Phase.DIVING, "x", "y", 7)


@pytest.mark.parametrize("data", [b"", b"\0" * BLOCK, b"x" * BLOCK, b"\xff" * 5000])
def test_a_torn_copy_beside_any_other_means_no_mission(state, data):
    for phase in Phase:
        for index in (0, 1):
            state.write(phase)
            write_raw(state, index, data)
            found = state.read()
            assert found.must_ascend
            assert found.phase >= phase
            assert str(state.paths[index]) in found.trouble


def test_a_missing_copy_is_as_bad_and_both_torn_is_unknown(state):
    state.write(Phase.ASHORE)
    state.paths[1].unlink()
    assert state.read().phase == Phase.UNKNOWN
    write_raw(state, 0, b"")
    write_raw(state, 1, b"")
    assert state.read().phase == Phase.UNKNOWN
    state.write(Phase.ASHORE)  # a person has looked
    assert state.read().may_start


def test_what_a_check_sum_covers_and_is_no_state_is_not_believed():
    import json
    import zlib

    for fields in ([9, 1, "", ""], ["x", 1, "", ""], [1], {}, [True], None):
        head = (b"glider-state-1 " + json.dumps(fields).encode()).ljust(BLOCK - 9)
        assert decode(head + f"{zlib.crc32(head):08x}\n".encode()) == "not understood"


def test_long_texts_are_cut_and_a_folder_that_cannot_be_written_is_an_error(state, tmp_path):
    state.write(Phase.HELD, flight="f" * 1000, reason="\n" * 1000)
    assert len(state.read().reason) == 160
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        StateFile(tmp_path / "file" / "state")
