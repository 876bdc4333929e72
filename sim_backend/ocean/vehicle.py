"""An ocean glider's vehicle file, and its way into the kernels' parameter vector.

See docs/explanation/ocean.md, Vehicle files.
"""

from importlib.resources import files
from typing import Annotated, ClassVar, Literal

import msgspec
import numpy as np

from glider.firmware.model.vehicle import Assumed
from glider.hal.strict import Table, decode
from glider.sim_backend.ocean.core import layout

KIND = "ocean"
Positive = Annotated[float, msgspec.Meta(gt=0.0)]
NonNegative = Annotated[float, msgspec.Meta(ge=0.0)]
Angle = Annotated[float, msgspec.Meta(ge=-0.8, le=0.8)]
Number = Annotated[float, msgspec.Meta(ge=-1e6, le=1e6)]

# names of files and answers -> places in P
PLACES = {
    "volume": layout.VOLUME, "compressibility": layout.COMPRESSIBILITY, "thermal_expansion": layout.THERMAL_EXPANSION,
    "Cd0": layout.DRAG_0, "Cd1": layout.DRAG_ALPHA, "lift_slope": layout.LIFT_SLOPE, "oil_scale": layout.OIL_SCALE,
    "pitch_offset": layout.PITCH_OFFSET, "pitch_scale": layout.PITCH_SCALE, "roll_trim": layout.ROLL_TRIM,
}  # fmt: skip
UNITS = {
    "volume": "m3", "compressibility": "1/Pa", "thermal_expansion": "1/K", "Cd0": "1", "Cd1": "1/rad2",
    "lift_slope": "1/rad", "oil_scale": "1", "pitch_offset": "rad", "pitch_scale": "1", "roll_trim": "rad",
}  # fmt: skip


class BuoyancyTable(Table):
    """[buoyancy]: kg, m3, 1/Pa, 1/K, degC."""

    mass: Annotated[float, msgspec.Meta(gt=1.0, le=2000.0)]
    volume: Annotated[float, msgspec.Meta(gt=1e-3, le=2.0)]
    compressibility: Annotated[float, msgspec.Meta(ge=-5e-9, le=1e-8)]
    thermal_expansion: Annotated[float, msgspec.Meta(ge=-1e-3, le=1e-3)]
    reference_temperature: Annotated[float, msgspec.Meta(ge=-5.0, le=50.0)] = 10.0
    oil_scale: Annotated[float, msgspec.Meta(gt=0.1, le=10.0)] = 1.0


class DragTable(Table):
    """[hydrodynamics]: coefficients over `area`, m2; angles in rad.

    drag_exponent s: parasitic drag goes with (q / 32 Pa)^s, q the dynamic pressure; 0 is a square law.
    """

    area: Positive
    Cd0: Positive
    Cd1: NonNegative
    lift_slope: Positive
    drag_exponent: Annotated[float, msgspec.Meta(ge=-0.5, le=0.5)] = 0.0
    added_mass: NonNegative = 5.0


class AttitudeTable(Table):
    """[attitude]: what the attitude sensor and the trim are off by; rad."""

    pitch_offset: Angle = 0.0
    pitch_scale: Annotated[float, msgspec.Meta(gt=0.3, le=3.0)] = 1.0
    roll_trim: Angle = 0.0


class ReadingTable(Table):
    """White noise and constant bias, both 1 sigma, SI."""

    noise: Positive
    bias: NonNegative = 0.0


class OceanSensors(Table):
    """[sensors]."""

    depth: ReadingTable
    roll: ReadingTable
    # of the bias half the 1 cm/s that makers of electromagnetic logs give for a limit
    speed: ReadingTable = ReadingTable(noise=0.02, bias=0.005)
    velocity: ReadingTable = ReadingTable(noise=0.05)


class OceanDisturbance(Table):
    """[disturbance]: vertical water, 1 sigma m/s, with the time, s, in which it decorrelates; walk, m/s over 1 s.

    roll, rad, and roll_time, s: by how much and how long the roll leaves its trim.
    """

    water: Positive
    water_time: Annotated[float, msgspec.Meta(ge=1.0, le=1e5)]
    walk: Positive
    roll: Positive
    roll_time: Annotated[float, msgspec.Meta(ge=1.0, le=1e5)]
    speed: Positive = 1e-3

    @property
    def water_rate(self) -> float:
        """Root of the spectral density that keeps the water at `water`, m/s over a root second."""
        return self.water * (2.0 / self.water_time) ** 0.5

    @property
    def roll_rate(self) -> float:
        """The same of the roll, rad over a root second."""
        return self.roll * (2.0 / self.roll_time) ** 0.5


class OceanUncertainty(Table):
    """[uncertainty]: 1 sigma of what nobody measured; of volume, Cd0, Cd1, lift_slope a share, else in SI."""

    volume: NonNegative
    Cd0: NonNegative
    lift_slope: NonNegative
    compressibility: NonNegative
    thermal_expansion: NonNegative
    Cd1: NonNegative = 0.0
    oil_scale: NonNegative = 0.0
    pitch_offset: NonNegative = 0.0
    pitch_scale: NonNegative = 0.0
    roll_trim: NonNegative = 0.0


