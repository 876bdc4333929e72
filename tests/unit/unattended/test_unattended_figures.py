"""The figures' own commands on a small scale: kills, and a log cut at every so-manieth byte."""

from glider.tools.verify.figures.unattended import measure_cuts, measure_kills


def test_killed_at_random_no_dive_is_resumed():
    found = measure_kills(40, seed=3)
    assert found["resumed"] == 0
    assert found["under_way"] > 5
    assert found["ascended_only"] > 3
    assert found["pass"]


def test_a_flights_log_cut_anywhere_returns_nothing_damaged_and_loses_little():
    found = measure_cuts(1.5, every=211)
    assert found["cuts_with_damaged_records"] == 0
    assert 0.0 < found["most_lost_s"] <= 1.0
    assert found["repaired_and_whole"] == found["repairs_tried"] > 0
    assert found["pass"]
