"""Depth and density of sea water by TEOS-10 (the gsw package)."""

import numpy as np


def depth_of(pressure_dbar: np.ndarray, latitude: float) -> np.ndarray:
    """Depth below the surface, m, of sea pressure in dbar."""
    import gsw

    return -gsw.z_from_p(pressure_dbar, latitude)


def practical_salinity(conductivity: np.ndarray, temperature: np.ndarray, pressure_dbar: np.ndarray) -> np.ndarray:
    """Practical salinity of conductivity, S/m, temperature, degC, and sea pressure, dbar."""
    import gsw

    return gsw.SP_from_C(10.0 * conductivity, temperature, pressure_dbar)


def density_of(
    salinity: np.ndarray, temperature: np.ndarray, pressure_dbar: np.ndarray, longitude: float, latitude: float
) -> np.ndarray:
    """In-situ density, kg/m3, of practical salinity, in-situ temperature, degC, and sea pressure, dbar."""
    import gsw

    absolute = gsw.SA_from_SP(salinity, pressure_dbar, longitude, latitude)
    return gsw.rho_t_exact(absolute, temperature, pressure_dbar)
