"""Reading logs: complete, cut anywhere, damaged anywhere. A cut gives a prefix; damage is never returned as data."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import CompressionType, Writer

from glider.tools.data.errors import InputError
from glider.tools.data.log.reader import read_log
from glider.tools.data.log.repair import repair
from tests.support.examples import examples


@pytest.fixture(scope="session")
def scratch(tmp_path_factory):
    return tmp_path_factory.mktemp("scratch")


def _check_nothing_false(log, whole):
    """All that a log returns is what was written; what is lost may be missing."""
    for name, topic in log.topics.items():
        wanted = whole.topics[name]
        assert topic.schema_name == wanted.schema_name
        place = topic.sequences - 1
        assert (np.diff(place) > 0).all()
        np.testing.assert_array_equal(topic.times_ns, wanted.times_ns[place])
        if wanted.data is not None:
            assert topic.data.tobytes() == wanted.data[place].tobytes()
    assert [event for event in log.events if event not in whole.events] == []
    for found, wanted in ((log.attachments, whole.attachments), (log.metadata, whole.metadata)):
        assert found.items() <= wanted.items()
    assert log.ending.items() <= whole.ending.items()


def _check_prefix(log, whole):
    _check_nothing_false(log, whole)
    for topic in log.topics.values():
        np.testing.assert_array_equal(topic.sequences, np.arange(1, topic.count + 1))
        assert topic.missing == 0
    assert log.events == whole.events[: len(log.events)]


def test_a_complete_log_is_read_whole(small_log, rows):
    log = read_log(small_log)
    assert log.whole
    assert log.end == log.size
    assert log.topics["/tick"].data.tobytes() == rows.tobytes()
    assert log.topics["/truth"].count == 250
    assert log.topics["/tick"].column("wrench").shape == (500, 20)
    with pytest.raises(KeyError):
        log.topics["/tick"].column("nothing")
    assert [event.text for event in log.events] == [f"event {number} äöü" for number in range(0, 500, 100)]
    assert log.events[1].time_s == 2.0
    assert log.metadata["site"] == "pool"
    assert log.ending == {"reason": "done"}
    assert set(log.attachments) == {"vehicle.toml", "mission.toml"}
    assert log.duration_s == pytest.approx(499 / 50)


def test_a_log_cut_anywhere_gives_a_prefix(small_log, scratch):
    whole, data = read_log(small_log), small_log.read_bytes()
    path = scratch / "cut.mcap"
    offsets = sorted({*range(0, 60), *range(60, len(data), 331), *range(len(data) - 60, len(data))})
    last = 0
    for offset in offsets:
        path.write_bytes(data[:offset])
        log = read_log(path)
        assert not log.complete
        assert log.damages == []
        assert log.end <= offset
        _check_prefix(log, whole)
        count = log.topics["/tick"].count if "/tick" in log.topics else 0
        assert count >= last
        last = count
    assert last == 500


def test_a_cut_loses_less_than_the_chunk_it_is_in(small_log, scratch):
    whole, data = read_log(small_log), small_log.read_bytes()
    path = scratch / "cut.mcap"
    per_chunk = 16_384 // (31 + 4 + 8 * 25) + 1
    path.write_bytes(data[: len(data) // 2])
    count = read_log(path).topics["/tick"].count
    path.write_bytes(data[: len(data) // 2 + 17_000])
    assert 0 < read_log(path).topics["/tick"].count - count <= 2 * per_chunk
    assert whole.topics["/tick"].count == 500


@examples(250)
@given(place=st.floats(0.0, 1.0, exclude_max=True), bit=st.integers(0, 7))
def test_a_flipped_bit_is_never_returned_as_data(small_log, scratch, place, bit):
    whole, data = read_log(small_log), bytearray(small_log.read_bytes())
    data[int(place * len(data))] ^= 1 << bit
    path = scratch / "flipped.mcap"
    path.write_bytes(data)
    log = read_log(path)
    assert not log.whole
    _check_nothing_false(log, whole)
    assert log.topics["/tick"].count >= 500 - 2 * 80  # what it costs is about the chunk it is in


@pytest.mark.parametrize("place", [*range(64), *range(64, 3900, 37)])
def test_damage_at_the_beginning_does_not_cost_the_flight(small_log, scratch, place):
    whole, data = read_log(small_log), bytearray(small_log.read_bytes())
    data[place] ^= 0x55
    path = scratch / "head.mcap"
    path.write_bytes(data)
    log = read_log(path)
    _check_nothing_false(log, whole)
    assert log.topics["/tick"].count == 500
    assert bool(log.metadata) + len(log.attachments) >= 2  # of three


def test_a_length_that_points_past_whole_chunks_does_not_take_them_along(small_log, scratch):
    """The head and the indexes are under no checksum of their own; a flipped bit in their length may look right."""
    whole, data = read_log(small_log), bytearray(small_log.read_bytes())
    path = scratch / "length.mcap"
    for bit in range(17):
        flipped = data.copy()
        flipped[9 + bit // 8] ^= 1 << bit % 8
        path.write_bytes(flipped)
        log = read_log(path)
        _check_nothing_false(log, whole)
        assert log.topics["/tick"].count == 500
        assert log.metadata == whole.metadata


@examples()
@given(st.lists(st.tuples(st.floats(0.0, 1.0), st.binary(min_size=1, max_size=600)), min_size=1, max_size=5))
def test_overwritten_pieces_are_never_returned_as_data(small_log, scratch, pieces):
    whole, data = read_log(small_log), bytearray(small_log.read_bytes())
    for place, piece in pieces:
        start = int(place * (len(data) - len(piece)))
        data[start : start + len(piece)] = piece
    path = scratch / "patched.mcap"
    path.write_bytes(data)
    _check_nothing_false(read_log(path), whole)


def test_a_page_of_zeros_costs_only_what_it_covers(small_log, scratch):
    whole, data = read_log(small_log), bytearray(small_log.read_bytes())
    data[40_000:44_096] = bytes(4096)
    path = scratch / "zeros.mcap"
    path.write_bytes(data)
    log = read_log(path)
    assert log.complete
    assert not log.whole
    _check_nothing_false(log, whole)
    assert log.topics["/tick"].sequences[-1] == 500
    assert log.topics["/tick"].missing == 500 - log.topics["/tick"].count > 0


def test_the_first_chunk_with_the_definitions_may_be_lost(small_log, scratch):
    whole, data = read_log(small_log), bytearray(small_log.read_bytes())
    data[data.index(b"float64 depth_m", data.index(b"rcl_interfaces/msg/Log") - 3000) + 3] ^= 1
    path = scratch / "defs.mcap"
    path.write_bytes(data)
    log = read_log(path)
    assert log.damages
    _check_nothing_false(log, whole)
    assert log.topics["/tick"].sequences[-1] == 500
    assert log.events


@examples()
@given(data=st.binary(max_size=400), magic=st.booleans())
def test_any_bytes_are_a_log_or_refused(scratch, data, magic):
    path = scratch / "any.mcap"
    path.write_bytes((b"\x89MCAP0\r\n" if magic else b"") + data)
    if magic or b"\x89MCAP0\r\n".startswith(data[:8]):
        assert read_log(path).topics == {}
    else:
        with pytest.raises(InputError, match="MCAP file"):
            read_log(path)


def test_what_is_no_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="no such"):
        read_log(tmp_path / "x.mcap")
    with pytest.raises(InputError, match=r"not a\b"):
        read_log(tmp_path)


def test_logs_of_other_writers_are_not_taken_on_trust(tmp_path):
    """Compressed chunks, chunks without checksum and bare messages: said, not guessed at."""
    for name, options in (
        ("bare", {"use_chunking": False}),
        ("unchecked", {"enable_crcs": False, "compression": CompressionType.NONE}),
        ("packed", {"compression": CompressionType.ZSTD}),
    ):
        path = tmp_path / f"{name}.mcap"
        with path.open("wb") as file:
            writer = Writer(file, **options)
            writer.start()
            schema = writer.register_schema("a/msg/B", "ros2msg", b"float64 t_s\n")
            channel = writer.register_channel("/tick", "cdr", schema)
            writer.add_message(channel, 1, b"\x00\x01\x00\x00" + bytes(8), 1)
            writer.finish()
        log = read_log(path)
        assert log.topics == {}
        assert log.damages, name


def test_repair_makes_a_cut_log_complete(small_log, scratch, tmp_path):
    data = small_log.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: len(data) // 2])
    before = read_log(cut)
    report = repair(cut)
    assert report.out == tmp_path / "cut.repaired.mcap"
    assert cut.read_bytes() == data[: len(data) // 2]
    assert (report.was_complete, report.torn_bytes) == (False, before.size - before.end)
    after = read_log(report.out)
    assert after.whole
    assert after.topics["/tick"].data.tobytes() == before.topics["/tick"].data.tobytes()
    assert after.events == before.events
    assert after.attachments == before.attachments
    assert after.metadata["repaired_from"] == "cut.mcap"
    assert report.messages == sum(topic.count for topic in before.topics.values())
    with pytest.raises(FileExistsError):
        repair(cut)


def test_repair_leaves_damage_out_and_a_whole_log_alone(small_log, tmp_path):
    data = bytearray(small_log.read_bytes())
    data[60_000] ^= 1
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    report = repair(path, tmp_path / "mended.mcap")
    assert len(report.damages) == 1
    assert read_log(report.out).whole
    assert read_log(report.out).topics["/tick"].missing > 0
    assert repair(report.out).out is None
    assert not (tmp_path / "mended.repaired.mcap").exists()


def test_repair_of_what_is_no_log_leaves_no_file(tmp_path):
    path = tmp_path / "x.mcap"
    path.write_text("a text that is no log")
    with pytest.raises(InputError, match="MCAP file"):
        repair(path)
    assert list(tmp_path.iterdir()) == [path]
