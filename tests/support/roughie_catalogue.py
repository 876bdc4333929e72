"""ROUGHIE with the catalogue's effects as parameters of a user's model: both engines asked about the same cases.

    python -m tests.support.roughie_catalogue SET OUT [CASE ...]

SET: the folder of `glider gap challenge make --form`; of every case the healthy runs are identified, then it is
diagnosed, into OUT/CASE. Printed: the labels of the catalogue that the answer comes to. Effects that remember (play,
lags, delays) are those that every input and output has.
"""

import json
import sys
from pathlib import Path

import numpy as np

from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.layout import N_P, N_X
from glider.sim_backend.core.effect_plant import effect_derivative, effective_parameters
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.catalogue import EFFECTS
from glider.sim_backend.core.effects.sensing import read
from glider.sim_backend.models import roughie
from glider.tools.inference import vehicle_parameters as known

P0, F0, N_XF, N_Y = roughie.P0.copy(), np.zeros(ef.N_F), ef.N_XF, ef.N_Y
SENSORS, MASS = roughie.VEHICLE.sensors, roughie.VEHICLE.uncertainty.mass
PRIOR = 0.5  # of the priors of `glider identify`: a model of one's own is given twice its uncertainties

# labels of the catalogue by what a user's model calls them; those of VEHICLE are parameters of its own
VEHICLE = {
    "K_D0": "drag", "K_D": "drag", "K_L0": "lift", "K_L": "lift", "K_beta": "side_force", "K_MR": "roll_trim",
    "K_p": "roll_trim", "K_M0": "pitch_trim", "K_M": "pitch_trim", "K_q": "pitch_damping", "K_MY": "weathercock",
    "K_r": "yaw_damping", "m_t": "cg_longitudinal", "m_r": "cg_lateral", "m_s": "slider_scale",
    "net_mass": "net_buoyancy", "cg_x": "cg_longitudinal", "cg_y": "cg_lateral", "cg_z": "cg_vertical",
    "D_p": "roll_trim", "D_q": "pitch_damping", "D_r": "yaw_damping",
    **{f"added_mass_{axis}": "added_mass" for axis in "xyz"}, **{f"added_inertia_{axis}": "inertia" for axis in "xyz"},
}  # fmt: skip
STANDARD = {
    "roll_bias": "imu_roll_bias", "pitch_bias": "imu_pitch_bias", "yaw_bias": "compass", "yaw_gain": "compass",
    "pitch_gain": "attitude_scale", "roll_gain": "attitude_scale", "depth_bias": "depth_offset",
    "depth_gain": "depth_scale", "depth_lag": "depth_lag", "depth_delay": "depth_lag",
    "servo_offset": "servo_offset", "servo_gain": "servo_offset", "servo_backlash": "servo_backlash",
    "servo_limit": "servo_limit", "servo_lag": "servo_slow", "servo_rate_limit": "servo_slow",
    "slider_backlash": "slider_backlash", "slider_lag": "slider_slow", "slider_rate_limit": "slider_slow",
    "slider_gain": "slider_scale", "slider_offset": "cg_longitudinal", "ballast_lag": "pump_slow",
    "ballast_rate_limit": "pump_slow", "ballast_gain": "ballast_scale", "ballast_offset": "net_buoyancy",
    **{f"{axis}_rate_gain": "gyro_scale" for axis in "pqr"}, **{f"{axis}_rate_bias": "gyro_bias" for axis in "pqr"},
    **{f"{name}_{kind}": "attitude_lag" for name in ("roll", "pitch", "yaw", "p_rate", "q_rate", "r_rate")
       for kind in ("lag", "delay")},
    **{f"{name}_delay": "command_delay" for name in ("servo", "slider", "ballast")},
    **{f"mocap_{axis}_{kind}": "mocap_delay" for axis in "xyz" for kind in ("lag", "delay")},
}  # fmt: skip
# entries of F that these stand for, or that act only beside another
ELSEWHERE = {
    "SERVO_PLAY", "SLIDER_PLAY", "ATTITUDE_LAG", "DEPTH_LAG", "COMMAND_DELAY", "MOCAP_DELAY", "CLOCK_SKEW",
    "SERVO_OFFSET", "DRAG_0", "DRAG_ALPHA", "LIFT", "ADDED_Y", "ADDED_Z", "SIDE", "PITCH_TRIM", "PITCH_DAMPING",
    "WEATHERCOCK", "YAW_DAMPING", "NET_MASS_OFFSET", "CG_OFFSET_X", "CG_OFFSET_Y", "CG_OFFSET_Z", "ROLL_BIAS",
    "PITCH_BIAS", "PITCH_SCALE", "GYRO_P", "GYRO_Q", "GYRO_R", "DEPTH_OFFSET", "DEPTH_SCALE", "SERVO_GIVE",
    "MIXED_LAYER", "TETHER_ACROSS",
}  # fmt: skip
HEAVIER = "x_mass_per_depth"  # with depth, or lighter: one entry of two labels


def vehicle_parameters() -> list[dict]:
    """What `glider identify` leaves free, with its priors."""
    found = []
    for one in known.coefficients(P0, first=True):
        damps = one.name in known.DAMPING
        sides = {"high": 0.0} if damps else {"low": 0.0} if one.name in ("K_D0", "K_D") else {}
        sd = abs(P0[one.entry]) if damps else one.spread
        found.append({"name": one.name, "unit": one.unit, "place": one.entry, "sd": sd, **sides})
    found += [{"name": name, "unit": "kg", "place": at, "sd": MASS * P0[at] / PRIOR}
              for name, at in known.MASSES.items()]  # fmt: skip
    found += [{"name": name, "unit": "kg m2" if "inertia" in name else "kg", "place": at,
               "sd": known.ADDED_SHARE * P0[at], "low": 0.05 * P0[at]} for name, at in known.ADDED.items()]  # fmt: skip
    found.append({"name": "net_mass", "unit": "kg", "place": layout.NET_MASS, "sd": known.NET_MASS})
    found += [{"name": name, "unit": "m", "place": at, "sd": known.CG} for name, at in known.CENTRE.items()]
    found += [{"name": name, "unit": "N m s/rad", "place": getattr(layout, name.upper()), "sd": sd, "high": 0.0}
              for name, sd in known.LINEAR_DAMPING.items()]  # fmt: skip
    return found


