"""Arming: one list of checks with reasons, each of which can refuse; what cannot be checked is not fit."""

import os
import re
import shutil

import msgspec
import pytest

from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.model.supervisor_settings import Limits
from glider.hal.ports import BoardError, Condition, Hardware, Validity
from glider.tools.flight import arming
from glider.tools.flight.arming import Arming, ArmingCheck, arm, refuse
from glider.tools.flight.compose import build_flight


@pytest.fixture
def flight():
    flight = build_flight(mission="sawtooth")
    flight.board.open()
    return flight


def found(flight, folder=None, hardware=False, **more) -> dict[str, ArmingCheck]:
    checks = Arming(flight, folder=folder, hardware=hardware).run(**more)
    return {check.name: check for check in checks}


def set_limits(flight, limits) -> None:
    flight.vehicle = msgspec.structs.replace(flight.vehicle, limits=limits)


def test_a_flight_that_is_fit_passes_every_check(flight, tmp_path):
    set_limits(flight, Limits(working_depth_m=50.0))
    checks = found(flight, tmp_path, hardware=True)
    names = ["calibration", "devices", "zero depth", "attitude", "actuators", "leak", "battery", "limits", "mission"]
    names += ["clock", "disk", "kernels"]
    assert list(checks) == names
    assert all(check.passed for check in checks.values()), checks
    refuse(list(checks.values()))


def one_refused(checks: dict[str, ArmingCheck], name: str) -> str:
    assert [check.name for check in checks.values() if not check.passed] == [name]
    with pytest.raises(BoardError, match=f"^{name}: "):
        refuse(list(checks.values()))
    return checks[name].reason


def test_not_at_the_surface_is_refused(flight):
    flight.board.world.x[2] = 2.0
    reason = one_refused(found(flight), "zero depth")
    assert ", not 0.3 m " in reason
    assert "(60 at most)" in reason


def test_a_device_without_a_sample_is_refused(flight, monkeypatch):
    def silent(out):
        out[1] = Validity.MISSING

    monkeypatch.setattr(flight.board.slider_wire, "read", silent)
    assert one_refused(found(flight), "devices").endswith(" slider_wire")


def test_devices_that_do_not_answer_are_named(flight):
    flight.board.silent = lambda: ["beacon (port sensors): silent"]
    assert one_refused(found(flight), "devices") == "beacon (port sensors): silent"


def test_a_calibration_that_was_changed_is_refused(flight):
    def changed():
        raise BoardError("calibration changed")

    flight.board.check_calibration = changed
    assert one_refused(found(flight), "calibration") == "calibration changed"


def test_limits_unset_are_refused_on_hardware_alone(flight):
    set_limits(flight, None)
    assert found(flight)["limits"].passed
    assert "working_depth_m" in one_refused(found(flight, hardware=True), "limits")


def test_a_mission_deeper_than_the_hull_is_refused(flight):
    set_limits(flight, Limits(working_depth_m=3.0))
    assert "hull's 3 m" in one_refused(found(flight), "mission")


def test_upside_down_is_no_beginning(flight, monkeypatch):
    read = flight.board.imu.read

    def rolled(out):
        read(out)
        out[2] = 2.0

    monkeypatch.setattr(flight.board.imu, "read", rolled)
    assert "roll 115" in one_refused(found(flight), "attitude")


class Says:
    """A port that has read other values."""

    def __init__(self, *values):
        self.values = values

    def read(self, out):
        out[0], out[1], out[2:] = 0.0, Validity.VALID, self.values


@pytest.mark.parametrize(("wet", "said"), [(0.0, "dry"), (1.0, "wet")])
def test_a_wet_hull_does_not_dive(flight, wet, said):
    assert found(flight)["leak"].reason == "not fitted"
    flight.board.leak = Says(wet)
    checks = found(flight)
    assert (one_refused(checks, "leak") if wet else checks["leak"].reason) == said


