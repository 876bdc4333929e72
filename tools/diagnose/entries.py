"""The numbers that a diagnosis changes in the vehicle file: key, value and unit of each parameter of an effect.

Where the effect is another value of a number that the file has (a coefficient, a rate, a trim), the key is that
number's. All other effects have their own table there, `[effects.LABEL]`, which models of the vehicle's flights read.
"""

from typing import Any

import numpy as np

from glider.firmware.core.vehicle import layout
from glider.firmware.model.vehicle import COEFFICIENTS
from glider.sim_backend.core.effect_plant import effective_parameters
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.inference.vehicle_parameters import K_UNITS

TRIPLES = {
    "mass.J": (layout.J_XX, "kg m2"), "mass.added_mass": (layout.A_X, "kg"),
    "mass.added_inertia": (layout.B_X, "kg m2"), "trim.cg": (layout.CG_X, "m"),
}  # fmt: skip
ACTUATOR_UNITS = {"servo": "rad", "slider": "m", "ballast": "kg"}
LEAST_CHANGE = 1e-9  # of a number or of 1: a smaller one is rounding


def _keys() -> dict[int, tuple[str, str]]:
    """By place in P: the key of the vehicle file, and the unit."""
    found = {getattr(layout, name.upper()): (f"hydrodynamics.{name}", K_UNITS[name]) for name in COEFFICIENTS}
    for key, (first, unit) in TRIPLES.items():
        found |= {first + n: (f"{key}[{n}]", unit) for n in range(3)}
    for start, (name, unit) in zip(layout.ACTUATORS, ACTUATOR_UNITS.items(), strict=True):
        entries = (("range[0]", unit), ("range[1]", unit), ("rate", f"{unit}/s"), ("time_constant", "s"))
        found |= {start + n: (f"actuators.{name}.{key}", shown) for n, (key, shown) in enumerate(entries)}
    return found | {layout.NET_MASS: ("trim.net_mass", "kg")}


KEYS = _keys()


def numbers_to_enter(P: np.ndarray, own: dict[str, Any], label: str, sizes: dict[str, Any]) -> list[dict[str, Any]]:
    """The entries of the vehicle file that a label's parameters change.

    Args:
        P: parameter vector of the nominal vehicle (N_P,).
        own: the `effects` table of the vehicle file: by label, its parameters.
        label: of the catalogue.
        sizes: by parameter, `estimate`, `ci90` and `unit`, as diagnosis.json has them.

    Returns:
        For each entry `label`, `parameter`, `key`, `file` (the nominal number), `value`, `ci90` and `unit`.
    """
    known = {
        one: [size["estimate"], *size["ci90"]]
        for one in catalogue()[label].parameters if (size := sizes.get(one.name)) is not None
    }  # fmt: skip
    known = {one: ends for one, ends in known.items() if all(end is not None and np.isfinite(end) for end in ends)}
    changed = {one: _changed(P, one.entry, ends) for one, ends in known.items()}
    together = _effective(P, {one.entry: ends[0] for one, ends in known.items()})
    alone = sum((_effective(P, {one.entry: ends[0]}) - P for one, ends in known.items()), P)
    if label in own or not np.allclose(together, alone, rtol=LEAST_CHANGE, atol=LEAST_CHANGE):
        changed = {one: {} for one in known}  # it is there already, or its parameters act on one number together
    found = []
    for one, ends in known.items():
        file = own.get(label, {}).get(one.name, one.default)
        here = (file, [file - one.default + end for end in ends], one.unit)
        for key, (before, values, unit) in (changed[one] or {f"effects.{label}.{one.name}": here}).items():
            value, *ci90 = map(float, values)
            found.append({
                "label": label, "parameter": one.name, "key": key, "file": float(before), "value": value,
                "ci90": sorted(ci90), "unit": unit,
            })  # fmt: skip
    return found


def _effective(P: np.ndarray, values: dict[int, float]) -> np.ndarray:
    """The parameters (N_P,) that hold throughout a flight with entries of F; an entry below 0 is none."""
    F, out = np.zeros(ef.N_F), np.empty(layout.N_P)
    for entry, value in values.items():
        if entry >= 0:
            F[entry] = value
    effective_parameters(P, F, out)
    return out


def _changed(P: np.ndarray, entry: int, ends: list[float]) -> dict[str, tuple[float, list[float], str]]:
    """By key, the numbers of the file that an entry of F changes: before, and at each of its values."""
    flown = np.array([_effective(P, {entry: end}) for end in ends])
    places = np.flatnonzero(np.abs(flown[0] - P) > LEAST_CHANGE * np.maximum(1.0, np.abs(P)))
    return {KEYS[n][0]: (P[n], flown[:, n].tolist(), KEYS[n][1]) for n in places.tolist() if n in KEYS}