OWN = vehicle_parameters()
EXTRA = {f"x_{p.place.lower()}": (effect.label, p) for effect in reversed(EFFECTS) for p in effect.parameters
         if p.place and p.place not in ELSEWHERE}  # fmt: skip
OPEN = np.array([one["place"] for one in OWN])
ENTRIES = np.array([getattr(ef, p.place) for _, p in EXTRA.values()])
ONBOARD = np.array([ef.Y_ROLL, ef.Y_PITCH, ef.Y_YAW, ef.Y_P, ef.Y_Q, ef.Y_R, ef.Y_DEPTH, ef.Y_SLIDER, ef.Y_BALLAST,
                    ef.Y_MOCAP_X, ef.Y_MOCAP_Y, ef.Y_MOCAP_Z])  # fmt: skip

inputs, noises, horizon = roughie.inputs, roughie.noises, roughie.horizon
states = [*roughie.states, {"name": "since", "unit": "s", "start_uncertainty": 1e-9}]
WIRES = {"slider_wire": SENSORS.slider.bias, "ballast_wire": SENSORS.ballast.bias}
outputs = [
    *({**one, "bias": WIRES.get(one["name"], one.get("bias", 0.0))} for one in roughie.outputs),
    *({"name": f"mocap_{axis}", "column": f"mocap_{axis}_m", "unit": "m", "noise": SENSORS.mocap_position.noise,
       "tolerance": 0.05 if axis == "z" else 0.15} for axis in "xyz"),
]  # fmt: skip
parameters = [
    *({"name": one["name"], "unit": one["unit"], "value": float(P0[one["place"]]),
       "uncertainty": float(PRIOR * one["sd"]), **{side: one[side] for side in ("low", "high") if side in one}}
      for one in OWN),
    *({"name": name, "unit": p.unit, "low": -p.high if name == HEAVIER else p.low, "high": p.high}
      for name, (_, p) in EXTRA.items()),
]  # fmt: skip


def derivative(x, u, w, theta):
    """dx/dt (17,) of the vehicle with its effects and accelerations w (6,) beside it."""
    P, F, effective = P0.copy(), F0.copy(), np.empty(N_P)
    for k in range(len(OPEN)):
        P[OPEN[k]] = theta[k]
    for k in range(len(ENTRIES)):
        F[ENTRIES[k]] = theta[len(OPEN) + k]
    effective_parameters(P, F, effective)
    state, out, found = np.zeros(N_XF), np.zeros(N_XF), np.ones(N_X + 1)
    state[:N_X] = x[:N_X]
    effect_derivative(effective, F, state, 0, u[0], u[1], u[2], x[N_X], w, 0.0, np.zeros(3), out)
    found[:N_X] = out[:N_X]
    return found


def measure(x, u, theta):
    """What onboard sensors and motion capture read, (12,)."""
    F, state, y = F0.copy(), np.zeros(N_XF), np.zeros(N_Y)
    for k in range(len(ENTRIES)):
        F[ENTRIES[k]] = theta[len(OPEN) + k]
    state[:N_X] = x[:N_X]
    read(F, state, y)
    return y[ONBOARD]


def initial(y):
    """As ROUGHIE's, at the first pose where there is one."""
    found = []
    for x, sd in roughie.initial(y):
        x[0], x[1] = np.nan_to_num([y["mocap_x"], y["mocap_y"]])
        found.append((np.append(x, 0.0), np.append(sd, 1e-9)))
    return found


def catalogue_chances(causes: list[dict]) -> dict[str, float]:
    """Probabilities by label of the catalogue."""
    found: dict[str, float] = {}
    for one in causes:
        name = label = one["label"]
        if label == HEAVIER:
            name = "compressibility" if one["parameters"][label]["estimate"] > 0.0 else "stratification"
        elif label in EXTRA:
            name = EXTRA[label][0]
        elif label.endswith(("_noise", "_oscillation")):
            name = "turbulence" if label.endswith("_noise") else "waves"
        name = (VEHICLE | STANDARD).get(name, name)
        found[name] = found.get(name, 0.0) + one["probability"]
    return dict(sorted(found.items(), key=lambda one: -one[1]))


def main(folder: Path, out: Path, only: list[str]) -> None:
    """Every case, or those named, identified, diagnosed and said."""
    from tests.support.commands import glider

    folder, out = folder.resolve(), out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    (out / "roughie_catalogue.toml").write_text('format = 1\nmodel = "roughie_catalogue"\n')
    (out / "roughie_catalogue.py").write_text(Path(__file__).read_text(encoding="utf-8"))
    for case in sorted(path for path in (folder / "cases").iterdir() if not only or path.name in only):
        into, before = out / case.name, folder / "reference" / case.name
        glider("identify", before, "--vehicle", out / "roughie_catalogue.toml", "--out", into / "identified", cwd=out)
        glider("gap", "diagnose", case, "--vehicle", into / "identified" / "identified.toml", "--out", into, cwd=out)
        answer = json.loads((into / "diagnosis.json").read_text())
        chances = catalogue_chances(answer["causes"])
        print(case.name, {name: round(p, 2) for name, p in list(chances.items())[:3]}, flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3:])
