"""The vehicle: what a vehicle file holds, and its way into the kernels' parameter vector."""

from typing import Annotated, ClassVar

import msgspec
import numpy as np

from glider.firmware.core.vehicle import layout
from glider.firmware.model.gains import Control
from glider.firmware.model.supervisor_settings import Limits, SupervisorTable
from glider.hal.strict import Table, decode

Positive = Annotated[float, msgspec.Meta(gt=0.0)]
NonNegative = Annotated[float, msgspec.Meta(ge=0.0)]
PositiveTriple = tuple[Positive, Positive, Positive]
NonNegativeTriple = tuple[NonNegative, NonNegative, NonNegative]
# No glider of this class is outside these; a file that is has its units wrong.
Mass = Annotated[float, msgspec.Meta(gt=0.0, le=5000.0)]
Length = Annotated[float, msgspec.Meta(ge=-10.0, le=10.0)]
Coefficient = Annotated[float, msgspec.Meta(ge=-1e6, le=1e6)]
Damping = Annotated[float, msgspec.Meta(ge=-1e6, le=0.0)]


COEFFICIENTS = ("K_D0", "K_D", "K_L0", "K_L", "K_beta", "K_MR", "K_p", "K_M0", "K_M", "K_q", "K_MY", "K_r")
# names of [identified] -> places in P
PLACES = {
    **{name: getattr(layout, name.upper()) for name in COEFFICIENTS},
    "m_t": layout.M_T, "m_r": layout.M_R, "m_s": layout.M_S,
    **{f"J_{axis}": layout.J_XX + n for n, axis in enumerate("xyz")}, "R_r": layout.R_R, "R_s": layout.R_S,
    **{f"added_mass_{axis}": layout.A_X + n for n, axis in enumerate("xyz")},
    **{f"added_inertia_{axis}": layout.B_X + n for n, axis in enumerate("xyz")},
    "x_b": layout.X_B, **{name: getattr(layout, name.upper()) for name in ("D_p", "D_q", "D_r")},
    "net_mass": layout.NET_MASS, **{f"cg_{axis}": layout.CG_X + n for n, axis in enumerate("xyz")},
}  # fmt: skip


class MassTable(Table):
    """[mass]: kg, m, kg m2 (docs/explanation/model.md, Mass)."""

    m_t: Mass
    m_r: Mass
    m_s: Mass
    x_r: Length
    R_r: Annotated[float, msgspec.Meta(ge=0.0, le=10.0)]
    r_sx0: Length
    R_s: Annotated[float, msgspec.Meta(ge=0.0, le=10.0)]
    x_b: Length
    J: PositiveTriple
    added_mass: NonNegativeTriple
    added_inertia: NonNegativeTriple

    def __post_init__(self):
        if self.m_r + self.m_s >= self.m_t:
            raise ValueError(f"m_r + m_s = {self.m_r + self.m_s} kg is not less than the whole m_t = {self.m_t} kg")


class HydrodynamicsTable(Table):
    """[hydrodynamics]: the twelve coefficients of equation (4), and which lift law they belong to (ledger L4).

    D_p, D_q, D_r, N m s/rad: damping that is linear in the rate, beside the paper's, which grows with V^2.
    """

    K_D0: NonNegative
    K_D: NonNegative
    K_L0: Coefficient
    K_L: Coefficient
    K_beta: Coefficient
    K_MR: Coefficient
    K_p: Coefficient
    K_M0: Coefficient
    K_M: Coefficient
    K_q: Coefficient
    K_MY: Coefficient
    K_r: Coefficient
    D_p: Damping = 0.0
    D_q: Damping = 0.0
    D_r: Damping = 0.0
    lift_law: str = "linear"

    def __post_init__(self):
        if self.lift_law not in ("linear", "printed"):
            raise ValueError(f"lift_law: expected 'linear' or 'printed', got {self.lift_law!r}")


class ActuatorTable(Table):
    """One actuator: range, rate (per second) and time constant (s), in its own unit (rad, m, kg)."""

    range: tuple[float, float]
    rate: Positive
    time_constant: Positive

    def __post_init__(self):
        low, high = self.range
        if not low < high:
            raise ValueError(f"range: expected [low, high] with low < high, got [{low}, {high}]")
        if not low <= 0.0 <= high:
            raise ValueError(f"range: expected 0 (neutral) inside, got [{low}, {high}]")


class BallastTable(ActuatorTable):
    plunger_area: Positive  # m2


class ActuatorsTable(Table):
    servo: ActuatorTable
    slider: ActuatorTable
    ballast: BallastTable


class SensorTable(Table):
    """White noise and constant bias, both 1 sigma, in the sensor's own unit."""

    noise: NonNegative
    bias: NonNegative = 0.0


class SensorsTable(Table):
    attitude: SensorTable
    gyro: SensorTable
    depth: SensorTable
    slider: SensorTable
    ballast: SensorTable
    mocap_position: SensorTable
    mocap_attitude: SensorTable


class DisturbanceTable(Table):
    """Acceleration noise, 1 sigma, held 0.1 s on every axis: m/s2 and rad/s2."""

    linear: NonNegative
    angular: NonNegative


class UncertaintyTable(Table):
    """1 sigma of what is left open; K, mass, added and length (of x_b, R_r, R_s) relative, net_mass in kg, cg in m."""

    K: NonNegative
    mass: NonNegative
    added: NonNegative
    net_mass: NonNegative
    cg: NonNegative
    length: NonNegative = 0.0


class TrimTable(Table):
    """[trim]: what identification found beside the nominal trim; kg, m.

    See docs/explanation/model.md, Beside the nominal.
    """

    net_mass: Annotated[float, msgspec.Meta(ge=-100.0, le=100.0)] = 0.0
    cg: tuple[Length, Length, Length] = (0.0, 0.0, 0.0)


