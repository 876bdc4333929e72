"""What is free where a vehicle is identified, and its priors, out of the vehicle file.

The twelve coefficients of equation (4) are what is looked for. Beside them everything is free that the recordings
could mistake for them: weighed and estimated masses, trim, constant errors of the sensors, and how the capture's body
sits on the vehicle and its clock beside the onboard one. What a vehicle or case file calls assumed is free as it says.
"""

from dataclasses import dataclass, replace
from math import inf, log

import numpy as np

from glider.firmware.core.vehicle import layout
from glider.firmware.model.vehicle import COEFFICIENTS, PLACES
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.inference.model import Model, effect_vector
from glider.tools.inference.parameters import FreeParameter, assumed
from glider.tools.inference.problem import Problem

# 1 sigma before any flight. [uncertainty] says what is left after one: these are what a first vehicle file may be off.
K_SHARE = 0.5  # of a coefficient's size
# Of a vehicle that nobody identified damping is known by a factor, 1 sigma of its logarithm. By strip theory wings of
# span b and chord c damp roll by rho a c b^3 / 24 V (0.7 m: ten times a bare hull's), a fin of area S at a lever l yaw
# by rho a S l^2 / 2 V.
DAMPING, DAMPING_FACTOR = ("K_p", "K_q", "K_r"), 3.0
CAMBER, TRIM_ANGLE = 0.025, 0.03  # rad of attack by which lift and pitch moment may be displaced where a file says 0
ADDED_SHARE, NET_MASS, CG = 0.15, 0.01, 0.0005  # of added mass and inertia; kg; m
FIRST = 10.0  # times these trims, where no motion capture holds the flight
WIRE_SCALE = 0.5  # of what a draw-wire says, there: a first calibration may be far off
# Of a vehicle that nobody identified, where its file misses its flights by far: damping that is linear in the rate (N m
# s/rad; about what the paper's does at 0.3 m/s), and the tank's place (m).
FIRST_EFFECTS = {"stall": 2.0, "pressure_lever": 0.15}  # 1/rad, m
# A gauge that is vented into a hull of some ten litres of air reads about a metre less a kilogram of water in the tank.
GAUGE, GAUGE_SPREAD = "depth_with_ballast", 0.5  # its name in [readings]; m/kg
LINEAR_DAMPING, TANK_ARM = {"D_p": 0.1, "D_q": 1.5, "D_r": 1.0}, 0.15
FRAME_TURN, FRAME_OFFSET = 0.02, 0.02  # rad, m: capture's body against the vehicle's
CLOCK = 0.05  # s, capture's clock behind the onboard one
FRAME = "frame"  # the vector of what is no part of the model but of how the capture sees it
FRAME_NAMES = ("capture_roll", "capture_pitch", "capture_yaw", "capture_x", "capture_y", "capture_z")
MASSES = {"m_t": layout.M_T, "m_r": layout.M_R, "m_s": layout.M_S}
ADDED = {
    "added_mass_x": layout.A_X, "added_mass_y": layout.A_Y, "added_mass_z": layout.A_Z,
    "added_inertia_x": layout.B_X, "added_inertia_y": layout.B_Y, "added_inertia_z": layout.B_Z,
}  # fmt: skip
LENGTHS = ("x_b", "R_r", "R_s")
CENTRE = {"cg_x": layout.CG_X, "cg_y": layout.CG_Y, "cg_z": layout.CG_Z}
K_UNITS = {
    "K_D0": "kg/m", "K_D": "kg/m/rad2", "K_L0": "kg/m", "K_L": "kg/m/rad", "K_beta": "kg/m/rad", "K_MR": "kg/rad",
    "K_p": "kg s/rad", "K_M0": "kg", "K_M": "kg/rad", "K_q": "kg s/rad", "K_MY": "kg/rad", "K_r": "kg s/rad",
}  # fmt: skip
BIASES = ("roll", "pitch", "yaw", "p", "q", "r", "depth", "slider", "ballast")
BIAS_UNITS = (*3 * ["rad"], *3 * ["rad/s"], "m", "m", "kg")


