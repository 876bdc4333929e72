"""The control law closed around the plant: forms at a state, ideal actuators, and flights step by step, for the tests.

Accelerations of pitch and depth come from the plant's own nu_dot through (10) and (17) as printed, never from the law.
"""

import math
from dataclasses import dataclass

import numpy as np

from glider.firmware.core.control.control import reference_step
from glider.firmware.core.control.error_bound import model_error_bound
from glider.firmware.core.control.input_forms import exact_form
from glider.firmware.core.control.law import OK, pitch_depth_law
from glider.firmware.core.control.law_plus import reach
from glider.firmware.core.maths.rotations import euler_from_quaternion, rotation_nb
from glider.firmware.core.vehicle import layout
from glider.sim_backend.core.layout import N_ENV, N_WAVE
from glider.sim_backend.core.plant import derivative, plant_step

STILL, NO_WAVES, NO_DISTURBANCE = np.zeros(N_ENV), np.zeros((0, N_WAVE)), np.zeros(6)
SLIDER, BALLAST = layout.X_ACT + 1, layout.X_ACT + 2
UNHELD = np.full(2, math.inf)  # jerks of actuators without a rate
STANDING = (0.0, 0.0, 0.0)  # actuators' speeds
TICK = 0.02  # s
NEAR = 1e-6  # m, kg: difference of Newton's method
WIDE = 1e3  # m, kg: an actuator's range where the law is to be held against the equations alone


def without_stops(vehicle: np.ndarray) -> np.ndarray:
    """The vehicle with actuators that can go anywhere."""
    free = vehicle.copy()
    for name in ("SERVO", "SLIDER", "BALLAST"):
        free[getattr(layout, f"{name}_MIN")], free[getattr(layout, f"{name}_MAX")] = -WIDE, WIDE
    return free


@dataclass(frozen=True)
class Gains:
    """k1, k3 in 1/s, k2 in the input's unit, eps in the unit of s."""

    k1: float
    k2: float
    k3: float
    eps: float


@dataclass(frozen=True)
class Reference:
    """Position, rate and acceleration of what one axis should do."""

    position: float
    rate: float = 0.0
    acc: float = 0.0

    def step(self, target: float, wn: float, dt: float) -> "Reference":
        return Reference(*reference_step(self.position, self.rate, target, wn, 1.0, dt))


def down(x: np.ndarray) -> tuple:
    """k, the unit vector down in body axes."""
    return rotation_nb(*x[3:7].tolist())[6:]


def form_at(vehicle: np.ndarray, x: np.ndarray, speeds=STANDING, form=exact_form) -> tuple:
    """f_theta, f_Z, g_ts, g_tb, g_zs, g_zb with the actuators where x has them."""
    return form(vehicle, *down(x), *x[7:16].tolist(), *speeds)


def outputs(x: np.ndarray) -> tuple[float, float, float, float]:
    """theta, theta_dot by (9), Z, Z_dot by (16) in still water."""
    Z, *quaternion = x[2:7].tolist()
    phi, theta, _ = euler_from_quaternion(*quaternion)
    u, v, w, _, q, r = x[7:13].tolist()
    sf, cf, st, ct = math.sin(phi), math.cos(phi), math.sin(theta), math.cos(theta)
    return theta, cf * q - sf * r, Z, -u * st + v * sf * ct + w * cf * ct


def output_accelerations(x: np.ndarray, nu_dot: np.ndarray) -> np.ndarray:
    """theta_dd by (10) and Z_dd by (17), as printed."""
    phi, theta, _ = euler_from_quaternion(*x[3:7].tolist())
    u, v, w, p, q, r = x[7:13].tolist()
    nu_dot = nu_dot.tolist()
    sf, cf, st, ct = math.sin(phi), math.cos(phi), math.sin(theta), math.cos(theta)
    phi_dot, theta_dot = p + sf * st / ct * q + cf * st / ct * r, cf * q - sf * r
    theta_dd = cf * nu_dot[4] - sf * nu_dot[5] - (q * sf + r * cf) * phi_dot
    Z_dd = (
        phi_dot * (v * cf * ct - w * sf * ct)
        - theta_dot * (u * ct + v * sf * st + w * cf * st)
        - st * nu_dot[0]
        + sf * ct * nu_dot[1]
        + cf * ct * nu_dot[2]
    )
    return np.array([theta_dd, Z_dd])


def plant_rates(vehicle: np.ndarray, x: np.ndarray, command, acc=NO_DISTURBANCE) -> np.ndarray:
    """dx/dt of the plant in still water, shape (N_X,)."""
    out = np.empty(layout.N_X)
    derivative(vehicle, STILL, NO_WAVES, x, np.asarray(command, dtype=float), 0.0, acc, out)
    return out


class NoInputs(Exception):
    """The law's status is not OK; its number is the argument."""


class NeverSettled(Exception):
    """There seem to be no positions of the actuators at which the law wants just them."""