class ReadingsTable(Table):
    """[readings]: what an instrument reads of something else than its own quantity."""

    # m/kg; a gauge vented into the hull reads the hull's pressure too, which goes with the water in the tank
    depth_with_ballast: Annotated[float, msgspec.Meta(ge=-20.0, le=20.0)] = 0.0


class Assumed(Table):
    """A number that nobody measured: known to a factor, or to lie in a range (90 %), in its unit."""

    factor: Annotated[float, msgspec.Meta(gt=1.0, le=100.0)] | None = None
    range: tuple[float, float] | None = None

    def __post_init__(self):
        if (self.factor is None) == (self.range is None):
            raise ValueError("either factor or range")
        if self.range is not None and not self.range[0] < self.range[1]:
            raise ValueError(f"range: expected [low, high] with low < high, got {list(self.range)}")


class IdentifiedTable(Table):
    """[identified]: where a vehicle file's numbers come from, and how sure they are, together.

    `parameters` names the rows of `covariance` (n, n), SI: the coefficients, mass.*, trim.*.
    """

    data: Annotated[str, msgspec.Meta(max_length=100)]  # hash over the runs
    runs: Annotated[int, msgspec.Meta(ge=1)]
    revision: Annotated[str, msgspec.Meta(max_length=100)]  # of the software
    date: Annotated[str, msgspec.Meta(max_length=40)]
    from_vehicle: Annotated[str, msgspec.Meta(max_length=1000)]
    parameters: list[str]
    covariance: list[list[float]]

    def __post_init__(self):
        unknown = next((name for name in self.parameters if name not in PLACES), None)
        if unknown is not None:
            raise ValueError(f"parameters: no such parameter: {unknown!r}")
        C = np.array(self.covariance, dtype=np.float64) if len(self.covariance) else np.zeros((0, 0))
        count = len(self.parameters)
        if any(len(row) != count for row in self.covariance) or C.shape != (count, count):
            raise ValueError(f"covariance: expected {count} rows of {count}, one for each of the parameters")
        if len(set(self.parameters)) < count:
            raise ValueError("parameters: one stands there twice")
        if count and (not np.allclose(C, C.T) or np.linalg.eigvalsh(C)[0] < -1e-9 * np.abs(C).max()):
            raise ValueError("covariance: not symmetric and positive")

    @property
    def places(self) -> np.ndarray:
        """Where the parameters stand in P, (n,)."""
        return np.array([PLACES[name] for name in self.parameters], dtype=np.int64)


class FormTable(Table):
    """[form]: what the vehicle's form leaves, whatever its numbers: gaps of healthy runs left out of identification.

    In tolerances, by regime of flight (`all` beside them) and channel (`total` among them). `scatter`: 1 sigma of the
    logarithm of a run's mean square; `noise`: the total gap that noise and disturbance alone would leave.
    """

    runs: Annotated[int, msgspec.Meta(ge=1)]
    scatter: NonNegative
    noise: NonNegative
    gaps: dict[str, dict[str, NonNegative]]

    @property
    def total(self) -> float:
        """The total gap over all regimes, tolerances."""
        return self.gaps["all"]["total"]


class Vehicle(Table):
    """A vehicle file (docs/explanation/model.md, Vehicle file)."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    name: Annotated[str, msgspec.Meta(min_length=1, max_length=100)]
    mass: MassTable
    hydrodynamics: HydrodynamicsTable
    actuators: ActuatorsTable
    sensors: SensorsTable
    disturbance: DisturbanceTable
    uncertainty: UncertaintyTable
    control: Control | None = None
    trim: TrimTable = TrimTable()
    readings: ReadingsTable = ReadingsTable()
    # by label of the catalogue, its parameters: calibrations and effects that belong to this vehicle. What flies does
    # not read them; models of its flights do.
    effects: dict[str, dict[str, Coefficient]] = msgspec.field(default_factory=dict)
    assumed: dict[str, Assumed] = msgspec.field(default_factory=dict)
    identified: IdentifiedTable | None = None
    form: FormTable | None = None
    limits: Limits | None = None
    supervisor: SupervisorTable = SupervisorTable()
    kind: ClassVar[str] = "roughie"

    def vector(self) -> np.ndarray:
        """The parameter vector P of the kernels, shape (layout.N_P,), SI."""
        P = np.zeros(layout.N_P)
        mass, water, actuators = self.mass, self.hydrodynamics, self.actuators
        for name in ("m_t", "m_r", "m_s", "x_r", "R_r", "r_sx0", "R_s", "x_b"):
            P[getattr(layout, name.upper())] = getattr(mass, name)
        P[layout.J_XX : layout.J_ZZ + 1] = mass.J
        P[layout.A_X : layout.A_Z + 1] = mass.added_mass
        P[layout.B_X : layout.B_Z + 1] = mass.added_inertia
        for name in (*COEFFICIENTS, "D_p", "D_q", "D_r"):
            P[getattr(layout, name.upper())] = getattr(water, name)
        P[layout.LIFT_PRINTED] = float(water.lift_law == "printed")
        for name in ("servo", "slider", "ballast"):
            start = getattr(layout, f"{name.upper()}_MIN")
            table = getattr(actuators, name)
            P[start : start + 4] = (*table.range, table.rate, table.time_constant)
        P[layout.PLUNGER_AREA] = actuators.ballast.plunger_area
        P[layout.NET_MASS] = self.trim.net_mass
        P[layout.CG_X : layout.CG_Z + 1] = self.trim.cg
        return P


def decode_vehicle(text: str, source: str) -> Vehicle:
    """A vehicle file's text as a Vehicle; raises ConfigError with file, line and key."""
    return decode(text, Vehicle, source)
