"""A board file whose limits are narrower than the vehicle's: flown with, or refused; what a device took is heard."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.core.vehicle import layout
from glider.firmware.faults import Reaction
from glider.firmware.runtime import Ending
from glider.hal.recorder.recorder import NullRecorder
from glider.hal.strict import ConfigError
from glider.tools.bench.boardtext import set_values
from glider.tools.cli.check import check
from glider.tools.cli.fly import fly
from glider.tools.flight.compose import build_flight, build_runtime, record_specs

TWIN = Path("sim_backend/boards/twin.toml").read_text()


def board(tmp_path, **limits_m):
    """The twin's board file with other limits of its drives, m."""
    text = set_values(TWIN, {f"{name}.limits_m": limits for name, limits in limits_m.items()})
    path = tmp_path / "board.toml"
    path.write_text(text)
    return str(path)


def plunger(tmp_path, share):
    """The twin's board file with a plunger that goes so far of its way to each end."""
    from glider.sim_backend.twins.boardfile import decode_twin_file

    vehicle = build_flight(mission="sawtooth").vehicle.actuators.ballast
    end = vehicle.range[1] / (998.2 * vehicle.plunger_area)
    assert decode_twin_file(TWIN, "twin").ballast.limits_m[1] >= end
    return board(tmp_path, ballast=(-share * end, share * end))


def test_narrower_limits_are_the_vehicles_on_this_board(tmp_path):
    flight = build_flight(mission="sawtooth", board=plunger(tmp_path, 0.8))
    assert flight.vehicle.actuators.ballast.range == pytest.approx((-0.16, 0.16), rel=0.001)
    assert flight.autopilot.P[layout.BALLAST_MAX] == pytest.approx(0.16, rel=0.001)
    assert flight.vehicle.actuators.slider.range == (-0.06, 0.06)


def test_a_pair_that_cannot_fly_is_refused_by_file_and_key(tmp_path):
    path = plunger(tmp_path, 0.4)
    with pytest.raises(ConfigError, match=r"board\.toml: ballast\.limits: .* -0\.08"):
        build_flight(mission="sawtooth", board=path)
    done = CliRunner().invoke(fly, ["--board", path, "--no-log"], standalone_mode=False)
    assert isinstance(done.exception, ConfigError)  # the command line's exit code 2
    done = CliRunner().invoke(check, ["--board", path])
    assert done.exit_code == 1
    assert "ballast.limits" in done.output


def test_a_mission_that_asks_for_more_than_the_board_lets_is_refused(tmp_path):
    mission = tmp_path / "heavy.toml"
    mission.write_text(
        'format = 1\nname = "heavy"\ntime_limit_s = 60.0\n[site]\nname = "pool"\ndepth_m = 6.0\n'
        "[[leg]]\nduration_s = 5.0\npitch_deg = 0.0\nballast_kg = 0.18\n"
    )
    with pytest.raises(ConfigError, match=r"leg\[0\]\.ballast_kg: 0\.18 kg"):
        build_flight(mission=str(mission), board=plunger(tmp_path, 0.8))


@pytest.mark.parametrize("share", [0.8, 0.6])
def test_a_healthy_vehicle_whose_drive_takes_less_is_not_given_up_as_stalled(share, monkeypatch):
    """Limits that nobody filed: the drive says what it took, and that is what filter, anti-windup and stall detector
    go on from."""
    flight = build_flight(mission="sawtooth")
    port, taken = flight.board.ballast, []
    honest = port.command

    def narrow(value):
        taken.append(honest(float(np.clip(value, -0.2, share * 0.2))))
        return taken[-1]

    monkeypatch.setattr(port, "command", narrow)
    flight.board.open()
    runtime = build_runtime(flight, NullRecorder(record_specs(flight)))
    runtime.arm()
    try:
        for _ in range(600):
            runtime.tick()
            assert flight.autopilot.ap[ctl.SENT_BALLAST] == flight.supervisor.G[sup.SENT + 2] == taken[-1]
        assert runtime.run() == Ending.SURFACED
    finally:
        runtime.disarm()
    assert max(taken) == share * 0.2
    assert flight.supervisor.worst(sup.FAULT_STALL) == Reaction.NOTHING
