"""Whole flights: missions complete, repeat bit for bit, and fly the same compiled as under the real runtime."""

import json
import subprocess
import sys

import numpy as np
import pytest

from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.core.layouts.control_layout import LEG
from glider.firmware.runtime import Ending
from glider.hal.recorder.recorder import NullRecorder
from glider.sim_backend.core.closed_loop import N_END, N_TRACE, fly
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.fleet import fly_fleet
from glider.tools.data.log.reader import read_log
from glider.tools.data.log.rundata import export_case
from glider.tools.data.runs.case import load_case
from glider.tools.flight.compose import build_flight, build_runtime, record_specs
from glider.tools.inference.problem import problem_of
from tests.support.commands import glider

MANY = {
    "command_delay": {"delay": 0.355},
    "slider_backlash": {"width": 0.004},
    "servo_backlash": {"width": 0.1},
    "ballast_leak": {"rate": 0.0001},
    "drag": {"scale": 0.2},
    "current_shear": {"north": 0.02},
    "waves": {"amplitude": 0.05, "period": 4.0},
    "attitude_lag": {"time": 0.1},
    "depth_lag": {"time": 0.3},
    "compass": {"s1": 0.1},
}


def flown(mission, seed=0, effects=None):
    """Fly under the real runtime; returns the flight and what the recorder was given, (ticks, fields)."""
    flight = build_flight(mission=mission, seed=seed, effects=effects)
    if effects:
        # so much at once pitches the vehicle past 60 deg, where the supervisor ends it, and Euler angles jump
        for row in (sup.FAULT_STEEP, sup.FAULT_IMPLAUSIBLE):
            flight.supervisor.disable(row)
    recorder = NullRecorder(record_specs(flight))
    rows = []
    channel = recorder.channel("/tick")
    channel.commit = lambda t: rows.append(channel.values.copy())
    flight.board.open()
    runtime = build_runtime(flight, recorder)
    runtime.arm()
    try:
        ending = runtime.run()
    finally:
        runtime.disarm()
    assert ending == Ending.SURFACED
    return flight, np.array(rows)


@pytest.mark.parametrize("mission", ["sawtooth", "spiral"])
@pytest.mark.parametrize("seed", [0, 1])
def test_shipped_missions_complete_and_surface(mission, seed):
    flight, _ = flown(mission, seed)
    assert flight.autopilot.mode == "completed"
    errors = flight.autopilot.rms_errors()
    assert errors["pitch_rad"] < np.radians(3.0)
    assert errors["roll_rad"] < np.radians(3.0)
    if mission == "sawtooth":
        assert errors["depth_m"] < 0.25


def test_a_seed_repeats_bit_for_bit_and_another_differs():
    _, first = flown("spiral", 5)
    _, again = flown("spiral", 5)
    _, other = flown("spiral", 6)
    steady = [i for i in range(first.shape[1]) if i not in (26, 27)]  # lateness and duration are the machine's
    assert np.array_equal(first[:, steady], again[:, steady], equal_nan=True)
    assert not np.array_equal(first[:100, steady], other[:100, steady], equal_nan=True)


@pytest.mark.parametrize(
    ("mission", "effects"),
    [("sawtooth", None), ("spiral", None), ("sawtooth", MANY), ("spiral", {"waves": MANY["waves"]})],
)
def test_compiled_flight_is_the_runtimes_flight(mission, effects):
    """The campaign's compiled loop and the real runtime give the same numbers to the last bit, effects and all."""
    reference, rows = flown(mission, 2, effects)
    flight = build_flight(mission=mission, seed=2, effects=effects)
    world, pilot = flight.board.world, flight.autopilot
    trace, end = np.zeros((len(rows), N_TRACE)), np.zeros(N_END)
    ticks = fly(
        world.P, pilot.P, pilot.C, pilot.legs, pilot.nav, world.E, world.F, world.waves, world.sensors,
        world.errors, world.seed, world.x, world.dt, len(rows), 1, trace, end,
    )  # fmt: skip
    assert end[0] == reference.autopilot.ap[0]
    assert end[3] == reference.autopilot.ap[LEG]
    assert np.array_equal(trace[:ticks, 7:10], rows[:ticks, 1:4])  # commands
    assert np.array_equal(trace[:ticks, 1], rows[:ticks, 13])  # depth estimate


