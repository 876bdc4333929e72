"""A pool vehicle's numbers in the forms of other simulators: Fossen's matrices, Gazebo's SDF, Stonefish's XML.

Equation (4) is expanded about straight flight to the second order in alpha and beta. Actuators stand at neutral. The
damping of the rates, K_p V^2 p and so on, is linear in the rate at one speed.
Within 6 degrees of straight flight at that speed the expansion is within 3 % of the largest force of the water.
"""

from typing import Any
from xml.etree import ElementTree as xml

import numpy as np

from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.layout import GRAVITY
from glider.firmware.core.vehicle.mass import first_moment, inertia, translational_mass
from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.data.errors import InputError
from glider.tools.inference.model import effects_in
from glider.tools.inference.numbers_out import OceanNumbers, VehicleNumbers

FORCES, VELOCITIES = "XYZKMN", "uvwpqr"
EXPRESSED = {  # effects of the catalogue that these forms can hold
    "drag", "linear_drag", "lift", "added_mass", "side_force", "roll_trim", "pitch_trim", "pitch_damping", "yaw_trim",
    "weathercock", "yaw_damping", "net_buoyancy", "cg_longitudinal", "cg_lateral", "cg_vertical", "inertia",
}  # fmt: skip
SIGNS = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])


def require_pool(numbers: VehicleNumbers) -> None:
    """InputError for an ocean glider, whose model has no six degrees of freedom."""
    if isinstance(numbers, OceanNumbers):
        message = "an ocean glider's model has no such coefficients: glider export parameters"
        raise InputError(message, source=numbers.source)


