"""What a campaign says of its flights: intervals, comparison on common worlds, reasons, picture, CSV."""

import csv

import numpy as np
import pytest

from glider.tools.data.intervals import wilson
from glider.tools.study.campaign.conduct import FlownChunk, write_flights
from glider.tools.study.campaign.flights import COLUMNS, ENDINGS
from glider.tools.study.campaign.picture import page
from glider.tools.study.campaign.summary import completed_by_all, summarise

LEG_TIME = next(code for code, text in ENDINGS.items() if text == "leg over its time limit")


@pytest.fixture
def flown(plan_of):
    """Made-up flights, 2 missions x 3 seeds x 2 controllers: the law fails in one world, and is better elsewhere."""
    plan = plan_of(missions=["sawtooth", "spiral"], controllers=["law", "pid"], seeds=3)
    table = np.zeros((12, len(COLUMNS)))

    def put(name, values):
        table[:, COLUMNS.index(name)] = values

    put("mission", np.repeat([0, 1], 6))
    put("controller", np.tile([0, 1], 6))
    put("seed", np.tile(np.repeat([0, 1, 2], 2), 2))
    put("current_m_s", np.repeat(np.linspace(0.0, 0.2, 6), 2))
    put("completed", 1.0)
    put("within_limits", 1.0)
    put("depth_error_m", np.where(np.arange(12) < 6, np.tile([0.1, 0.2], 6), np.nan))
    put("pitch_error_rad", np.radians(np.tile([1.0, 2.0], 6)))
    for name, value in (("completed", 0.0), ("within_limits", 0.0), ("ended", LEG_TIME), ("pitch_error_rad", 9.0)):
        table[2, COLUMNS.index(name)] = value
    return FlownChunk(plan, table, 12, 3.0)


@pytest.mark.parametrize("n", [1, 10, 1000])
def test_wilson_stays_inside_and_closes_with_n(n):
    assert wilson(0, n)[0] == 0.0
    assert wilson(n, n)[1] == pytest.approx(1.0)
    low, high = wilson(n // 2, n)
    assert 0.0 <= low <= n // 2 / n <= high <= 1.0
    assert wilson(0, n)[1] == pytest.approx(1.0 - wilson(n, n)[0])


def test_wilson_by_its_definition():
    # the ends are where the score test just holds: |share - p| = z sqrt(p (1 - p) / n)
    for p in wilson(30, 40):
        assert abs(0.75 - p) == pytest.approx(1.6448536 * np.sqrt(p * (1 - p) / 40))


def test_wilson_against_values_worked_out_by_hand():
    assert wilson(8, 10) == pytest.approx((0.54080, 0.93145), abs=2e-4)
    assert wilson(0, 0) == (0.0, 1.0)


def test_wilson_covers_nine_times_in_ten():
    rng = np.random.default_rng(1)
    hits = [low <= 0.9 <= high for low, high in (wilson(int(k), 50) for k in rng.binomial(50, 0.9, 2000))]
    assert 0.86 < np.mean(hits) < 0.95


def test_errors_are_compared_in_worlds_that_all_completed(flown):
    assert completed_by_all(flown).tolist() == 2 * [True] + 2 * [False] + 8 * [True]
    result = summarise(flown)
    law, pid = result["controllers"]
    assert (result["flights"], result["worlds"]) == (12, 6)
    assert law["completed"] == pytest.approx(5 / 6)
    assert law["reasons"] == {"leg over its time limit": 1}
    assert pid["reasons"] == {}
    assert law["compared"] == pid["compared"] == 5
    assert law["pitch_error_deg"]["mean"] == pytest.approx(1.0)
    assert pid["depth_error_m"]["median"] == pytest.approx(0.2)
    spiral = next(r for r in result["by_mission"] if (r["controller"], r["mission"]) == ("law", "spiral"))
    assert spiral["depth_error_m"]["mean"] is None
    assert result["flights_per_s"] == 4.0


def test_the_page_is_whole_and_needs_no_network(flown):
    text = page(flown)
    assert text.count("<svg viewBox") > 4
    assert "completed, %, against current" in text
    assert "against wave height" not in text  # it is the same everywhere
    assert "83.3 %" in text
    for outside in ("http:", "https:", "src=", "@import", "url("):
        assert outside not in text


def test_nothing_completed_is_a_result_too(flown):
    flown.table[:, COLUMNS.index("within_limits")] = 0.0
    assert summarise(flown)["controllers"][0]["pitch_error_deg"]["mean"] is None
    assert "0.0 %" in page(flown)


def test_flights_as_csv(flown, tmp_path):
    write_flights(tmp_path / "flights.csv", flown)
    rows = list(csv.DictReader((tmp_path / "flights.csv").open()))
    assert len(rows) == 12
    assert rows[2] | {"controller": "law", "ended": "leg over its time limit", "seed": "1"} == rows[2]
    assert rows[7]["mission"] == "spiral"
    assert rows[7]["depth_error_m"] == ""
