"""The equations that a vehicle is flown by, of whatever kind it is."""

from typing import Any

from glider.tools.data import vehicle_kinds
from glider.tools.inference.kind import Kind


def kind_of(vehicle: Any) -> Kind:
    """Those of a vehicle, as its file was read."""
    found: Kind = vehicle_kinds.kind_of(vehicle).equations()
    return found
