"""The law's figures over glides of the shipped vehicle.

`python -m glider.tools.verify.figures.law` prints tables of docs/explanation/control.md.

What the `paper` form leaves out against the exact one, in theta_dd, Z_dd, the input gains and the roll form (22); and
the k2 that covers what [uncertainty] and [disturbance] leave of the exact one.
"""

import math
from collections.abc import Iterator

import numpy as np

from glider.firmware.core.control.error_bound import model_error_bound
from glider.firmware.core.control.input_forms import (
    exact_form,
    output_accelerations,
    output_rates,
    paper_form,
    roll_form,
)
from glider.firmware.core.control.law import k2_to_cover
from glider.firmware.core.maths.rotations import euler_from_quaternion, quaternion_from_euler, rotation_nb
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.flight import nominal_derivative, nominal_run
from glider.firmware.core.vehicle.motion import accelerations
from glider.firmware.model.estimator_settings import parameter_sigma
from glider.firmware.model.vehicle import Vehicle
from glider.tools.data.sources import load_vehicle

SEED = 1
STATES, COVER_STATES = 20_000, 2_000
# random glides: 1 sigma or +-limit
PITCH, ROLL = math.radians(50.0), math.radians(45.0)  # +-
SPEED = (0.2, 0.6)  # m/s
ATTACK, SIDESLIP = math.radians(8.0), math.radians(5.0)  # +-
RATE = 0.1  # rad/s, +-
# steady glides: settled when no acceleration is above this after the time
SETTLING_S, STEP = 240.0, 0.02
STEADY_ACCELERATION = 1e-3  # m/s2, rad/s2
STEEPEST_PITCH = math.radians(60.0)

Sample = tuple[np.ndarray, np.ndarray]  # state (N_X,), speeds of the actuators (3,)
ROWS = ("theta_dd, rad/s2", "Z_dd, m/s2", "phi_dd, rad/s2", "g_theta, share", "g_Z, share")
COVER_ROWS = ("bound of theta_dd's error, rad/s2", "bound of Z_dd's error, m/s2", "k2 of pitch, m", "k2 of depth, kg")


