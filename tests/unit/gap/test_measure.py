"""The gap, recomputed in plain numpy from the words of the contract."""

import math

import numpy as np
import pytest

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.data.runs.run import Run
from glider.tools.gap.measure import run_gap
from glider.tools.inference.channels import ROUGHIE_MEASURES
from glider.tools.inference.predict import as_run

TOLERANCE = {"depth_m": 0.05, "pitch_rad": math.radians(1.5), "roll_rad": math.radians(1.5), "yaw_rad": math.radians(4)}


def made_up(seed: int = 0, count: int = 455, drop: tuple[str, ...] = ()) -> tuple[Run, np.ndarray]:
    """A run of random numbers with holes, and a prediction near it."""
    rng = np.random.default_rng(seed)
    names = ["roll_rad", "pitch_rad", "yaw_rad", "p_rad_s", "q_rad_s", "r_rad_s", "depth_m", "slider_m", "ballast_kg"]
    names += ["mocap_x_m", "mocap_y_m"]
    Y = rng.normal(0.0, 1.0, (count, 11))
    columns = {"t_s": np.arange(count) / 10.0}
    for i, name in enumerate(names):
        columns[name] = Y[:, i] + rng.normal(0.0, 0.02, count)
        columns[name][rng.random(count) < 0.1] = np.nan
    columns["mocap_z_m"] = Y[:, 6] + 0.3
    for angle, i in (("roll", 0), ("pitch", 1), ("yaw", 2)):
        columns[f"mocap_{angle}_rad"] = Y[:, i] + 0.1
    for name in ("cmd_servo_rad", "cmd_slider_m", "cmd_ballast_kg"):
        columns[name] = np.zeros(count)
    return Run("run00", None, {k: v for k, v in columns.items() if k not in drop}), Y


def rms(values) -> float:
    values = np.asarray(values, dtype=float).ravel()
    return float(np.sqrt(np.mean(values[np.isfinite(values)] ** 2)))


def test_every_channel_as_the_contract_words_it():
    run, Y = made_up()
    run.columns["yaw_rad"] += 2.0 * np.pi * np.round(np.random.default_rng(1).normal(0.0, 2.0, run.rows))
    t = run.t
    scored = (t < 40.0) & (t % 20.0 >= 2.0 - 1e-9) & (t % 20.0 < 20.0 - 1e-9)  # 45.5 s: two windows
    c = run.columns
    expected = {
        "depth": rms((c["depth_m"] - Y[:, 6])[scored]) / 0.05,
        "pitch": rms(np.degrees(c["pitch_rad"] - Y[:, 1])[scored]) / 1.5,
        "roll": rms(np.degrees(c["roll_rad"] - Y[:, 0])[scored]) / 1.5,
        "yaw": rms((np.degrees(c["yaw_rad"] - Y[:, 2])[scored] + 180.0) % 360.0 - 180.0) / 4.0,
        "rates": rms(np.degrees([(c[f"{a}_rad_s"] - Y[:, 3 + i])[scored] for i, a in enumerate("pqr")])) / 2.0,
        "slider": rms((c["slider_m"] - Y[:, 7])[scored]) / 0.002,
        "ballast": rms((c["ballast_kg"] - Y[:, 8])[scored]) / 0.005,
        "xy": rms(np.hypot(c["mocap_x_m"] - Y[:, 9], c["mocap_y_m"] - Y[:, 10])[scored]) / 0.15,
    }
    gap = run_gap(ROUGHIE_MEASURES, run, Y, ROUGHIE_MEASURES.windows(t))
    assert list(gap.channels) == list(expected)
    for name, value in expected.items():
        assert gap.channels[name] == pytest.approx(value, rel=1e-12), name
    assert gap.total == pytest.approx(rms(list(expected.values())), rel=1e-12)
    assert gap.windows == 2


def test_without_commands_the_draw_wires_are_no_channel():
    run, Y = made_up(drop=("cmd_servo_rad", "cmd_slider_m", "cmd_ballast_kg"))
    assert not {"slider", "ballast"} & set(run_gap(ROUGHIE_MEASURES, run, Y, ROUGHIE_MEASURES.windows(run.t)).channels)


def test_motion_capture_stands_in_for_attitude_and_depth_that_were_not_recorded():
    run, Y = made_up(drop=("roll_rad", "pitch_rad", "yaw_rad", "depth_m"))
    gap = run_gap(ROUGHIE_MEASURES, run, Y, ROUGHIE_MEASURES.windows(run.t))
    assert gap.channels["depth"] == pytest.approx(0.3 / 0.05)
    assert gap.channels["yaw"] == pytest.approx(math.degrees(0.1) / 4.0)


def test_a_column_of_nothing_was_not_recorded():
    run, Y = made_up()
    run.columns["depth_m"][:] = np.nan
    gap = run_gap(ROUGHIE_MEASURES, run, Y, ROUGHIE_MEASURES.windows(run.t))
    assert gap.channels["depth"] == pytest.approx(0.3 / 0.05)


def test_a_run_shorter_than_the_start_has_no_gap():
    run, Y = made_up(count=15)
    gap = run_gap(ROUGHIE_MEASURES, run, Y, ROUGHIE_MEASURES.windows(run.t))
    assert gap.channels == {}
    assert math.isnan(gap.total)


def test_a_prediction_has_the_rows_and_columns_of_the_run_and_no_gaps():
    run, Y = made_up()
    run.columns["cmd_slider_m"][100:120] = np.nan
    Y = np.column_stack([Y, *np.random.default_rng(1).normal(size=(4, len(Y)))])  # motion capture's own readings
    predicted = as_run(run, Y)
    assert list(predicted.columns) == list(run.columns)
    assert all(np.isfinite(values).all() for values in predicted.columns.values())
    np.testing.assert_array_equal(predicted.columns["mocap_yaw_rad"], Y[:, ef.Y_MOCAP_ROLL + 2])
