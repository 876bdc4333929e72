"""The paper's figures: pairing, measures against plain recomputation, and what the command prints."""

import json

import numpy as np
import pytest

from glider.firmware.model.gains import Control
from glider.sim_backend.core.closed_loop import TRACE
from glider.tools.data.sources import load_vehicle
from glider.tools.study.reproduce import circle, tracking
from glider.tools.study.reproduce.design import LAST, Batch, Variant, fly_design, mission_of
from tests.support.commands import glider

VEHICLE = load_vehicle("roughie")


@pytest.fixture(scope="module")
def pitched():
    legs = {target: tracking.FIG5.leg(target) for target in (30.0, -30.0)}
    variants = [Variant("pid", Control()), Variant("law", Control(controller="law"))]
    return fly_design(VEHICLE, legs, variants, [0.0, 0.05], range(2), ("estimated", "true"), trace_every=0.02)


def test_a_seed_is_the_same_vehicle_for_every_controller():
    vehicles = {}
    legs = {5.0: tracking.FIG6.leg(5.0)}
    for name in ("pid", "law"):
        batch = fly_design(VEHICLE, legs, [Variant(name, Control(controller=name))], [0.0], range(2))
        assert batch.result is not None
        vehicles[name] = batch.result.column("true_depth")[:, 0]
    assert np.array_equal(vehicles["pid"], vehicles["law"])


def test_tracking_error_is_the_mean_distance_to_the_reference(pitched):
    """Against the trace of every tick: measured and estimated pitch differ by the sensor's noise and bias."""
    errors = tracking.tracking_error(tracking.FIG5, pitched)
    pitch, reference = pitched.result.column("pitch"), pitched.result.column("ref_pitch")
    for i, key in enumerate(pitched.keys):
        plain = 100 * np.nanmean(np.abs(pitch[i] - reference[i])) / np.radians(abs(key["target"]))
        assert errors[i] == pytest.approx(plain, abs=100 * 0.01 / np.radians(30.0))


def test_final_error_is_taken_at_the_end(pitched):
    final = tracking.final_error(tracking.FIG5, pitched)
    truth = np.degrees(pitched.result.column("true_pitch"))
    for i, key in enumerate(pitched.keys):
        assert final[i] == pytest.approx(np.abs(truth[i, -LAST - 1 : -1] - key["target"]).mean())
    assert (final < 3.0).all()


def test_every_case_has_its_fields_and_interval(pitched):
    rows = tracking.summary(tracking.FIG5, pitched)
    assert len(rows) == 2 * 2 * 2 * 2  # targets, controllers, strengths, states
    for row in rows:
        low, high = row["tracking_error_ci90"]
        assert low <= row["tracking_error_pct"] <= high
        assert row["seeds"] == 2
        assert row["state"] in ("estimated", "true")


def test_targets_together_are_compared_in_pairs_of_seeds(pitched):
    errors = tracking.tracking_error(tracking.FIG5, pitched)
    for row in tracking.compare(tracking.FIG5, pitched, (30.0, -30.0)):
        own = [row["controller"], row["noise"], row["state"]]
        of = [i for i, key in enumerate(pitched.keys) if [key["controller"], key["noise"], key["state"]] == own]
        assert row["tracking_error_pct"] == pytest.approx(errors[of].mean())
        low, high = row["tracking_error_ci90"]
        assert low <= row["tracking_error_pct"] <= high
        assert row["seeds"] == 2
    # the interval of differences from the best-tuned PID, here played by the law's own flights
    batch = Batch([{**key, "controller": key["controller"].replace("law", "pid_tuned")} for key in pitched.keys])
    batch.result = pitched.result
    for row in tracking.compare(tracking.FIG5, batch, (30.0,)):
        if row["controller"] == "pid_tuned":
            assert row["less_pid_tuned_ci90"] == (0.0, 0.0)
        else:
            pairs = []
            for seed in range(2):
                at = {
                    k["controller"]: i
                    for i, k in enumerate(batch.keys)
                    if (k["target"], k["seed"], k["noise"], k["state"]) == (30.0, seed, row["noise"], row["state"])
                }
                pairs.append(errors[at["pid"]] - errors[at["pid_tuned"]])
            low, high = row["less_pid_tuned_ci90"]
            assert min(pairs) - 1e-9 <= low <= np.mean(pairs) <= high <= max(pairs) + 1e-9


def test_strength_is_found_between_the_measured_ones():
    def row(noise, error):
        return {"controller": "pid", "noise": noise, "state": "estimated", "target": 45.0, "tracking_error_pct": error}

    rows = [row(0.0, 1.0), row(0.1, 5.0), row(0.2, 25.0)]
    assert tracking.strength_at(rows, "pid", (45.0,), 15.0) == pytest.approx(0.15)
    assert tracking.strength_at(rows, "pid", (45.0,), 30.0) is None


def test_a_flight_to_a_depth_lasts_its_time_and_is_complete_within_20_cm():
    legs = {2.0: tracking.FIG6.leg(2.0), -2.0: tracking.FIG6.leg(-2.0)}
    batch = fly_design(VEHICLE, legs, [Variant("pid", Control())], [0.003], range(2))
    assert (batch.result.ticks == 3000).all()
    assert all(row["completed"] == 1.0 for row in tracking.summary(tracking.FIG6, batch))


def test_the_circle_closes_and_turns_one_way_in_calm_water():
    flown = circle.fly_circles(VEHICLE, "hybrid", (0.0,), 3)
    (row,) = circle.summary(flown, "hybrid")
    assert row["completed"] == 1.0
    assert row["one_way"] == 1.0
    assert row["closure_m"] <= circle.HULL


def test_closure_is_the_distance_between_the_circles_ends():
    flown = circle.fly_circles(VEHICLE, "pid", (0.0,), 1)
    trace = flown.result.traces[0]
    leg, x, y = (trace[:, TRACE.index(name)] for name in ("leg", "true_x", "true_y"))
    first, last = np.flatnonzero(leg == 1)[0], np.flatnonzero(leg == 5)[0]
    assert circle.closure(flown.result, 0) == pytest.approx(np.hypot(x[last] - x[first], y[last] - y[first]))


def test_missions_of_the_figures_are_sound():
    for figure in (tracking.FIG5, tracking.FIG6):
        for target in figure.targets:
            mission_of(figure.name, figure.leg(target)).matrix(VEHICLE, figure.name)


def test_the_command_prints_one_object_and_draws_a_picture(tmp_path):
    done = glider("reproduce", "fig7", "--seeds", "2", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert {"cases", "noise"} <= set(result)
    assert (tmp_path / "fig7.png").read_bytes().startswith(b"\x89PNG")


def test_a_figure_that_is_not_there_is_refused(tmp_path):
    done = glider("reproduce", "fig9", cwd=tmp_path)
    assert done.returncode == 2
    assert "fig9" in done.stderr
