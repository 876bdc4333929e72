"""The services in a real systemd, in a container of their own: start, stop, watchdogs, crashes, a power cut in a dive.

Twins of the devices run in the container, as a service of the vehicle's user. What is not real here: the computer.
"""

import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from glider.tools.data.remote import file_digest
from tests.support import twinned
from tests.support.patience import patient_vehicle
from tests.support.twinned import DIVE
from tests.support.vessel import RELEASE, vessel

pytestmark = pytest.mark.realtime(seconds=150)
OUT_OF_BAND, FLIGHT = "glider-outofband.service", "glider-flight@dive.service"
TWINS = "/run/twins"


def until(condition, seconds):
    """Each question is a program in the container."""
    return twinned.until(condition, seconds, every=0.3)


class Sea:
    """A vehicle's computer with the release installed, and twins for its devices."""

    def __init__(self, computer, folder):
        self.computer = computer
        self._folder = folder

    def install(self):
        return self.computer.call("env", f"PYTHON={PYTHON}", "sh", "/root/bundle/install.sh")

    def fill(self):
        """Twins at the surface, and the board file that leads to them."""
        call = self.computer.call
        call("systemctl", "stop", "twins", check=False)
        call("install", "-d", "-o", "glider", "-g", "glider", TWINS)
        call(
            "systemd-run", "--unit=twins", "--uid=glider", "--quiet", "--setenv=GLIDER_CACHE_DIR=/var/lib/glider/cache/"
            + RELEASE, "/opt/glider/current/bin/glider", "twin", "--dir", TWINS,
        )  # fmt: skip
        until(lambda: call("test", "-S", f"{TWINS}/control", check=False).returncode == 0, 30.0)
        call("cp", f"{TWINS}/board.toml", "/etc/glider/board.toml")
        (self.computer.root / "etc/glider/dive.toml").write_text(DIVE)
        (self.computer.root / "etc/glider/vehicle.toml").write_text(patient_vehicle(self._folder).read_text())

    def depth(self):
        """By the twins, whose socket is reached through the container's own root: no program is started in it."""
        return twinned.Twins(Path(f"/proc/{self.computer.leader}/root{TWINS}")).state()["z_m"]

    def dive(self):
        """A flight that is well under water, from a vehicle that lay at the surface."""
        self.fill()
        done = self.computer.call("systemctl", "start", FLIGHT, check=False)  # returns when it is READY
        assert done.returncode == 0, self.computer.said(FLIGHT)[-1000:]
        assert self.computer.shown(FLIGHT, "ActiveState") == "active"
        until(lambda: self.depth() > 0.8, 60.0)

    def pid(self, unit):
        return int(self.computer.shown(unit, "MainPID"))

    def kill(self, unit, number):
        self.computer.call("systemctl", "kill", "--kill-whom=main", f"--signal={signal.Signals(number).name}", unit)

    def comes_up(self):
        """Brought up out of band, seen by pressure; a person then looks."""
        until(lambda: "at the surface" in self.computer.shown(OUT_OF_BAND, "StatusText"), 90.0)
        assert self.depth() < 0.6

    def acknowledge(self):
        self.computer.call(
            "runuser", "-u", "glider", "--", "env", "GLIDER_STATE_DIR=/var/lib/glider", "GLIDER_RUN_DIR=/run/glider",
            "/opt/glider/current/bin/glider", "acknowledge",
        )  # fmt: skip
        until(lambda: "at rest" in self.computer.said(OUT_OF_BAND), 10.0)


PYTHON = sys.executable


@pytest.fixture(scope="module")
def sea(tmp_path_factory):
    with vessel(tmp_path_factory.mktemp("vessel")) as computer:
        found = Sea(computer, tmp_path_factory.mktemp("files"))
        found.install()
        yield found


def test_installed_it_stands_ready_and_the_same_again_changes_nothing(sea):
    assert sea.computer.shown(OUT_OF_BAND, "ActiveState") == "active"
    assert sea.computer.call("systemctl", "is-enabled", OUT_OF_BAND).stdout == "enabled\n"
    assert sea.computer.call("systemctl", "--failed", "--no-legend").stdout == ""
    before = sea.pid(OUT_OF_BAND)
    assert "nothing" in sea.install().stdout
    assert sea.pid(OUT_OF_BAND) == before
    units = (OUT_OF_BAND, "glider-flight@x.service")
    said = sea.computer.call("systemd-analyze", "verify", "--man=no", *units, check=False)
    assert "glider" not in said.stderr, said.stderr