RELATIVE = ("volume", "Cd0", "Cd1", "lift_slope")


class OceanIdentified(Table):
    """[identified]: what the numbers were found from, and how sure they are together: `covariance` (n, n), SI.

    allowed: the same, as wide as other flights may ask for; the covariance where it is not there.
    """

    runs: Annotated[int, msgspec.Meta(ge=1)]
    from_vehicle: Annotated[str, msgspec.Meta(max_length=1000)]
    parameters: list[str]
    covariance: list[list[float]]
    allowed: list[list[float]] | None = None

    def __post_init__(self):
        count = len(self.parameters)
        unknown = next((name for name in self.parameters if name not in PLACES), None)
        if unknown is not None:
            raise ValueError(f"parameters: no such parameter: {unknown!r}")
        if len(set(self.parameters)) < count:
            raise ValueError("parameters: one stands there twice")
        for name, rows in (("covariance", self.covariance), ("allowed", self.allowed)):
            if rows is None:
                continue
            if len(rows) != count or any(len(row) != count for row in rows):
                raise ValueError(f"{name}: expected {count} rows of {count}, one for each of the parameters")
            C = np.array(rows).reshape(count, count)
            if count and (not np.allclose(C, C.T, rtol=1e-6, atol=0.0) or np.any(np.diag(C) < 0.0)):
                raise ValueError(f"{name}: not symmetric and positive")


class OceanVehicle(Table):
    """A vehicle file of kind "ocean"."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    kind: Literal["ocean"]
    name: Annotated[str, msgspec.Meta(min_length=1, max_length=100)]
    buoyancy: BuoyancyTable
    hydrodynamics: DragTable
    sensors: OceanSensors
    disturbance: OceanDisturbance
    uncertainty: OceanUncertainty
    attitude: AttitudeTable = AttitudeTable()
    latitude: Annotated[float, msgspec.Meta(ge=-90.0, le=90.0)] = 45.0  # for gravity
    # by label of the catalogue, its parameters: what this vehicle has beside its numbers
    effects: dict[str, dict[str, Number]] = msgspec.field(default_factory=dict)
    identified: OceanIdentified | None = None
    form: ClassVar[None] = None  # what its equations leave of healthy runs is not written into its file

    @property
    def assumed(self) -> dict[str, Assumed]:
        """An ocean glider's file says what is assumed by [uncertainty] alone."""
        return {}

    @property
    def identified_places(self) -> np.ndarray:
        """Where what was identified stands in P, (n,)."""
        found = [] if self.identified is None else self.identified.parameters
        return np.array([PLACES[name] for name in found], dtype=np.int64)

    def vector(self) -> np.ndarray:
        """The parameter vector P, (layout.N_P,), SI."""
        P = np.zeros(layout.N_P)
        weight, water, disturbance = self.buoyancy, self.hydrodynamics, self.disturbance
        P[layout.MASS], P[layout.VOLUME] = weight.mass, weight.volume
        P[layout.COMPRESSIBILITY], P[layout.THERMAL_EXPANSION] = weight.compressibility, weight.thermal_expansion
        P[layout.TEMPERATURE], P[layout.OIL_SCALE] = weight.reference_temperature, weight.oil_scale
        P[layout.AREA], P[layout.DRAG_0], P[layout.DRAG_ALPHA] = water.area, water.Cd0, water.Cd1
        P[layout.DRAG_EXPONENT], P[layout.LIFT_SLOPE] = water.drag_exponent, water.lift_slope
        P[layout.ADDED_MASS] = water.added_mass
        P[layout.PITCH_OFFSET], P[layout.PITCH_SCALE] = self.attitude.pitch_offset, self.attitude.pitch_scale
        P[layout.ROLL_TRIM] = self.attitude.roll_trim
        P[layout.GRAVITY] = gravity(self.latitude)
        P[layout.WATER_TIME], P[layout.ROLL_TIME] = disturbance.water_time, disturbance.roll_time
        return P

    def sigma(self) -> np.ndarray:
        """1 sigma of what [uncertainty] allows, (layout.N_P,), SI."""
        P, sigma = self.vector(), np.zeros(layout.N_P)
        for name, place in PLACES.items():
            size = getattr(self.uncertainty, name)
            sigma[place] = size * abs(P[place]) if name in RELATIVE else size
        return sigma


def gravity(latitude: float) -> float:
    """Normal gravity at the surface, m/s2, of a latitude in degrees (GRS 1967 as TEOS-10 has it)."""
    s = np.sin(np.radians(latitude)) ** 2
    return float(9.780327 * (1.0 + (5.2792e-3 + 2.32e-5 * s) * s))


def shipped_vehicles() -> dict[str, str]:
    """Name -> text of the shipped ocean gliders."""
    folder = files("glider.sim_backend").joinpath("ocean", "vehicles")
    return {
        entry.name.removesuffix(".toml"): entry.read_text(encoding="utf-8")
        for entry in sorted(folder.iterdir(), key=lambda item: item.name) if entry.name.endswith(".toml")
    }  # fmt: skip


def decode_ocean_vehicle(text: str, source: str) -> OceanVehicle:
    """A vehicle file's text; raises ConfigError with file, line and key."""
    return decode(text, OceanVehicle, source)
