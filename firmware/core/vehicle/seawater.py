"""Density of water from pressure, temperature and salinity: the UNESCO 1983 equation of state (EOS-80).

Fofonoff and Millard, UNESCO technical papers in marine science 44 (1983). Valid for 0-42 PSU, -2-40 deg C,
0-1000 bar; temperatures outside are held at the range's ends, so that a bad sample cannot make an implausible density.
"""

import math

from glider.firmware.core.jit import kernel
from glider.firmware.core.vehicle.actuators import clip

PA_PER_BAR = 1e5
STANDARD_PRESSURE = 101325.0  # Pa, of the atmosphere at sea level


@kernel
def water_density(gauge_pressure, temperature_c, salinity):
    """Density in kg/m3; gauge_pressure in Pa (0 at the surface), temperature in deg C, salinity in PSU (g/kg)."""
    T = clip(temperature_c, -2.0, 40.0)
    S = clip(salinity, 0.0, 42.0)
    p = clip(gauge_pressure, 0.0, 1e8) / PA_PER_BAR
    root = math.sqrt(S)
    pure = 999.842594 + T * (
        6.793952e-2 + T * (-9.095290e-3 + T * (1.001685e-4 + T * (-1.120083e-6 + T * 6.536332e-9)))
    )
    rho = (
        pure
        + S * (0.824493 + T * (-4.0899e-3 + T * (7.6438e-5 + T * (-8.2467e-7 + T * 5.3875e-9))))
        + S * root * (-5.72466e-3 + T * (1.0227e-4 - T * 1.6546e-6))
        + 4.8314e-4 * S * S
    )
    if p == 0.0:
        return rho
    bulk = (
        19652.21
        + T * (148.4206 + T * (-2.327105 + T * (1.360477e-2 - T * 5.155288e-5)))
        + S * (54.6746 + T * (-0.603459 + T * (1.09987e-2 - T * 6.1670e-5)))
        + S * root * (7.944e-2 + T * (1.6483e-2 - T * 5.3009e-4))
    )
    A = (
        3.239908
        + T * (1.43713e-3 + T * (1.16092e-4 - T * 5.77905e-7))
        + S * (2.2838e-3 + T * (-1.0981e-5 - T * 1.6078e-6))
        + 1.91075e-4 * S * root
    )
    B = 8.50935e-5 + T * (-6.12293e-6 + T * 5.2787e-8) + S * (-9.9348e-7 + T * (2.0816e-8 + T * 9.1697e-10))
    return rho / (1.0 - p / (bulk + p * (A + p * B)))
