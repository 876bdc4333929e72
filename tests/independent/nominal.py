"""The nominal vehicle a second time: the equations as matrices, straight from the model's definition.

Nothing here comes from the flight software, down to the reading of the vehicle file. What the kernels write out by
component stands here as vectors: cross-product matrices, a 6 x 6 M and a general solver, M_dot from two nearby M.
Slow and plain on purpose: it is what the kernels are held against.
"""

import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

GRAVITY = 9.80665
DOWN = np.array([0.0, 0.0, 1.0])
RATE_STEP = 1e-4  # s, over which M_dot is taken as a difference: error 1e-9 of M, rounding 1e-12


def skew(a: np.ndarray) -> np.ndarray:
    """The matrix of a x ..."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def about(axis: int, angle: float) -> np.ndarray:
    """Rotation matrix about a coordinate axis: what it turns moves by `angle`."""
    c, s = np.cos(angle), np.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[i, i] = R[j, j] = c
    R[j, i], R[i, j] = s, -s
    return R


def body_to_ned(phi: float, theta: float, psi: float) -> np.ndarray:
    """Yaw, then pitch, then roll: equation (2) as a product of three elementary rotations."""
    return about(2, psi) @ about(1, theta) @ about(0, phi)


def euler_angle_rates(phi: float, theta: float, omega: np.ndarray) -> np.ndarray:
    """Rates of phi, theta, psi, by solving for them: omega is what the three rates add up to in body axes."""
    R_phi, R_theta = about(0, phi), about(1, theta)
    axes = np.column_stack([[1.0, 0.0, 0.0], R_phi.T @ [0.0, 1.0, 0.0], R_phi.T @ R_theta.T @ DOWN])
    return np.linalg.solve(axes, omega)


@dataclass(frozen=True)
class Glider:
    """A vehicle file as it stands: tables of numbers."""

    mass: dict
    water: dict
    actuators: dict

    @classmethod
    def from_file(cls, path: Path) -> "Glider":
        tables = tomllib.loads(Path(path).read_text(encoding="utf-8"))
        return cls(tables["mass"], tables["hydrodynamics"], tables["actuators"])

    def moving_masses(self, act: np.ndarray) -> list[tuple[float, np.ndarray]]:
        """(mass, position) of rail, sliding mass and ballast water; act = servo, slider, ballast."""
        m, (gamma, slide, ballast) = self.mass, act
        swing = about(0, -gamma) @ DOWN  # towards starboard for positive gamma
        return [
            (m["m_r"], np.array([m["x_r"], 0.0, 0.0]) + m["R_r"] * swing),
            (m["m_s"], np.array([m["r_sx0"] + slide, 0.0, 0.0]) + m["R_s"] * swing),
            (ballast, np.array([m["x_b"], 0.0, 0.0])),
        ]

    def first_moment(self, act: np.ndarray) -> np.ndarray:
        """S: moments of the moving masses, less what the fixed hull balances at neutral along x."""
        trimmed = self.mass["m_r"] * self.mass["x_r"] + self.mass["m_s"] * self.mass["r_sx0"]
        return sum(m * r for m, r in self.moving_masses(act)) - np.array([trimmed, 0.0, 0.0])

    def rotational_inertia(self, act: np.ndarray) -> np.ndarray:
        """Jt, 3 x 3."""
        J = np.diag(np.array(self.mass["J"]) + self.mass["added_inertia"])
        return J + sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in self.moving_masses(act))

    def mass_matrix(self, act: np.ndarray, inertia_at: np.ndarray | None = None) -> np.ndarray:
        """M, 6 x 6; Jt may be taken at another actuator position (its change is left out of M_dot)."""
        S = skew(self.first_moment(act))
        translation = (self.mass["m_t"] + act[2]) * np.eye(3) + np.diag(self.mass["added_mass"])
        return np.block([[translation, -S], [S, self.rotational_inertia(act if inertia_at is None else inertia_at)]])

    def mass_matrix_rate(self, act: np.ndarray, act_rate: np.ndarray) -> np.ndarray:
        """M_dot from the actuators' speeds, by central difference."""
        ahead = self.mass_matrix(act + RATE_STEP * act_rate, act)
        behind = self.mass_matrix(act - RATE_STEP * act_rate, act)
        return (ahead - behind) / (2.0 * RATE_STEP)

    def flow(self, V: np.ndarray) -> tuple[float, float, float]:
        """Angle of attack, sideslip angle, speed through the water."""
        speed = float(np.linalg.norm(V))
        if speed < 1e-6:
            return 0.0, 0.0, speed
        return float(np.arctan2(V[2], V[0])), float(np.arcsin(V[1] / speed)), speed

    def water_forces(self, nu: np.ndarray) -> np.ndarray:
        """Equation (4) with lift linear in alpha: force and moment, body axes, (6,)."""
        K, (p, q, r) = self.water, nu[3:]
        alpha, beta, speed = self.flow(nu[:3])
        R_bf = about(1, -alpha) @ about(2, beta)
        drag = K["K_D0"] + K["K_D"] * alpha**2
        lift = K["K_L0"] + K["K_L"] * alpha
        force = R_bf @ np.array([-drag, K["K_beta"] * beta, -lift])
        moment = R_bf @ np.array([
            K["K_MR"] * beta + K["K_p"] * p,
            K["K_M0"] + K["K_M"] * alpha + K["K_q"] * q,
            K["K_MY"] * beta + K["K_r"] * r,
        ])  # fmt: skip
        return np.concatenate([force, moment]) * speed**2

    def acceleration(self, R: np.ndarray, nu: np.ndarray, act: np.ndarray, act_rate: np.ndarray) -> np.ndarray:
        """nu_dot of equation (1), (6,); R takes body to NED, nu is relative to the water."""
        M, S, down = self.mass_matrix(act), self.first_moment(act), R.T @ DOWN
        V, omega = nu[:3], nu[3:]
        P, Q = np.split(M @ nu, 2)
        turning = np.concatenate([np.cross(P, omega), np.cross(Q, omega) + np.cross(P, V)])
        weight = GRAVITY * np.concatenate([act[2] * down, np.cross(S, down)])
        forces = turning + weight + self.water_forces(nu) - self.mass_matrix_rate(act, act_rate) @ nu
        return np.linalg.solve(M, forces)

    def actuator_speed(self, act: np.ndarray, command: np.ndarray) -> np.ndarray:
        """Speeds of servo, slider, ballast under held commands."""
        speeds = []
        for table, position, wanted in zip(self._tables(), act, command, strict=True):
            error = np.clip(wanted, *table["range"]) - position
            speeds.append(np.clip(error / table["time_constant"], -table["rate"], table["rate"]))
        return np.array(speeds)

    def end_of_rate_limit(self, act: np.ndarray, command: np.ndarray) -> list[float]:
        """Times from now, s, at which an actuator leaves its rate limit: where the motion has a kink."""
        times = []
        for table, position, wanted in zip(self._tables(), act, command, strict=True):
            error = abs(np.clip(wanted, *table["range"]) - position)
            times.append((error - table["rate"] * table["time_constant"]) / table["rate"])
        return sorted(time for time in times if time > 0.0)

    def _tables(self) -> list[dict]:
        return [self.actuators[name] for name in ("servo", "slider", "ballast")]
