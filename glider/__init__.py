"""Flight software, simulator and sim-to-real diagnosis of an underwater glider.

Its subpackages are `glider.firmware`, `glider.hal`, `glider.sim_backend` and `glider.tools`. In the source tree these
are symbolic links to the folders beside this one. An installation therefore holds one top-level package: it cannot
shadow another distribution's `hal` or `tools`, nor be shadowed by one.

The names in `__all__` are the Python API (docs/reference/api.md). Each is imported when it is first used (PEP 562), so
that
`import glider`, which every module of a flight does too, imports nothing.
"""

TYPE_CHECKING = False  # as typing.TYPE_CHECKING, without the import
if TYPE_CHECKING:
    from glider.tools.api import (
        Case,
        Diagnosis,
        EffectTable,
        Gap,
        Identification,
        InputError,
        Log,
        MissingExtra,
        Readings,
        Run,
        VehicleTable,
        Watch,
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

__all__ = [
    "Case", "Diagnosis", "EffectTable", "Gap", "Identification", "InputError", "Log", "MissingExtra", "Readings", "Run",
    "VehicleTable", "Watch", "diagnose", "effects", "identify", "load_case", "measure_gap", "read_log", "readings",
    "simulate", "vehicles", "watch",
]  # fmt: skip


def __getattr__(name: str) -> object:
    """Import a name of the API when it is first used."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from glider.tools import api

    return getattr(api, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