def test_a_battery_that_is_low_already_does_not_dive(flight):
    assert found(flight)["battery"].reason == "not fitted"
    flight.board.battery = Says(11.9)
    set_limits(flight, None)
    assert re.fullmatch(r"11\.9 V; .*\[limits\] low_voltage", found(flight)["battery"].reason)
    set_limits(flight, Limits(low_voltage=12.0))
    assert re.fullmatch(r"11\.9 V, .*low_voltage of 12 V", one_refused(found(flight), "battery"))
    set_limits(flight, Limits(low_voltage=11.5))
    assert found(flight)["battery"].reason == "11.9 V"


@pytest.mark.parametrize("name", ["servo", "slider", "ballast"])
@pytest.mark.parametrize(
    ("value", "said"), [(Condition.ALARM_KEPT, "alarm_kept"), (Condition.GIVEN_UP, "given_up"), (77.0, "not known")]
)
def test_a_drive_in_alarm_does_not_dive(flight, monkeypatch, name, value, said):
    monkeypatch.setattr(getattr(flight.board, name), "read", Says(value).read)
    assert one_refused(found(flight), "actuators").endswith(said)


@pytest.mark.parametrize(("name", "value"), [("slider_wire", 0.09), ("slider_wire", -0.08), ("plunger_wire", 0.05)])
def test_a_wire_that_has_its_actuator_out_of_range_is_refused(flight, monkeypatch, name, value):
    monkeypatch.setattr(getattr(flight.board, name), "read", Says(value).read)
    assert one_refused(found(flight), "actuators").startswith(f"{name}: at ")


def test_a_gyro_that_turns_at_rest_is_refused(flight, monkeypatch):
    monkeypatch.setattr(flight.board.imu, "read", Says(0.0, 0.0, 0.0, 0.0, -2.0, 0.0).read)
    assert one_refused(found(flight), "attitude").startswith("turns at 115 deg/s")


# --- the zero of depth ------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("hpa", [-45.0, 0.0, 30.0])
def test_depth_counts_from_the_pressure_at_arming(flight, hpa):
    """In other weather than the board file's; armed with the beacon 0.3 m deep."""
    truth = flight.board.surface_pressure
    flight.board.surface_pressure, flight.board.hardware = truth - 100.0 * hpa, Hardware.TWINNED
    checks = {check.name: check for check in arm(flight, log=None)}
    assert "board file" in checks["zero depth"].reason
    assert flight.board.surface_pressure == flight.autopilot.C[ctl.SURFACE_PRESSURE]
    assert flight.board.surface_pressure == pytest.approx(truth, abs=300.0)  # 3 cm


@pytest.mark.parametrize("hpa", [-70.0, 70.0])
def test_what_no_weather_does_is_refused(flight, hpa):
    flight.board.surface_pressure -= 100.0 * hpa
    assert "(60 at most)" in one_refused(found(flight), "zero depth")


@pytest.mark.parametrize("shift", [0.0, 5.0])
def test_a_clock_that_stands_or_leaps_is_refused(flight, monkeypatch, shift):
    clock, asked = flight.board.clock, []

    def now():
        asked.append(0)
        return 100.0 + shift * len(asked)

    monkeypatch.setattr(clock, "now", now)
    monkeypatch.setattr(clock, "sleep_until", lambda deadline: flight.board.world.advance(deadline - 100.0))
    assert not found(flight)["clock"].passed


def test_a_full_disk_is_refused(flight, tmp_path, monkeypatch):
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(arming.shutil, "disk_usage", lambda folder: usage._replace(free=60_000_000))
    assert re.search(r"60 MB .* 86 MB", one_refused(found(flight, tmp_path), "disk"))


@pytest.mark.skipif(os.getuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written_is_refused(flight, tmp_path):
    tmp_path.chmod(0o500)
    assert "written" in one_refused(found(flight, tmp_path), "disk")


def test_a_check_that_breaks_has_not_passed(flight):
    del flight.board.armed_depth
    assert "AttributeError: " in one_refused(found(flight), "zero depth")


def test_switched_off_nothing_refuses(flight):
    flight.board.world.x[2] = 2.0
    assert all(check.passed for check in found(flight, disabled=True).values())


def test_simulated_boards_are_not_asked(flight):
    flight.board.world.x[2] = 2.0
    assert arm(flight, log=None) == []
    flight.board.hardware = Hardware.TWINNED
    with pytest.raises(BoardError, match="zero depth"):
        arm(flight, log=None)