@dataclass(frozen=True)
class Law:
    """Both axes' gains, the vehicle the law believes in, and how much it knows of its actuators.

    counting_on: what each axis takes the other's input for: "joint", "present" or "reach". share: of the jerk that an
    actuator's rate gives, for the feedback; None: not held.
    """

    vehicle: np.ndarray
    pitch: Gains
    depth: Gains
    counting_on: str = "joint"
    share: float | None = None

    def with_k2(self, pitch: float, depth: float) -> "Law":
        """The same law with another k2 of pitch and of depth; twice as quick as dataclasses.replace."""
        of_pitch = Gains(self.pitch.k1, pitch, self.pitch.k3, self.pitch.eps)
        of_depth = Gains(self.depth.k1, depth, self.depth.k3, self.depth.eps)
        return Law(self.vehicle, of_pitch, of_depth, self.counting_on, self.share)

    def bounds(self, x) -> tuple[float, float, float, float]:
        """Of the slider and of the ballast, as solve_inputs has them."""
        if self.counting_on == "joint":
            return -math.inf, math.inf, -math.inf, math.inf
        if self.counting_on == "present":
            slider, ballast = x[SLIDER:].tolist()
            return slider, slider, ballast, ballast
        slider, ballast = x[SLIDER:].tolist()
        horizon = float(self.vehicle[layout.SLIDER_TAU]) + TICK
        return (
            *reach(slider, *self.vehicle[layout.SLIDER_MIN :][:4].tolist(), horizon),
            *reach(ballast, *self.vehicle[layout.BALLAST_MIN :][:4].tolist(), horizon),
        )

    def jerks(self, g) -> np.ndarray:
        """Of pitch and depth, for g = [g_ts, g_zb]."""
        if self.share is None:
            return UNHELD
        return self.share * np.abs(g) * self.vehicle[[layout.SLIDER_RATE, layout.BALLAST_RATE]]

    def __call__(self, x, references, speeds=STANDING, disturbance=(0.0, 0.0), form=exact_form):
        """Inputs (2,) slider, ballast; s (2,) of pitch and depth; g_ts and g_zb (2,), at a state."""
        f_t, f_z, *gains = form_at(self.vehicle, x, speeds, form)
        g = np.array([gains[0], gains[3]])
        jerk_t, jerk_z = self.jerks(g).tolist()
        theta, theta_rate, Z, Z_rate = outputs(x)
        pitch, depth = references
        u_s, u_b, s_t, s_z, status = pitch_depth_law(
            f_t + disturbance[0], f_z + disturbance[1], *gains, math.cos(theta),
            theta - pitch.position, theta_rate - pitch.rate, pitch.acc, *vars(self.pitch).values(), jerk_t,
            Z - depth.position, Z_rate - depth.rate, depth.acc, *vars(self.depth).values(), jerk_z,
            *self.bounds(x),
        )  # fmt: skip
        if status != OK:
            raise NoInputs(status)
        return np.array([u_s, u_b]), np.array([s_t, s_z]), g

    def arbitrate(self, x, references, speeds=STANDING, tolerance=1e-14, most=20) -> int:
        """Put x's slider and ballast where the law wants them with them there; returns the iterations it took.

        Newton's method, the derivatives by differences: the mass matrix moves with the inputs, and where forces are
        large, iterating the law alone runs away.
        """
        for count in range(1, most + 1):
            off = self(x, references, speeds)[0] - x[SLIDER:]
            if np.abs(off).max() <= tolerance * (1.0 + np.abs(x[SLIDER:]).max()):
                return count
            jacobian = np.empty((2, 2))
            for i in (0, 1):
                near = x.copy()
                near[SLIDER + i] += NEAR
                jacobian[:, i] = (self(near, references, speeds)[0] - near[SLIDER:] - off) / NEAR
            x[SLIDER:] -= np.linalg.solve(jacobian, off)
        raise NeverSettled(f"the law and its actuators are still {np.abs(off).max()} apart")

    def coefficients(self) -> np.ndarray:
        """k1, k2, k3, eps, each of pitch and depth: (4, 2)."""
        return np.array([[*vars(axis).values()] for axis in (self.pitch, self.depth)]).T

    @property
    def eps(self) -> tuple[float, float]:
        return self.pitch.eps, self.depth.eps

    def push(self, s, g) -> np.ndarray:
        """Size of what the law takes off both demands for s alone, (2,)."""
        _, k2, k3, eps = self.coefficients()
        full = k3 * np.abs(s) + k2 * np.abs(g) * np.minimum(np.abs(s) / eps, 1.0) * np.minimum(np.abs(g) / eps, 1.0)
        return full if self.share is None else np.minimum(full, np.sqrt(2.0 * self.jerks(g) * np.abs(s)))

    def error_bound(self, x, spread, speeds=STANDING) -> np.ndarray:
        """What theta_dd and Z_dd may be off by with the actuators where x has them, (2,)."""
        scratch = np.empty(layout.N_P)
        return np.array(model_error_bound(self.vehicle, spread, scratch, *down(x), *x[7:16].tolist(), *speeds))


def advance(vehicle: np.ndarray, x: np.ndarray, command, acc: np.ndarray, dt: float, work: np.ndarray) -> None:
    """One Runge-Kutta step of the plant in still water, in place."""
    plant_step(vehicle, STILL, NO_WAVES, x, np.asarray(command, dtype=float), 0.0, dt, acc, work)


def worst(x: np.ndarray, s: np.ndarray, strength: np.ndarray) -> np.ndarray:
    """Body accelerations (6,) that push pitch and depth by `strength` (2,) away from s = 0."""
    phi, _, _ = euler_from_quaternion(*x[3:7])
    pitch, depth = strength * np.sign(s)
    return np.array([*(depth * np.array(down(x))), 0.0, pitch * math.cos(phi), -pitch * math.sin(phi)])


def lyapunov_rate(law: Law, vehicle: np.ndarray, x, references, command, acc=NO_DISTURBANCE) -> np.ndarray:
    """V_dot of both axes, (2,), s_dot from the accelerations of the plant under `command`."""
    k1 = law.coefficients()[0]
    acceleration = output_accelerations(x, plant_rates(vehicle, x, command, acc)[7:13])
    theta, theta_rate, Z, Z_rate = outputs(x)
    error = np.array([theta - references[0].position, Z - references[1].position])
    error_rate = np.array([theta_rate - references[0].rate, Z_rate - references[1].rate])
    s_dot = k1 * error_rate + acceleration - [reference.acc for reference in references]
    return (k1 * error + error_rate) * s_dot
