"""The Python API, `import glider`: functions that take a case and return immutable results (docs/reference/api.md).

The commands call the same functions and print the same sentences.
"""

from glider.tools.api.calls import (
    diagnose,
    effects,
    identify,
    load_case,
    measure_gap,
    read_log,
    readings,
    simulate,
    vehicles,
    watch,
)
from glider.tools.api.recordings import Case, Log, Run
from glider.tools.api.results import Diagnosis, EffectTable, Gap, Identification, Readings, VehicleTable, Watch
from glider.tools.data.errors import InputError, MissingExtra

__all__ = [
    "Case", "Diagnosis", "EffectTable", "Gap", "Identification", "InputError", "Log", "MissingExtra", "Readings", "Run",
    "VehicleTable", "Watch", "diagnose", "effects", "identify", "load_case", "measure_gap", "read_log", "readings",
    "simulate", "vehicles", "watch",
]  # fmt: skip
