"""Figures of the mean speed of twin missions: what the summary of errors that are known says."""

import re

import numpy as np

from glider.tools.verify.figures.ocean_speed import SpeedQuery, summary


def test_errors_of_missions_and_of_dives_within_them():
    two = [SpeedQuery(False, np.array([0.01, 0.012]), np.full(2, 0.01), np.full(2, 0.02)),
           SpeedQuery(False, np.array([-0.02, -0.018]), np.full(2, 0.01), np.full(2, 0.02))]  # fmt: skip
    told = summary(two)
    assert re.findall(r"\d+\.\d+", told)[:5] == ["1.55", "1.00", "2.00", "1.55", "1.90"]
    assert re.search(r" 0\.141 cm/s; .* 50 % of 4 ", told)
