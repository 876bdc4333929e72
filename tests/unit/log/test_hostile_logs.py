"""Logs that somebody made on purpose: every checksum right, what they cover absurd. Read, or refused in a line."""

import contextlib
import json

import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, given
from hypothesis import strategies as st
from mcap.writer import CompressionType, Writer

from glider.hal.recorder import logfile
from glider.tools.cli.log import log as log_command
from glider.tools.data.errors import InputError
from glider.tools.data.log.reader import read_log
from glider.tools.data.log.rundata import export_case
from tests.support.examples import examples

NUMBER = st.integers(0, 2**64 - 1) | st.sampled_from([0, 1, 2**63 - 1, 2**63, 2**64 - 1])
TEXT = st.text(max_size=40) | st.sampled_from(
    ["float64 t_s", "float64[2] a\nfloat64 b", "float64[999999999] a", "float64[-1] a", "float64 t_s\nfloat64 t_s",
     "nan", "inf", "-1", "\x1b[2J", "../../etc", "50"]
)  # fmt: skip
KEYS = st.sampled_from(["epoch_ns", "part", "vehicle", "site", "log_rate_hz", "water_density_kg_m3", "x"])
NAMES = st.sampled_from(
    ["vehicle.toml", "case.toml", "mission.toml", logfile.SCHEMAS_ATTACHMENT, "extra.csv", "../../x", ""]
)
TOPICS = st.sampled_from(["/tick", "/truth", "/events", "", "x"])
SCHEMAS = st.sampled_from(["glider/msg/Tick", "rcl_interfaces/msg/Log", "x"])


@st.composite
def hostile(draw, stream):
    """Write a log into `stream`."""
    writer = Writer(stream, chunk_size=2000, compression=CompressionType.NONE, enable_crcs=True, enable_data_crcs=True)
    writer.start(profile="ros2")
    for _ in range(draw(st.integers(0, 2))):
        entries = draw(st.dictionaries(KEYS, TEXT, max_size=5))
        name = draw(st.sampled_from([logfile.START, logfile.END, "y"]))
        writer.add_metadata(name, {**entries, logfile.CRC_KEY: logfile.metadata_crc(name, entries)})
    for _ in range(draw(st.integers(0, 2))):
        data = draw(st.binary(max_size=60) | TEXT.map(str.encode) | st.just(json.dumps([1, {"a": None}]).encode()))
        writer.add_attachment(draw(NUMBER), draw(NUMBER), draw(NAMES), "text/plain", data)
    for _ in range(draw(st.integers(0, 3))):
        schema = writer.register_schema(draw(SCHEMAS), draw(st.sampled_from(["ros2msg", "x"])), draw(TEXT).encode())
        channel = writer.register_channel(draw(TOPICS), draw(st.sampled_from(["cdr", "json"])), schema)
        for _ in range(draw(st.integers(0, 4))):
            data = draw(st.binary(max_size=40) | st.just(b"\0\1\0\0" + b"\0" * 8) | st.just(b"\0\1\0\0" + b"\xff" * 24))
            writer.add_message(channel, draw(NUMBER), data, draw(NUMBER), draw(st.integers(0, 2**32 - 1)))
    writer.finish()


@examples(400, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
@given(data=st.data())
def test_it_is_read_exported_and_shown_or_refused(tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("hostile")
    path = folder / "x.mcap"
    with path.open("wb") as stream:
        data.draw(hostile(stream))
    log = read_log(path)
    with contextlib.suppress(InputError):
        export_case(log, folder / "case")
    assert {item.name for item in folder.iterdir()} <= {"x.mcap", "case"}
    done = CliRunner().invoke(log_command, ["info", str(path)])
    assert done.exception is None, done.exception
    assert "\x1b" not in done.output
    done = CliRunner().invoke(log_command, ["repair", str(path), "--out", str(folder / "y.mcap")])
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception


@pytest.mark.parametrize("text", ["\x1b[2Jgone", "a\nb\rc", "\x07\x9b31m"])
def test_what_a_log_says_cannot_steer_a_terminal(tmp_path, text):
    path = tmp_path / "x.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.NONE)
        writer.start()
        entries = {"site": text, text: "x"}
        writer.add_metadata(logfile.START, {**entries, logfile.CRC_KEY: logfile.metadata_crc(logfile.START, entries)})
        writer.finish()
    done = CliRunner().invoke(log_command, ["info", str(path)])
    assert done.exit_code == 0
    assert all(letter.isprintable() or letter == "\n" for letter in done.output)
    assert len(done.output.splitlines()) == 3
