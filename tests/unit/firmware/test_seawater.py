"""Water density against the published check values of EOS-80 and against the TEOS-10 library."""

import gsw
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glider.firmware.core.vehicle.seawater import water_density
from tests.support.examples import examples


@pytest.mark.parametrize(
    ("salinity", "temperature", "bar", "density"),
    [
        # UNESCO technical papers in marine science 44 (1983), table of check values (IPTS-68, bar)
        (0.0, 5.0, 0.0, 999.96675),
        (0.0, 5.0, 1000.0, 1044.12802),
        (0.0, 25.0, 0.0, 997.04796),
        (0.0, 25.0, 1000.0, 1037.90204),
        (35.0, 5.0, 0.0, 1027.67547),
        (35.0, 5.0, 1000.0, 1069.48914),
        (35.0, 25.0, 0.0, 1023.34306),
        (35.0, 25.0, 1000.0, 1062.53817),
    ],
)
def test_published_check_values(salinity, temperature, bar, density):
    assert water_density(bar * 1e5, temperature, salinity) == pytest.approx(density, abs=2e-5)


@examples()
@given(st.floats(0, 40), st.floats(0, 38), st.floats(0, 1000))
def test_agrees_with_teos10_to_its_own_accuracy(temperature, salinity, depth):
    """EOS-80 and TEOS-10 differ by less than 0.1 kg/m3 over the range that gliders see."""
    dbar = depth * 1.0
    absolute = gsw.SA_from_SP(salinity, dbar, 0.0, 45.0)
    reference = gsw.rho_t_exact(absolute, temperature, dbar)
    assert water_density(dbar * 1e4, temperature, salinity) == pytest.approx(reference, abs=0.1)


def test_an_absurd_temperature_makes_no_absurd_density():
    for temperature in (-300.0, 1e6):
        assert 950.0 < water_density(0.0, temperature, 0.0) < 1010.0
    assert np.isfinite(water_density(0.0, np.nan, 0.0))
