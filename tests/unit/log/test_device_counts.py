"""Error counts of devices in words: what has changed, and how they stand."""

from glider.hal.drivers.samples import Health
from glider.tools.flight.device_counts import errors_text


def test_a_well_device_has_no_words():
    assert errors_text(Health("imu", samples=100).plain()) == ""


def test_counts_that_have_grown_are_named_with_their_growth():
    before = Health("imu", timeouts=2).plain()
    now = Health("imu", timeouts=5, damaged=1, samples=7).plain()
    assert errors_text(now, before) == "timeouts 5 (+3), damaged 1"
    assert errors_text(now, now) == ""


def test_an_error_that_comes_and_goes_is_named_once():
    well, ill = Health("imu").plain(), Health("imu", error="no answer").plain()
    assert errors_text(ill, well) == "no answer"
    assert errors_text(ill, ill) == ""
    assert errors_text(well, ill) == "well again"
