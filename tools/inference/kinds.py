"""Which kind of vehicle a vehicle file describes."""

from typing import Any

from glider.sim_backend.ocean.vehicle import OceanVehicle
from glider.tools.inference.kind import ROUGHIE, Kind
from glider.tools.inference.ocean_kind import OCEAN


def kind_of(vehicle: Any) -> Kind:
    """The kind of a vehicle, as its file was read."""
    return OCEAN if isinstance(vehicle, OceanVehicle) else ROUGHIE
