"""Logs packed by pymavlink itself come in; a cut or damaged one is named with byte and message."""

import math
import struct
from pathlib import Path

import numpy as np
import pytest

from glider.tools.cli.import_ import import_ as group
from glider.tools.data.errors import InputError
from glider.tools.data.importers.ardusub import read_ardusub
from glider.tools.data.importers.streams import import_streams
from glider.tools.data.runs.case import load_case

DFReader = pytest.importorskip("pymavlink.DFReader")
START = 1_764_000_000.0
FORMATS = {  # type, name, format, columns
    130: ("ATT", "Qccc", "TimeUS,Roll,Pitch,Yaw"),
    131: ("IMU", "QBfff", "TimeUS,I,GyrX,GyrY,GyrZ"),
    132: ("BARO", "QBf", "TimeUS,I,Press"),
}


def dataflash(seconds: float = 20.0) -> bytes:
    """A DataFlash log at 20 Hz, its messages packed by pymavlink: two IMUs, two barometers."""
    head = DFReader.DFFormat(0x80, "FMT", 89, "BBnNZ", "Type,Length,Name,Format,Columns")
    formats, data = {}, b""
    for kind, (name, layout, columns) in {0x80: ("FMT", "BBnNZ", head.columns), **FORMATS}.items():
        text = columns if isinstance(columns, str) else ",".join(columns)
        size = 3 + struct.calcsize("<" + "".join(DFReader.FORMAT_TO_STRUCT[one][0] for one in layout))
        formats[name] = DFReader.DFFormat(kind, name, size, layout, text)
        fields = [kind, size, name.encode(), layout.encode(), text.encode()]
        data += DFReader.DFMessage(head, fields, False, None).get_msgbuf()

    def pack(name: str, *values) -> bytes:
        return DFReader.DFMessage(formats[name], list(values), True, None).get_msgbuf()

    for n in range(int(20 * seconds)):
        t, us = n / 20, 5_000_000 + 50_000 * n
        data += pack("ATT", us, round(100 * 5 * math.sin(t)), -2000, 9000 + 10 * n)
        data += pack("IMU", us, 0, 0.1, 0.2, 0.3) + pack("IMU", us, 1, 9.0, 9.0, 9.0)
        data += pack("BARO", us, 0, 99999.0) + pack("BARO", us, 1, 101325.0 + 998.0 * 9.81 * 0.1 * t)
    return data


def telemetry(seconds: float = 20.0) -> bytes:
    """A telemetry log at 10 Hz, packed by pymavlink's own writer; each message is up to 80 ms late."""
    from pymavlink.dialects.v20 import ardupilotmega as mav

    link, data = mav.MAVLink(None, srcSystem=1, srcComponent=1), b""
    for n in range(int(10 * seconds)):
        t = n / 10
        boot, receipt = 3000 + 100 * n, START + 3.0 + t + 0.08 * (n % 3) / 2
        messages = (
            mav.MAVLink_attitude_message(boot, 0.1 * math.sin(t), -0.3, 1.0, 0.01, 0.02, 0.03),
            mav.MAVLink_scaled_pressure2_message(boot, 1013.25 + 0.01 * 998.0 * 9.81 * 0.1 * t, 0.0, 1500),
        )
        for message in messages:
            data += struct.pack(">Q", round(1e6 * receipt)) + message.pack(link)
    return data


def imported(path: Path, mapping: str, tmp_path: Path, partial: bool = False):
    found = import_streams([path], mapping, tmp_path / "case", read_ardusub, partial)
    return load_case(tmp_path / "case").runs[0], found.notes


def test_a_dataflash_log_becomes_a_run(tmp_path):
    (tmp_path / "00000012.BIN").write_bytes(dataflash() + bytes(100))
    run, notes = imported(tmp_path / "00000012.BIN", "ardusub-bin", tmp_path)
    inside = slice(1, -1)
    # a row is the mean of the two or three samples nearest to it
    assert np.allclose(run.columns["roll_rad"][inside], np.radians(5 * np.sin(run.t[inside])), atol=4e-3)
    assert np.allclose(run.columns["pitch_rad"], math.radians(-20.0))
    assert np.allclose(run.columns["q_rad_s"], 0.2)
    assert np.allclose(run.columns["depth_m"][inside], 0.1 * run.t[inside], atol=4e-3)
    assert run.start_utc == ""
    assert notes == []