def test_a_hidden_difference_shows_in_the_flight():
    _, nominal = flown("spiral", 3)
    _, heavy = flown("spiral", 3, {"net_buoyancy": {"mass": 0.03}})
    n = min(len(nominal), len(heavy))
    assert np.nanmax(np.abs(nominal[:n, 13] - heavy[:n, 13])) > 0.2


@pytest.fixture(scope="module")
def typed(tmp_path_factory):
    """A flight as a user types it: its folder, and what it said."""
    folder = tmp_path_factory.mktemp("typed")
    command = [sys.executable, "-m", "glider.tools.cli.main", "fly", "--mission", "spiral", "--json"]
    return folder, subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)


def test_fly_as_a_user_types_it(typed):
    folder, done = typed
    result = json.loads(done.stdout)
    assert done.returncode == 0
    assert result["completed"]
    assert result["log"] == "spiral-001.mcap"
    assert result["records"]["dropped"] == 0
    assert result["records"]["complete"]
    assert (folder / "spiral-001.mcap").stat().st_size > 100_000
    assert glider("fly", "--mission", "spiral", "--json", "--log", "spiral-001.mcap", cwd=folder).returncode == 2


def test_the_progress_of_a_dive_given_up_does_not_say_that_it_was_flown(tmp_path):
    mission = tmp_path / "late.toml"
    leg = "[[leg]]\ndepth_m = 4.0\npitch_deg = -20.0\ntime_limit_s = {limit}\n"
    mission.write_text(
        'format = 1\nname = "late"\ntime_limit_s = 200.0\n[site]\nname = "pool"\ndepth_m = 6.0\n'
        + leg.format(limit=4.0) + leg.format(limit=100.0)
    )  # fmt: skip
    done = glider("fly", "--mission", "late.toml", "--no-log", cwd=tmp_path)
    assert done.returncode == 1
    assert ": leg 1" in done.stderr
    assert "2/2" not in done.stderr


def test_samples_of_an_exported_log_stand_at_the_times_when_they_were_taken(typed, tmp_path):
    """A draw-wire's sample comes a tick late; in its row it would be late commands, hundreds of nat of them."""
    export_case(read_log(typed[0] / "spiral-001.mcap"), tmp_path / "case")
    case = load_case(tmp_path / "case")
    (run,) = case.runs
    for column in ("slider_m", "ballast_kg", "depth_m", "pitch_rad"):
        true = np.array(run.extra["true_z_m" if column == "depth_m" else f"true_{column}"], dtype=float)
        off = [np.nanstd(run.columns[column][100:-100] - np.roll(true, lag)[100:-100]) for lag in (-1, 0, 1)]
        assert np.argmin(off) == 1, column
    problem, F = problem_of(case), np.zeros(ef.N_F)
    misfits = []
    for delay in (0.0, 0.02):
        F[ef.COMMAND_DELAY] = delay
        misfits.append(problem.filter(problem.model.P, F, begin=True).misfit.sum())
    assert misfits[1] > misfits[0] + 100.0


def test_check_tells_what_is_wrong(tmp_path):
    assert glider("check", cwd=tmp_path).returncode == 0
    (tmp_path / "v.toml").write_text("format = 1\n")
    done = glider("check", "--vehicle", "v.toml", "--json", cwd=tmp_path)
    assert done.returncode == 1
    findings = {f["check"]: f for f in json.loads(done.stdout)["findings"]}
    assert not findings["vehicle"]["pass"]
    assert "v.toml" in findings["vehicle"]["message"]
    assert findings["mission"]["pass"]


@pytest.mark.parametrize("effects", [({}, {}), ({}, MANY)], ids=["nominal", "one in two with effects"])
def test_a_fleet_flies_as_its_flights_do_alone(effects):
    flights = [
        build_flight(mission=mission, seed=seed, effects=effects[seed % 2])
        for mission in ("sawtooth", "spiral")
        for seed in (4, 5)
    ]
    worlds, pilots = [flight.board.world for flight in flights], [flight.autopilot for flight in flights]
    together = fly_fleet(worlds, pilots, max_seconds=200.0, trace_every=1.0)
    assert together.completed.all()
    for world, state in zip(worlds, together.states, strict=True):
        assert not np.array_equal(world.x, state)  # worlds stay where they are
    for i in range(len(flights)):
        alone = fly_fleet(worlds[i : i + 1], pilots[i : i + 1], max_seconds=200.0, trace_every=1.0)
        assert np.array_equal(alone.traces[0], together.traces[i], equal_nan=True)
        assert np.array_equal(alone.states[0], together.states[i])
        assert alone.seconds[0] == together.seconds[i]