@dataclass(frozen=True)
class Parameters:
    """Everything free, the coefficients first. `nominal` (n,): the vehicle file's values, 0 where it names none."""

    free: list[FreeParameter]
    nominal: np.ndarray

    @property
    def names(self) -> list[str]:
        return [f.name for f in self.free]

    @property
    def spreads(self) -> np.ndarray:
        """1 sigma of the priors, (n,), SI."""
        return np.array([f.spread for f in self.free])

    def alone(self, normal: np.ndarray) -> np.ndarray:
        """1 sigma of each, SI, while the others stay (n,); normal (n, n): the posterior's, in units of the priors."""
        return self.spreads / np.sqrt(np.diag(normal))

    def si(self, values: np.ndarray) -> np.ndarray:
        """Values (..., n) in units of the priors as SI."""
        columns = [f.moved(at, values[..., n]) for n, (f, at) in enumerate(zip(self.free, self.nominal, strict=True))]
        return np.stack(columns, axis=-1)

    def values(self, si: dict[str, float]) -> np.ndarray:
        """Values (n,) in units of the priors at these numbers, SI by name; the file's for what is not named."""
        return np.array([f.value(at, si.get(f.name, at)) for f, at in zip(self.free, self.nominal, strict=True)])

    def place(self, model: Model, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The model at values (n,): parameters P, effects F, and the capture's frame (6,)."""
        P, F, frame = model.P.copy(), effect_vector(model), np.zeros(6)
        vectors = {"P": P, "F": F, FRAME: frame}
        for f, value in zip(self.free, values, strict=True):
            vectors[f.vector][f.entry] = f.moved(vectors[f.vector][f.entry], value)
        return P, F, frame


def coefficient_sizes(P: np.ndarray) -> np.ndarray:
    """How large each of the twelve coefficients is likely to be, (12,): its nominal value, or where that may be 0 the
    lift of CAMBER and the pitch moment of TRIM_ANGLE."""
    size = np.array([abs(P[getattr(layout, name.upper())]) for name in COEFFICIENTS])
    size[COEFFICIENTS.index("K_L0")] = max(abs(P[layout.K_L0]), CAMBER * abs(P[layout.K_L]))
    size[COEFFICIENTS.index("K_M0")] = max(abs(P[layout.K_M0]), TRIM_ANGLE * abs(P[layout.K_M]))
    return np.maximum(size, 1e-3)


def coefficients(P: np.ndarray, first: bool = False) -> list[FreeParameter]:
    """The twelve, with priors about the vehicle file's values; first: of a vehicle that nobody identified."""
    found = []
    for name, size in zip(COEFFICIENTS, coefficient_sizes(P), strict=True):
        entry = getattr(layout, name.upper())
        damps = first and name in DAMPING and P[entry] != 0.0
        spread = (log(DAMPING_FACTOR) if damps else K_SHARE) * size
        low = -P[entry] / spread if name in ("K_D0", "K_D") else -inf  # drag does not push
        factor = DAMPING_FACTOR if damps else 1.0
        found.append(FreeParameter("", name, "P", entry, spread, low, unit=K_UNITS[name], factor=factor))
    return found


def _masses(problem: Problem, scale: float) -> list[FreeParameter]:
    P, u = problem.model.P, problem.case.roughie.uncertainty
    found = [FreeParameter("", name, "P", entry, u.mass * P[entry], unit="kg") for name, entry in MASSES.items()]
    found += [FreeParameter("", name, "P", PLACES[name], u.length * P[PLACES[name]], unit="m") for name in LENGTHS]
    share = max(u.added, ADDED_SHARE)
    for name, entry in ADDED.items():
        found.append(FreeParameter("", name, "P", entry, share * P[entry], unit="kg m2" if "inertia" in name else "kg"))
    found.append(FreeParameter("", "net_mass", "P", layout.NET_MASS, max(u.net_mass, scale * NET_MASS), unit="kg"))
    for name, entry in CENTRE.items():
        found.append(FreeParameter("", name, "P", entry, max(u.cg, scale * CG), unit="m"))
    return [f for f in found if f.spread > 0.0]


def _biases(problem: Problem) -> list[FreeParameter]:
    s, seen = problem.case.sensors, problem.seen
    size = [*3 * [s.attitude.bias], *3 * [s.gyro.bias], s.depth.bias, s.slider.bias, s.ballast.bias]
    return [
        FreeParameter("", f"{BIASES[j]}_bias", "F", ef.BIAS + j, size[j], unit=BIAS_UNITS[j])
        for j in range(len(BIASES))
        if seen[j] and size[j] > 0.0
    ]


def _capture(problem: Problem) -> list[FreeParameter]:
    """The capture's frame and clock; which way its x axis lies along the vehicle's is free only with its attitude."""
    if not problem.seen[ef.Y_MOCAP_ROLL :].all():
        return []
    spreads = [*3 * [FRAME_TURN], *3 * [FRAME_OFFSET]]
    found = [
        FreeParameter("", name, FRAME, n, spreads[n], unit="rad" if n < 3 else "m")
        for n, name in enumerate(FRAME_NAMES)
    ]
    return [*found, FreeParameter("", "capture_delay", "F", ef.MOCAP_DELAY, CLOCK, unit="s")]


def parameters(problem: Problem, first: bool = False) -> Parameters:
    """What is free for these recordings; first: of a vehicle that nobody identified."""
    mocap = bool(problem.seen[ef.Y_MOCAP_X])
    free = [*coefficients(problem.model.P, first), *_masses(problem, 1.0 if mocap else FIRST), *_biases(problem)]
    if mocap:
        free += _capture(problem)
    else:
        free += [of_effect(problem, name, WIRE_SCALE) for name in ("ballast_scale", "slider_scale")]
    if first:
        free = [f for f in free if f.name != "x_b"]
        free += [*_damping(problem), FreeParameter("", "x_b", "P", layout.X_B, TANK_ARM, unit="m")]
    return listed(problem, _as_assumed(problem, free))


def listed(problem: Problem, free: list[FreeParameter]) -> Parameters:
    """Free parameters with their values in the problem's model."""
    vectors = {"P": problem.model.P, "F": effect_vector(problem.model), FRAME: np.zeros(6)}
    return Parameters(free, np.array([vectors[f.vector][f.entry] for f in free]))


def first_effects(problem: Problem) -> list[FreeParameter]:
    """What a vehicle that nobody identified may have beside its parameters, whatever its file says."""
    found = [of_effect(problem, name, spread) for name, spread in FIRST_EFFECTS.items()]
    return [*found, FreeParameter("", GAUGE, "F", ef.GAUGE_TANK, GAUGE_SPREAD, unit="m/kg")]


def _damping(problem: Problem) -> list[FreeParameter]:
    """Damping that is linear in the rate: it never pushes."""
    found = []
    for name, spread in LINEAR_DAMPING.items():
        entry = PLACES[name]
        high = -problem.model.P[entry] / spread
        found.append(FreeParameter("", name, "P", entry, spread, -inf, high, "N m s/rad"))
    return found


def of_effect(problem: Problem, label: str, spread: float) -> FreeParameter:
    """The first parameter of an effect about its value in the model, with a prior of 1 sigma `spread` (its unit)."""
    parameter = catalogue()[label].parameters[0]
    here = float(effect_vector(problem.model)[parameter.entry])
    low, high = (parameter.low - here) / spread, (parameter.high - here) / spread
    return FreeParameter("", label, "F", parameter.entry, spread, low, high, parameter.unit)


def _as_assumed(problem: Problem, free: list[FreeParameter]) -> list[FreeParameter]:
    """What is free, with what files call assumed in the place of what is free anyway, or behind it."""
    said = {(f.vector, f.entry): f for f in assumed(problem)}
    kept = []
    for f in free:
        one = said.pop((f.vector, f.entry), None)
        kept.append(f if one is None else replace(one, name=f.name, unit=f.unit))
    return [*kept, *said.values()]
