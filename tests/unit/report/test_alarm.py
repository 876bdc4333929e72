"""The alarm of an identification: what a reader has to know before the numbers."""

from glider.tools.report.alarm import alarms

BEFORE, AFTER = {"total": 1.1, "depth": 2.0, "yaw": 1.0}, {"total": 1.25, "depth": 0.5, "yaw": 1.02}


def test_what_got_worse_is_named_with_both_gaps():
    (found,) = alarms({"before": BEFORE, "after": AFTER, "regimes": {}}, {}, [], [])
    assert found["head"] == "Worse"
    assert "total (1.10 to 1.25 tolerances)" in found["text"]
    assert "depth" not in found["text"]
    assert "yaw" not in found["text"]  # by 2 %, less than runs scatter


def test_a_regime_that_got_worse_is_named():
    regimes = {"climb": {"before": {"total": 0.5}, "after": {"total": 0.9}}}
    (found,) = alarms({"before": BEFORE, "after": BEFORE, "regimes": regimes}, {}, [], [])
    assert "climb, total (0.500 to 0.900 tolerances)" in found["text"]


def test_noise_notes_and_open_directions():
    held = {"before": BEFORE, "after": BEFORE, "regimes": {}}
    found = alarms(held, {"disturbance linear": 11.02, "slider": 1.2}, ["rough intervals"], ["K_D stays wide."])
    assert [one["head"] for one in found] == ["Note", "Noise", "Not determined"]
    assert "disturbance linear 11.0 times" in found[1]["text"]
    assert "slider" not in found[1]["text"]
    assert found[0]["text"] == "Rough intervals."


def test_nothing_to_say_is_no_alarm_and_no_check_is_one():
    assert alarms({"before": BEFORE, "after": BEFORE, "regimes": {}}, {"depth": 1.0}, [], []) == []
    assert [one["head"] for one in alarms(None, {}, [], [])] == ["Not checked"]
