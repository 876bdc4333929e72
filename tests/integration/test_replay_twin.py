"""A flight on wires, its device errors in its log, and the log flown again, to the bit."""

import functools
import json

import pytest

from glider.hal.ports import BoardError
from glider.tools.data.log.reader import read_log
from glider.tools.flight import sortie
from glider.tools.flight.compose import build_flight, build_recorder
from tests.support.commands import glider
from tests.support.logs import DIP
from tests.support.patience import patient_vehicle

pytestmark = pytest.mark.realtime

TRIES = 3  # of arming: on a busy machine a twin may be kept waiting


def fly(folder, on_second=None):
    """Fly DIP through drivers, wires and twins; on_second(flight, t) may break them. The log."""
    (folder / "dip.toml").write_text(DIP)
    log = folder / "dip.mcap"
    for attempt in range(TRIES):
        flight = build_flight(mission=str(folder / "dip.toml"), vehicle=str(patient_vehicle(folder)), board="twin")
        make_recorder = functools.partial(build_recorder, flight, log)
        second = None if on_second is None else functools.partial(on_second, flight)
        try:
            sortie.fly(flight, sortie.FlightHost(flight, name="dip"), make_recorder, on_second=second)
            break
        except BoardError:
            if attempt == TRIES - 1:
                raise
    return flight, log


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A pressure sensor that is silent for two seconds."""

    def disturb(flight, t):
        second = round(t)
        begun.setdefault("t", second)
        if second == begun["t"] + 2:
            assert flight.board.control("fault beacon silent") == "ok"
        elif second == begun["t"] + 4:
            assert flight.board.control("fault beacon none") == "ok"

    begun: dict[str, int] = {}
    return fly(tmp_path_factory.mktemp("twin"), disturb)


def test_a_flight_on_twins_is_replayed_to_the_bit(flown):
    _, path = flown
    done = glider("log", "replay", path, "--json", cwd=path.parent)
    assert done.stdout, done.stderr
    found = json.loads(done.stdout)
    assert found["first"] is None, found["first"]
    assert done.returncode == 0
    assert found["replayed"] == found["ticks"] > 200


def test_a_change_of_a_devices_error_counts_is_an_event(flown):
    _, path = flown
    log = read_log(path)
    begun = log.topics["/tick"].column("t_s")[0]
    said = [event for event in log.events if "beacon: timeouts" in event.text and event.time_s - begun > 2.5]
    assert said
    assert said[0].time_s - begun < 4.5


def test_the_health_of_the_devices_at_the_end_is_in_the_log(flown):
    flight, path = flown
    devices = json.loads(read_log(path).ending["devices"])
    assert devices == json.loads(json.dumps(flight.board.health()))
    assert devices["beacon"]["timeouts"] > 0
    lines = glider("log", "info", path, cwd=path.parent).stdout.splitlines()
    (beacon,) = [line for line in lines if line.split()[:2] == ["devices", "beacon:"]]
    assert f"timeouts {devices['beacon']['timeouts']}" in beacon


def test_actuator_limits_and_periods_are_the_boards(flown):
    flight, path = flown
    facts = read_log(path).metadata
    assert json.loads(facts["actuator_limits"])["slider"] == list(flight.board.slider.limits)
    assert json.loads(facts["periods_s"]) == flight.board.periods
