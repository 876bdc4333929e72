"""A flight on twins watched by the protocol's own client, over a real sshd; and an onlooker who does not read."""

import asyncio
import contextlib
import importlib.util
import json
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path

import pytest

from glider.hal.recorder import live_stream
from glider.hal.recorder.recorder import Recorder
from glider.hal.recorder.schema import Field, RecordSpec
from glider.tools.data.log.reader import read_log
from glider.tools.flight.live_view import VIEW, LogLine, layout
from tests.support.sshd import NAME, sshd
from tests.support.twinned import until

pytestmark = pytest.mark.realtime(seconds=30)
SPEC = RecordSpec("/tick", "glider/msg/Tick", tuple(Field(f"x{i}", "1") for i in range(60)))


@pytest.fixture
def recorder(tmp_path):
    with Recorder(tmp_path / "a.mcap", (SPEC,), metadata={"mission": "m"}, live_stream=tmp_path / "live") as found:
        yield found


def write(recorder, count, t=0.0):
    channel = recorder.channel("/tick")
    for i in range(count):
        channel.values[:] = i
        channel.commit(t + 0.02 * i)


def test_an_onlooker_gets_ten_a_second_and_all_events_and_the_log_is_whole(recorder, tmp_path):
    line = LogLine(tmp_path / "live")
    assert line.metadata["mission"] == "m"
    records = line.records()
    time.sleep(0.2)
    write(recorder, 100)  # two seconds of flight
    recorder.event(2.0, 30, "surfaced\x07")
    seen = [next(records) for _ in range(21)]
    assert [record.numbers[0] for record in seen[:20]] == list(range(0, 100, 5))
    assert (seen[20].severity, seen[20].text) == (30, "surfaced\x07")
    assert recorder.close().complete
    assert list(records) == []  # the end of the flight
    assert read_log(tmp_path / "a.mcap").topics["/tick"].count == 100
    assert not (tmp_path / "live").exists()


def test_one_who_does_not_read_and_one_too_many_hold_up_nobody(recorder, tmp_path):
    deaf = []
    for _ in range(live_stream.MAX_CONNECTIONS + 1):
        line = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        line.connect(str(tmp_path / "live"))
        deaf.append(line)
        time.sleep(0.05)
    assert oct((tmp_path / "live").stat().st_mode)[-3:] == "660"
    for i in range(20):
        write(recorder, 1000, t=20.0 * i)  # 400 s of flight: 2 MB for each
        until(lambda: recorder.health().pending < 500, 30.0)
    report = recorder.close()
    assert report.complete
    assert report.dropped == 0
    deaf[-1].settimeout(1.0)
    assert deaf[-1].recv(10) == b""  # one too many was sent away
    for line in deaf:
        line.close()


def test_without_being_asked_for_there_is_no_socket(tmp_path):
    with Recorder(tmp_path / "a.mcap", (SPEC,)) as recorder:
        opened = [str(file.readlink()) for file in Path(f"/proc/{recorder.pid}/fd").iterdir()]
    assert not any(name.startswith("socket:") for name in opened)
    assert any("memfd" in name for name in opened)


def test_a_place_where_no_socket_can_be_costs_the_view_alone(tmp_path, capfd):
    with Recorder(tmp_path / "a.mcap", (SPEC,), live_stream=tmp_path / "nowhere" / "live") as recorder:
        write(recorder, 10)
        assert recorder.close().complete
    assert "live view" in capfd.readouterr().err


def test_the_layout_shows_topics_that_are_there():
    found = json.loads(layout())
    paths = [path["value"] for panel in found["configById"].values() for path in panel.get("paths", ())]
    assert {path.removeprefix("/view.") for path in paths} <= {*VIEW, "mode", "reaction", "fault"}
    text = json.dumps(found["layout"])
    assert all(f'"{panel}"' in text for panel in found["configById"])


@pytest.mark.skipif(
    not all(map(importlib.util.find_spec, ("foxglove", "websockets"))), reason="the extra `live` is not installed"
)
def test_a_flight_on_twins_is_seen_by_the_protocols_own_client_over_ssh(tmp_path):
    (tmp_path / "keys").mkdir()
    with sshd(tmp_path / "keys") as server, contextlib.ExitStack() as ends:

        def start(*words, **more):
            command = [sys.executable, "-m", "glider.tools.cli.main", *words]
            process = ends.enter_context(subprocess.Popen(command, text=True, **more))
            ends.callback(process.kill)
            return process

        (tmp_path / "dip.toml").write_text(DIP)
        flight = start(
            "fly", "--board", "twin", "--mission", str(tmp_path / "dip.toml"), "--state", str(tmp_path / "s"),
            "--live", "--log", str(tmp_path / "flight.mcap"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        until(lambda: (tmp_path / "s" / "live").exists() or flight.poll() is not None, 60.0)
        view = start(
            "live", NAME, "--socket", str(tmp_path / "s" / "live"), "--port", "0", stderr=subprocess.PIPE,
            env=server.reached(),
        )  # fmt: skip
        said = view.stderr.readline()
        assert "ws://localhost:" in said, said
        seen = asyncio.run(asyncio.wait_for(watch(said.split()[-1]), 60.0))
        flight.kill()
        assert "ended" in view.stderr.readline()
        assert view.wait(20.0) == 0
    assert set(seen) >= {"/tick", "/view", "/pose"}
    views = [json.loads(data) for data in seen["/view"]]
    assert all(one["mode"] in ("waiting", "flying") for one in views)
    assert all(abs(one["depth_m"]) < 4.0 for one in views if one["depth_m"] is not None)
    times = [one["time_s"] for one in views]
    assert times == sorted(times)
    # A tick is the log's own message: the same numbers stand in both.
    ticks = read_log(tmp_path / "flight.mcap").topics["/tick"]
    numbers = struct.unpack_from("<d", seen["/tick"][-1], 4)[0]
    assert numbers in ticks.column("t_s")


DIP = """format = 1
name = "dip"
time_limit_s = 120.0
[site]
name = "pool"
depth_m = 6.0
[[leg]]
depth_m = 2.0
pitch_deg = -20.0
time_limit_s = 60.0
"""


async def watch(address, enough=10):
    """Subscribe to every channel; topic -> payloads, until /view came so many times."""
    from websockets.asyncio.client import connect

    seen, topics = {}, {}
    async with connect(address, subprotocols=["foxglove.sdk.v1"]) as line:
        while len(seen.get("/view", ())) < enough:
            message = await line.recv()
            if isinstance(message, str):
                found = json.loads(message)
                if found["op"] == "advertise":
                    fresh = {channel["id"]: channel["topic"] for channel in found["channels"]}
                    topics |= fresh
                    asked = [{"id": number, "channelId": number} for number in fresh]
                    await line.send(json.dumps({"op": "subscribe", "subscriptions": asked}))
            elif message[0] == 1:  # message data: subscription, time in ns, payload
                subscription, _ = struct.unpack_from("<IQ", message, 1)
                seen.setdefault(topics[subscription], []).append(message[13:])
    return seen