def ranges(P: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Least, greatest position and rate of servo, slider, ballast."""
    starts = np.array([layout.SERVO_MIN, layout.SLIDER_MIN, layout.BALLAST_MIN])
    return P[starts], P[starts + 1], P[starts + 2]


def random_glides(P: np.ndarray, count: int, seed: int) -> Iterator[Sample]:
    """States of a glide or of the way into one, actuators anywhere and moving."""
    rng = np.random.default_rng(seed)
    low, high, rate = ranges(P)
    for _ in range(count):
        x = np.zeros(layout.N_X)
        roll, pitch = rng.uniform(-1.0, 1.0, 2) * (ROLL, PITCH)
        x[3:7] = quaternion_from_euler(roll, pitch, 0.0)
        speed, attack, slip = rng.uniform(*SPEED), *(rng.uniform(-1.0, 1.0, 2) * (ATTACK, SIDESLIP))
        x[7:10] = speed * np.array([
            math.cos(attack) * math.cos(slip), math.sin(slip), math.sin(attack) * math.cos(slip)
        ])  # fmt: skip
        x[10:13] = rng.uniform(-RATE, RATE, 3)
        x[layout.X_ACT :] = rng.uniform(low, high)
        yield x, rng.uniform(-rate, rate)


def steady_glides(P: np.ndarray) -> Iterator[Sample]:
    """Glides flown until they are steady, straight and turning, down and up."""
    work, rates = np.zeros((5, layout.N_X)), np.zeros(layout.N_X)
    for servo in (-0.8, -0.4, 0.0, 0.4, 0.8):
        for ballast in (-0.2, -0.1, 0.1, 0.2):
            for trim in np.linspace(-0.02, 0.02, 9):
                # the slider holds most of the tank's weight forward, and a pitch beside it
                slider = -P[layout.X_B] * ballast / P[layout.M_S] + trim
                x = np.zeros(layout.N_X)
                x[2], x[3], x[7] = 1.0, 1.0, 0.2
                command = servo, slider, ballast
                nominal_run(P, x, *command, 0.0, 0.0, 0.0, STEP, round(SETTLING_S / STEP), work)
                nominal_derivative(P, x, *command, 0.0, 0.0, 0.0, rates)
                _, pitch, _ = euler_from_quaternion(*x[3:7])
                if np.abs(rates[7:13]).max() < STEADY_ACCELERATION and abs(pitch) < STEEPEST_PITCH:
                    yield x, np.zeros(3)


def roll_acceleration(k, nu: np.ndarray, nu_dot: np.ndarray) -> float:
    """phi_dd by (21), from nu_dot."""
    _, q, r = nu[3:]
    phi, pitch = math.atan2(k[1], k[2]), math.asin(-k[0])
    sf, cf, tt, ct = math.sin(phi), math.cos(phi), math.tan(pitch), math.cos(pitch)
    roll_rate, pitch_rate, _ = output_rates(*k, *nu)
    moving = (
        cf * tt * q * roll_rate + sf / ct**2 * q * pitch_rate - sf * tt * r * roll_rate + cf / ct**2 * r * pitch_rate
    )
    return moving + nu_dot[3] + sf * tt * nu_dot[4] + cf * tt * nu_dot[5]


def errors(P: np.ndarray, x: np.ndarray, speeds: np.ndarray) -> np.ndarray:
    """Paper less exact, in the order of ROWS, shape (5,)."""
    k, nu, act = rotation_nb(*x[3:7])[6:], x[7:13], x[layout.X_ACT :]
    exact, paper = (np.array(form(P, *k, *nu, *act, *speeds)) for form in (exact_form, paper_form))
    nu_dot = np.array(accelerations(P, *k, *nu, *act, *speeds, *np.zeros(6)))
    pitch_acc, depth_acc = output_accelerations(*k, *nu, *nu_dot)
    J, a, b = roll_form(P, *k, *nu, *act)
    roll_acc = J + a * math.sin(act[0]) + b * math.cos(act[0])
    inputs = np.reshape(paper[2:], (2, 2)) @ act[1:]
    return np.array([
        paper[0] + inputs[0] - pitch_acc,
        paper[1] + inputs[1] - depth_acc,
        roll_acc - roll_acceleration(k, nu, nu_dot),
        paper[2] / exact[2] - 1.0,
        paper[5] / exact[5] - 1.0,
    ])  # fmt: skip


def table(P: np.ndarray, samples: Iterator[Sample]) -> tuple[int, np.ndarray]:
    """Number of samples, and rms and greatest size of each error, (5, 2)."""
    found = np.array([errors(P, *sample) for sample in samples])
    return len(found), np.column_stack([np.sqrt((found**2).mean(axis=0)), np.abs(found).max(axis=0)])


def cover(vehicle: Vehicle, sigmas: float, samples: Iterator[Sample]) -> np.ndarray:
    """Model error bounds of pitch and depth and the k2 that cover them with the disturbance, median and 95 %: (4, 2).

    Everything at `sigmas` times its sigma; eps small beside g.
    """
    P, scratch = vehicle.vector(), np.empty(layout.N_P)
    spread = sigmas * parameter_sigma(P, vehicle.uncertainty)
    found = []
    for x, speeds in samples:
        k, nu, act = rotation_nb(*x[3:7])[6:], x[7:13], x[layout.X_ACT :]
        _, _, g_ts, _, _, g_zb = exact_form(P, *k, *nu, *act, *speeds)
        pitch, depth = model_error_bound(P, spread, scratch, *k, *nu, *act, *speeds)
        k2_pitch = k2_to_cover(pitch, sigmas * vehicle.disturbance.angular, g_ts, 1e-3)
        k2_depth = k2_to_cover(depth, sigmas * vehicle.disturbance.linear, g_zb, 1e-3)
        found.append((pitch, depth, k2_pitch, k2_depth))
    return np.percentile(found, (50.0, 95.0), axis=0).T


def rows(names: tuple[str, ...], columns: np.ndarray) -> Iterator[str]:
    """A table's rows, two figures each number."""
    for name, values in zip(names, columns, strict=True):
        yield f"| {name} | " + " | ".join(f"{value:.2g}" for value in values) + " |"


def main() -> None:
    vehicle = load_vehicle("roughie")
    P = vehicle.vector()
    (random, at_random), (steady, at_rest) = table(P, random_glides(P, STATES, SEED)), table(P, steady_glides(P))
    print(f"| paper less exact | {random} random glides: rms | largest | {steady} steady glides: rms | largest |")
    print("|---|---|---|---|---|")
    print(*rows(ROWS, np.hstack([at_random, at_rest])), sep="\n")
    print()
    covers = [cover(vehicle, sigmas, random_glides(P, COVER_STATES, SEED)) for sigmas in (1.0, 3.0)]
    print(f"| {COVER_STATES} random glides | 1 sigma: median | 95 % | 3 sigma: median | 95 % |")
    print("|---|---|---|---|---|")
    print(*rows(COVER_ROWS, np.hstack(covers)), sep="\n")


if __name__ == "__main__":
    main()