def test_a_telemetry_log_becomes_a_run_on_the_vehicle_s_clock(tmp_path):
    (tmp_path / "dive.tlog").write_bytes(telemetry())
    run, _ = imported(tmp_path / "dive.tlog", "ardusub-tlog", tmp_path)
    assert np.allclose(run.columns["roll_rad"][1:-1], 0.1 * np.sin(run.t[1:-1]), atol=8e-3)
    assert np.allclose(run.columns["r_rad_s"], 0.03)
    assert np.allclose(run.columns["depth_m"][1:-1], 0.1 * run.t[1:-1], atol=8e-3)
    assert run.start_utc == "2025-11-24T16:00:03.000Z"


@pytest.mark.parametrize(("make", "name", "mapping"), [
    (dataflash, "a.BIN", "ardusub-bin"), (telemetry, "a.tlog", "ardusub-tlog"),
])  # fmt: skip
def test_a_cut_log_is_named_with_byte_and_message(make, name, mapping, tmp_path):
    data, path = make(), tmp_path / name
    end = 2 * len(data) // 3 + 5
    path.write_bytes(data[:end])
    with pytest.raises(InputError, match=rf"{name}: cut.* {end}, .* \d+, .* \d+"):
        imported(path, mapping, tmp_path)
    run, notes = imported(path, mapping, tmp_path, partial=True)
    assert 12.0 < run.t[-1] < 14.0
    assert any(f"byte {end}" in note for note in notes)


def test_a_damaged_log_is_named(tmp_path):
    data, path = bytearray(dataflash()), tmp_path / "a.BIN"
    data[2000:2060] = 60 * b"z"
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"a.BIN: damaged .*\d+: "):
        imported(path, "ardusub-bin", tmp_path)


def test_every_cut_is_seen_where_no_message_ends():
    from glider.tools.data.importers.ardusub import dataflash_end, telemetry_end

    for make, look in ((dataflash, dataflash_end), (telemetry, telemetry_end)):
        data, ends = make(0.2), set()
        for end in range(1, len(data) + 1):
            place, messages, wrong = look(data[:end])
            assert place <= end
            if wrong is None:
                ends.add((end, messages))
        assert len(ends) == max(messages for _, messages in ends)


@pytest.mark.parametrize(("text", "said"), [
    (b"", "holds no message"), (b"no log at all", "holds no message"),
])  # fmt: skip
def test_what_is_no_log_is_said(text, said, tmp_path):
    (tmp_path / "a.BIN").write_bytes(text)
    with pytest.raises(InputError, match=said):
        imported(tmp_path / "a.BIN", "ardusub-bin", tmp_path)


def test_wrong_names_are_said(tmp_path):
    (tmp_path / "a.BIN").write_bytes(dataflash(1.0))
    text = (Path(__file__).resolve().parents[3] / "tools/data/importers/stream_maps/ardusub-bin.toml").read_text()
    for old, new, said in (
        ("BARO[1]", "BARO[2]", r"depth_m: no message of topic 'BARO\[2\]'; it has ATT, BARO, IMU"),
        ('"Yaw"', '"Heading"', "message ATT has no number 'Heading'"),
        ('"ATT"', '"A T"', "not a message's name: 'A T'"),
    ):
        (tmp_path / "map.toml").write_text(text.replace(old, new))
        with pytest.raises(InputError, match=said):
            imported(tmp_path / "a.BIN", str(tmp_path / "map.toml"), tmp_path)


def test_the_commands_end_with_code_2_and_one_line(tmp_path, capsys, monkeypatch):
    from glider.tools.cli.common import report_errors

    (tmp_path / "a.BIN").write_bytes(dataflash()[:5000])
    monkeypatch.setattr("sys.argv", ["import", "ardusub", str(tmp_path / "a.BIN"), "--map", "ardusub-bin"])
    assert report_errors(group) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1
    assert "byte 5000, " in said[0]
    assert "--partial" in said[0]
