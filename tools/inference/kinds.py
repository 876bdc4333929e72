"""Which kind of vehicle a vehicle file describes."""

from typing import Any

from sim_backend.ocean.vehicle import OceanVehicle
from tools.inference.kind import ROUGHIE, Kind
from tools.inference.ocean_kind import OCEAN


def kind_of(vehicle: Any) -> Kind:
    """The kind of a vehicle, as its file was read."""
    return OCEAN if isinstance(vehicle, OceanVehicle) else ROUGHIE
