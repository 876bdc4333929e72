"""A long log's index in little memory: the same file to the byte, and bounded growth."""

from io import BytesIO

from mcap.records import ChunkIndex
from mcap.writer import CompressionType, Writer

from glider.hal.recorder import logfile
from glider.hal.recorder.chunk_list import ChunkList, use_packed_index


def index(number):
    return ChunkIndex(
        message_start_time=number, message_end_time=number + 5, chunk_start_offset=10 * number, chunk_length=9,
        message_index_offsets={1: 2**40 + number, 3: 7}, message_index_length=11, compression="", compressed_size=8,
        uncompressed_size=8,
    )  # fmt: skip


def test_what_is_kept_comes_back():
    kept = ChunkList()
    for number in range(1000):
        kept.append(index(number))
    assert len(kept) == 1000
    assert list(kept) == [index(number) for number in range(1000)]
    # An hour of flight at four chunks a second is 14,400 of them.
    assert kept.size / 1000 * 14_400 < 1.1e6


def write(small):
    stream = BytesIO()
    writer = Writer(stream, chunk_size=1000, compression=CompressionType.NONE, enable_data_crcs=True)
    assert not small or use_packed_index(writer)
    writer.start()
    channels = [writer.register_channel(topic, "cdr", 0) for topic in ("/a", "/b")]
    for number in range(2000):
        writer.add_message(channels[number % 3 == 0], number, b"x" * 50, number, number)
    writer.finish()
    return stream.getvalue()


def test_the_file_is_the_same_to_the_byte():
    """With the installed version of mcap: it keeps its list where it is looked for."""
    assert write(True) == write(False)


def test_our_logs_are_written_so():
    writer = logfile.start_writer(BytesIO())
    assert any(isinstance(value, ChunkList) for value in vars(writer).values())


def test_a_writer_that_keeps_it_elsewhere_is_left_alone():
    assert not use_packed_index(object())