def test_started_and_stopped_the_dive_is_given_up_and_ends_in_order(sea):
    sea.dive()
    refused = sea.computer.call("env", f"PYTHON={PYTHON}", "sh", "/root/bundle/install.sh", check=False)
    assert refused.returncode == 2
    assert refused.stderr.startswith(f"install: {FLIGHT} ")
    sea.computer.call("systemctl", "stop", FLIGHT)  # SIGINT, and waits for the surface
    assert sea.depth() < 0.4
    assert sea.computer.shown(FLIGHT, "Result") == "exit-code"  # 1: the mission did not complete
    state = (sea.computer.root / "var/lib/glider/state.a").read_bytes()
    assert b'["ENDED",' in state


def test_a_crash_of_the_watch_is_mended_and_the_flight_flies_on(sea):
    sea.dive()
    flight, watch = sea.pid(FLIGHT), sea.pid(OUT_OF_BAND)
    sea.kill(OUT_OF_BAND, signal.SIGKILL)
    until(lambda: sea.pid(OUT_OF_BAND) not in (0, watch), 10.0)
    time.sleep(2.0)
    assert sea.pid(FLIGHT) == flight
    assert sea.computer.shown(OUT_OF_BAND, "NRestarts") == "1"

    # A loop that hangs: the watch ends it and brings the vehicle up; nothing starts it again.
    sea.kill(FLIGHT, signal.SIGSTOP)
    until(lambda: sea.computer.shown(FLIGHT, "ActiveState") == "failed", 10.0)
    assert sea.computer.shown(FLIGHT, "Result") == "signal"
    sea.comes_up()
    refused = sea.computer.call("systemctl", "start", FLIGHT, check=False)
    assert refused.returncode != 0
    sea.acknowledge()


def test_a_watch_that_hangs_is_killed_by_its_watchdog_and_there_again(sea):
    watch, restarts = sea.pid(OUT_OF_BAND), int(sea.computer.shown(OUT_OF_BAND, "NRestarts"))
    sea.kill(OUT_OF_BAND, signal.SIGSTOP)
    took = until(lambda: sea.pid(OUT_OF_BAND) not in (0, watch), 60.0)
    assert took > 10.0  # 20 s without being fed
    assert int(sea.computer.shown(OUT_OF_BAND, "NRestarts")) == restarts + 1
    assert "watchdog" in sea.computer.call("journalctl", "--no-pager", "--unit", OUT_OF_BAND).stdout.lower()


def test_a_release_whose_service_does_not_start_is_taken_back(sea):
    """It passes its self-check, and its unit is broken: the one before stands ready again."""
    root = sea.computer.root
    bad, bundle = root / "opt/glider/releases/0.1-bad", root / "root/bad"
    shutil.copytree(root / "opt/glider/releases" / RELEASE, bad)
    unit = bad / "units" / OUT_OF_BAND
    text = unit.read_text()
    unit.write_text(text.replace("-m glider.hal.outofband", "-m glider.hal.nothing"))
    assert unit.read_text() != text
    shutil.copytree(root / "root/bundle", bundle)
    (bundle / "RELEASE").write_text((bundle / "RELEASE").read_text().replace(RELEASE, "0.1-bad"))
    (bundle / "SHA256SUMS").write_text(f"{file_digest(bundle / 'RELEASE')}  RELEASE\n")
    cache = root / "var/lib/glider/cache"
    subprocess.run(["cp", "-a", cache / RELEASE, cache / "0.1-bad"], check=True)
    done = sea.computer.call("env", f"PYTHON={PYTHON}", "sh", "/root/bad/install.sh", check=False)
    assert done.returncode == 1
    assert "self-check: flight: " in done.stderr
    assert re.search(rf"install: .* 0\.1-bad .* {RELEASE}\n$", done.stderr)
    assert (root / "opt/glider/current").readlink().name == RELEASE
    assert sea.computer.shown(OUT_OF_BAND, "ActiveState") == "active"
    assert RELEASE in sea.computer.shown(OUT_OF_BAND, "ExecStart")


def test_the_power_goes_in_a_dive_and_at_boot_the_vehicle_is_brought_up(sea):
    sea.dive()
    sea.computer.cut()
    sea.computer.boot()
    # Nobody started anything: the service found the state at boot.
    assert sea.computer.shown(OUT_OF_BAND, "ActiveState") == "active"
    assert ": at the start: diving" in sea.computer.said(OUT_OF_BAND)
    assert sea.computer.shown(FLIGHT, "ActiveState") == "inactive"
    assert "no port" in sea.computer.shown(OUT_OF_BAND, "StatusText")  # the twins went with the power
    sea.fill()
    until(lambda: "pump at its end" in sea.computer.shown(OUT_OF_BAND, "StatusText"), 60.0)
    sea.comes_up()
