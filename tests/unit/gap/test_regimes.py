"""Regimes of flight: what is of them, and gaps by regime."""

import numpy as np
import pytest

from glider.firmware.core.vehicle import layout
from glider.tools.data.runs.run import Run
from glider.tools.data.sources import load_vehicle
from glider.tools.gap.measure import run_gap
from glider.tools.gap.regimes import ALL, PAIRS, REGIMES, gaps_by_regime, regimes_of
from glider.tools.inference.channels import ROUGHIE_MEASURES

P = load_vehicle("roughie").vector()
COUNT = 800  # at 10 Hz


def flight(seed: int = 0) -> tuple[Run, np.ndarray]:
    """Down fast for 20 s, down slowly for 20 s, up for 40 s; turning from 40 s on, the slider running from 60 s on."""
    t = np.arange(COUNT) / 10.0
    rng = np.random.default_rng(seed)
    sinking = np.select([t < 20.0, t < 40.0], [0.2, 0.05], -0.15)
    yaw = 3.0 + np.radians(5.0) * np.maximum(t - 40.0, 0.0)
    slider = 0.8 * P[layout.SLIDER_RATE] * np.maximum(t - 60.0, 0.0)
    columns = {"t_s": t, "depth_m": np.cumsum(sinking) / 10.0 + rng.normal(0.0, 0.003, COUNT)}
    columns["yaw_rad"] = np.angle(np.exp(1j * yaw)) + rng.normal(0.0, 0.003, COUNT)
    columns |= {name: np.zeros(COUNT) for name in ("roll_rad", "pitch_rad", "ballast_kg")}
    columns |= {"slider_m": slider, "cmd_slider_m": slider}
    columns |= {name: np.zeros(COUNT) for name in ("cmd_servo_rad", "cmd_ballast_kg")}
    columns["depth_m"][100:130] = np.nan
    run = Run("run00", None, columns)
    Y = np.nan_to_num(ROUGHIE_MEASURES.measured(run))
    return run, Y


def test_every_sample_is_of_one_side_of_each_pair():
    run, _ = flight()
    masks = regimes_of(ROUGHIE_MEASURES, run, P)
    assert tuple(sorted(masks)) == tuple(sorted(REGIMES))
    for one, other in PAIRS:
        assert np.array_equal(masks[one], ~masks[other])


def test_flight_is_told_by_what_was_measured():
    run, _ = flight()
    masks, t = regimes_of(ROUGHIE_MEASURES, run, P), run.t
    clear = np.abs((t + 10.0) % 20.0 - 10.0) > 1.5  # off the moments of change
    for name, rows in (
        ("dive", t < 40.0), ("turning", t > 40.0), ("moving", t > 60.0), ("fast", (t < 20.0) | (t > 40.0)),
    ):  # fmt: skip
        assert (masks[name] == rows)[clear].mean() > 0.98, name


def test_gaps_by_regime_are_of_its_rows_alone():
    run, Y = flight()
    Y[run.t < 40.0, ROUGHIE_MEASURES.columns.index("roll_rad")] += np.radians(3.0)  # two tolerances, in the dive
    listed = ROUGHIE_MEASURES.windows(run.t)
    found = gaps_by_regime(ROUGHIE_MEASURES, [run], [Y], [listed], P)
    assert found["dive"]["roll"] == pytest.approx(2.0, rel=0.02)
    assert found["climb"]["roll"] == pytest.approx(0.0, abs=0.2)
    whole = run_gap(ROUGHIE_MEASURES, run, Y, listed)
    assert found[ALL] == {"total": whole.total} | whole.channels


def test_a_regime_that_was_not_flown_is_left_out():
    run, Y = flight()
    columns = run.columns | {"depth_m": 0.1 * run.t}
    found = gaps_by_regime(ROUGHIE_MEASURES, [Run("r", None, columns)], [Y], [ROUGHIE_MEASURES.windows(run.t)], P)
    assert "climb" not in found
    assert "dive" in found