def mass_matrices(P: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mass matrices of body and added mass, M_RB and M_A, (6, 6) each, about the origin, actuators at neutral."""
    masses = np.array(translational_mass(P, 0.0))
    S1, S2, S3 = first_moment(P, 0.0, 0.0, 0.0)
    J = inertia(P, 0.0, 0.0, 0.0)
    M = np.zeros((6, 6))
    M[:3, :3] = np.diag(masses)
    cross = np.array([[0.0, -S3, S2], [S3, 0.0, -S1], [-S2, S1, 0.0]])
    M[:3, 3:], M[3:, :3] = -cross, cross
    M[3:, 3:] = [[J[0], J[3], J[4]], [J[3], J[1], J[5]], [J[4], J[5], J[2]]]
    added = np.diag([*P[layout.A_X : layout.A_Z + 1], *P[layout.B_X : layout.B_Z + 1]])
    return M - added, added


def derivatives(numbers: VehicleNumbers, speed: float) -> dict[str, float]:
    """Hydrodynamic derivatives in body axes z down: `X_uu` is the coefficient of u |u| in X, `Z_uw` of |u| w in Z,
    `X_ww` of w^2, `K_vw` of v w, `M_qq` of q |q|, `K_p` of p; N, N m, m/s, rad/s.

    speed: at which the damping of the rates is linear, m/s.
    """
    P, F = numbers.effective, numbers.F
    k = {name: float(P[getattr(layout, name.upper())]) for name in (
        "K_D0", "K_D", "K_L0", "K_L", "K_beta", "K_MR", "K_p", "K_M0", "K_M", "K_q", "K_MY", "K_r", "D_p", "D_q", "D_r"
    )}  # fmt: skip
    printed = bool(P[layout.LIFT_PRINTED])
    slope = 0.0 if printed else k["K_L"]
    found = {
        "X_uu": -k["K_D0"], "X_uw": k["K_L0"], "X_ww": slope - k["K_D"] - 0.5 * k["K_D0"],
        "X_vv": -k["K_beta"] - 0.5 * k["K_D0"], "Y_uv": k["K_beta"] - k["K_D0"],
        "Z_uu": -k["K_L0"], "Z_uw": -(k["K_D0"] + slope), "Z_ww": -k["K_L"] if printed else 0.0,
        "K_uv": k["K_MR"] - k["K_M0"], "K_vw": -(k["K_M"] + k["K_MY"]), "M_vv": k["K_MR"], "N_vw": k["K_MR"],
        "M_uu": k["K_M0"], "M_uw": k["K_M"], "N_uv": k["K_MY"],
        "K_p": k["K_p"] * speed**2 + k["D_p"], "M_q": k["K_q"] * speed**2 + k["D_q"],
        "N_r": k["K_r"] * speed**2 + k["D_r"],
        "K_vq": -k["K_q"] * speed, "K_wr": -k["K_r"] * speed, "M_vp": k["K_p"] * speed, "N_wp": k["K_p"] * speed,
        "K_uu": float(F[ef.ROLL_TRIM]), "N_uu": float(F[ef.YAW_TRIM]),
        "M_qq": k["K_q"] * float(F[ef.PITCH_DAMPING_ACROSS]), "N_rr": k["K_r"] * float(F[ef.YAW_DAMPING_ACROSS]),
        "X_u": -float(F[ef.LINEAR_DRAG]), "Y_v": -float(F[ef.LINEAR_DRAG]), "Z_w": -float(F[ef.LINEAR_DRAG]),
    }  # fmt: skip
    return {name: value for name, value in found.items() if value != 0.0}


def left_out(numbers: VehicleNumbers) -> list[str]:
    """Labels of the effects that the exported numbers do not hold: sensors, actuators, forces of another form."""
    return [label for label in effects_in(numbers.F) if label not in EXPRESSED]


def damping_matrix(terms: dict[str, float], speed: float) -> np.ndarray:
    """D (6, 6) of -D nu, linear about straight flight at a speed, m/s."""
    D = np.zeros((6, 6))
    for name, value in terms.items():
        row, of = FORCES.index(name[0]), name[2:]
        if len(of) == 1:
            D[row, VELOCITIES.index(of)] -= value
        elif of == "uu":
            D[row, 0] -= 2.0 * value * speed
        elif of[0] == "u":
            D[row, VELOCITIES.index(of[1])] -= value * speed
    return D


def fossen(numbers: VehicleNumbers, speed: float) -> dict[str, Any]:
    """M, the parameters of C and D in the notation of Fossen, body axes x forward, y starboard, z down."""
    require_pool(numbers)
    P = numbers.effective
    M_RB, M_A = mass_matrices(P)
    terms = derivatives(numbers, speed)
    mass = float(M_RB[0, 0])
    return {
        "vehicle": numbers.name, "source": numbers.source,
        "frame": "body x forward, y starboard, z down; order X Y Z K M N and u v w p q r; SI",
        "M": (M_RB + M_A).tolist(), "M_RB": M_RB.tolist(), "M_A": M_A.tolist(),
        "C": {
            "m": mass, "r_g": centre(M_RB).tolist(), "I_o": M_RB[3:, 3:].tolist(),
            **{f"{force}_{velocity}dot": -float(M_A[n, n])
               for n, (force, velocity) in enumerate(zip(FORCES, VELOCITIES, strict=True))},
        },
        "D": damping_matrix(terms, speed).tolist(), "speed_m_s": speed, "derivatives": terms,
        "weight_minus_buoyancy_n": float(P[layout.NET_MASS]) * GRAVITY,
        "left_out": left_out(numbers),
    }  # fmt: skip


def centre(M_RB: np.ndarray) -> np.ndarray:
    """Centre of mass, m, (3,), of a mass matrix about the origin."""
    return np.array([M_RB[2, 4] * -1.0, M_RB[2, 3], M_RB[1, 3] * -1.0]) / M_RB[0, 0]


def _add(parent: xml.Element, name: str, value: float | str) -> None:
    xml.SubElement(parent, name).text = value if isinstance(value, str) else f"{value:.9g}"


def sdf(numbers: VehicleNumbers, speed: float) -> str:
    """A model in SDF 1.11: inertia, fluid added mass, and the parameters of Gazebo's hydrodynamics plugin.

    Body axes there are x forward, y left, z up. Buoyancy, geometry and joints are the user's.
    """
    require_pool(numbers)
    M_RB, M_A = mass_matrices(numbers.effective)
    root = xml.Element("sdf", version="1.11")
    model = xml.SubElement(root, "model", name=numbers.name)
    link = xml.SubElement(model, "link", name="base_link")
    inertial = xml.SubElement(link, "inertial")
    mass, r = float(M_RB[0, 0]), centre(M_RB) * SIGNS[:3]
    about = M_RB[3:, 3:] * np.outer(SIGNS[3:], SIGNS[3:]) - mass * (r @ r * np.eye(3) - np.outer(r, r))
    _add(inertial, "mass", mass)
    _add(inertial, "pose", " ".join(f"{value:.9g}" for value in (*r, 0.0, 0.0, 0.0)))
    tensor = xml.SubElement(inertial, "inertia")
    for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
        _add(tensor, f"i{'xyz'[i]}{'xyz'[j]}", float(about[i, j]))
    added = xml.SubElement(inertial, "fluid_added_mass")
    for n, axis in enumerate("xyzpqr"):
        _add(added, 2 * axis, float(M_A[n, n]))
    plugin = xml.SubElement(
        model, "plugin", filename="gz-sim-hydrodynamics-system", name="gz::sim::systems::Hydrodynamics"
    )
    _add(plugin, "link_name", "base_link")
    for name, value in gazebo_terms(derivatives(numbers, speed)).items():
        _add(plugin, name, value)
    xml.indent(root)
    return '<?xml version="1.0"?>\n' + xml.tostring(root, encoding="unicode") + "\n"


def gazebo_terms(terms: dict[str, float]) -> dict[str, float]:
    """Derivatives by the names of the hydrodynamics plugin, in its axes: `zWabsU` is the coefficient of W |U| in z."""
    found = {}
    for name, value in terms.items():
        force, of = name[0], name[2:]
        sign = SIGNS[FORCES.index(force)]
        if len(of) == 1:
            found[force.lower() + of.upper()] = value * sign * SIGNS[VELOCITIES.index(of)]
        elif of[0] == "u":  # |u|: of no sign
            found[f"{force.lower()}{of[1].upper()}absU"] = value * sign * SIGNS[VELOCITIES.index(of[1])]
        elif of in ("qq", "rr"):
            found[f"{force.lower()}{of[0].upper()}abs{of[0].upper()}"] = value
        else:  # a square or a product, as it is
            found[f"{force.lower()}{of.upper()}"] = (
                value * sign * float(np.prod([SIGNS[VELOCITIES.index(v)] for v in of]))
            )
    return found


def stonefish(numbers: VehicleNumbers, area: float | None, density: float) -> str:
    """The elements of a Stonefish body, for its <base_link>: mass, inertia, centre of mass, drag along x.

    area: reference area of the body along x, m2, by which the simulator scales its drag; None: no drag is written.
    density: of the water, kg/m3. Lift, side force and moments of the hull are none of its parameters.
    """
    require_pool(numbers)
    M_RB, _ = mass_matrices(numbers.effective)
    mass, r = float(M_RB[0, 0]), centre(M_RB)
    about = M_RB[3:, 3:] - mass * (r @ r * np.eye(3) - np.outer(r, r))
    root = xml.Element("base_link", name=numbers.name, physics="submerged")
    xml.SubElement(root, "mass", value=f"{mass:.9g}")
    xml.SubElement(root, "inertia", xyz=" ".join(f"{about[n, n]:.9g}" for n in range(3)))
    xml.SubElement(root, "cg", xyz=" ".join(f"{value:.9g}" for value in r), rpy="0.0 0.0 0.0")
    if area is not None:
        drag = 2.0 * float(numbers.effective[layout.K_D0]) / (density * area)
        xml.SubElement(root, "hydrodynamics", quadratic_drag=f"{drag:.9g} -1.0 -1.0")
    xml.indent(root)
    return xml.tostring(root, encoding="unicode") + "\n"
