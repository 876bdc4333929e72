"""The model that a prediction flies with: the case's nominal vehicle, or a vehicle file's, with its own effects."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from glider.firmware.model.estimator_settings import parameter_sigma
from glider.firmware.model.vehicle import Vehicle
from glider.hal.strict import ConfigError
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.base import Effect, EffectError
from glider.sim_backend.core.effects.catalogue import catalogue, check_values
from glider.sim_backend.ocean.catalogue import catalogue as ocean_catalogue
from glider.sim_backend.ocean.core import layout as ocean
from glider.sim_backend.ocean.vehicle import OceanVehicle
from glider.tools.data.runs.case import Case
from glider.tools.data.vehicle_kinds import kind_of

NOMINAL = "nominal"  # its name


@dataclass(frozen=True)
class Model:
    """What predicts: parameter vector P and its 1 sigma, both (layout.N_P,), and effects F (N_F,) where it has any."""

    name: str
    P: np.ndarray
    sigma: np.ndarray
    F: np.ndarray | None = None
    spread: np.ndarray | None = (
        None  # (n, N_P): independent directions of what identification left; sigma covers the rest
    )
    sure: np.ndarray | None = None  # (n, N_P): of how sure its numbers are, where other flights are allowed more


def nominal_model(case: Case) -> Model:
    """The case's own vehicle."""
    return vehicle_model(NOMINAL, case.vehicle)


def vehicle_model(name: str, vehicle: Any) -> Model:
    """A vehicle of any kind as a model."""
    found: Model = kind_of(vehicle).model(name, vehicle)
    return found


def roughie_model(name: str, vehicle: Vehicle) -> Model:
    """A vehicle as a model: what is uncertain as [uncertainty] says, or where it was identified as its covariance."""
    P = vehicle.vector()
    sigma = parameter_sigma(P, vehicle.uncertainty)
    F = own_effects(vehicle)
    found = vehicle.identified
    if found is None or not found.parameters:
        return Model(name, P, sigma, F)
    C = np.array(found.covariance)
    sigma[found.places] = np.minimum(sigma[found.places], alone(C))
    return Model(name, P, sigma, F, spread=_directions(C, found.places, len(P)))


def alone(C: np.ndarray) -> np.ndarray:
    """1 sigma of each of some parameters while the others stay, of their covariance C (n, n): (n,).

    The observer takes parameters as independent, which a posterior seldom is. Flights of the kind that were fitted are
    foreseen as well by independent parameters of these sizes as by all together, correlated as they are.
    """
    size = np.sqrt(np.maximum(np.diag(C), 1e-300))
    precision = np.linalg.inv(C / np.outer(size, size) + 1e-9 * np.eye(len(C)))
    return np.asarray(size / np.sqrt(np.maximum(np.diag(precision), 1.0)))


def _directions(C: np.ndarray, places: np.ndarray, count: int) -> np.ndarray:
    """Independent directions of a covariance C (n, n) at places of P, (n, count), each of 1 sigma."""
    values, vectors = np.linalg.eigh(C)
    spread = np.zeros((len(values), count))
    spread[:, places] = (vectors * np.sqrt(np.maximum(values, 0.0))).T
    return np.asarray(spread[np.abs(spread).max(axis=1) > 0.0])


def ocean_model(name: str, vehicle: OceanVehicle) -> Model:
    """An ocean glider as a model; F (ocean.N_F,) has the effects of its file."""
    P, sigma, F = vehicle.vector(), vehicle.sigma(), np.zeros(ocean.N_F)
    add_effects(F, vehicle.effects, name, ocean_catalogue())
    found, places = vehicle.identified, vehicle.identified_places
    if found is None or not len(places):
        return Model(name, P, sigma, F)
    sure = _scaled_directions(np.array(found.covariance), places)
    allowed = sure if found.allowed is None else _scaled_directions(np.array(found.allowed), places)
    return Model(name, P, sigma, F, spread=allowed, sure=sure)


def _scaled_directions(C: np.ndarray, places: np.ndarray) -> np.ndarray:
    """_directions of numbers whose sizes differ: a compressibility is 1e-10, its square is lost beside others."""
    scale = np.sqrt(np.maximum(np.diag(C), 1e-300))
    found = _directions(C / np.outer(scale, scale), places, ocean.N_P)
    found[:, places] *= scale
    return found


def own_effects(vehicle: Vehicle) -> np.ndarray | None:
    """F (N_F,) of a vehicle file's [effects] and [readings]; None where it has none. ConfigError names the key."""
    if not vehicle.effects and not vehicle.readings.depth_with_ballast:
        return None
    F = np.zeros(ef.N_F)
    add_effects(F, vehicle.effects, vehicle.name)
    F[ef.GAUGE_TANK] = vehicle.readings.depth_with_ballast
    return F


def add_effects(
    F: np.ndarray, effects: dict[str, dict[str, float]], source: str, known: Mapping[str, Effect] | None = None
) -> None:
    """Add effects by label to F (N_F,), in place; ConfigError names the key. known: another kind's catalogue."""
    known = catalogue() if known is None else known
    for label, values in effects.items():
        try:
            checked = check_values(label, values, known)
        except EffectError as error:
            raise ConfigError(source, str(error), key=f"effects.{label}") from None
        for parameter in known[label].parameters:
            if parameter.entry >= 0:
                F[parameter.entry] += checked[parameter.name]


def effects_in(F: np.ndarray, known: Mapping[str, Effect] | None = None) -> dict[str, dict[str, float]]:
    """The effects of the catalogue that stand in F (N_F,), as files write them: the way back from add_effects."""
    found: dict[str, dict[str, float]] = {}
    for label, effect in (catalogue() if known is None else known).items():
        placed = [p for p in effect.parameters if p.entry >= 0]
        if any(F[p.entry] != 0.0 and p.low <= F[p.entry] <= p.high for p in placed):
            found[label] = {p.name: float(F[p.entry]) for p in placed}
    return found


def effect_vector(model: Model) -> np.ndarray:
    """The model's F, (N_F,); zeros where it has none."""
    return np.zeros(ef.N_F) if model.F is None else model.F.copy()
