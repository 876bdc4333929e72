"""What may be wrong in a blind case: every label of the catalogue in its foreign form, and effects that no label names.

A form fills the foreign plant's vector F (foreign_layout): `strength` 0 is no effect, 1 a plain one.
"""

from dataclasses import dataclass

import numpy as np

from glider.firmware.core.vehicle.layout import GRAVITY
from glider.sim_backend.foreign import foreign_layout as fo

Place = tuple[str, str]


@dataclass(frozen=True)
class Form:
    """One effect: where it sits and which entries of F it fills, `sizes` at strength 1."""

    label: str
    places: tuple[Place, ...]
    entries: tuple[int, ...]
    sizes: tuple[float, ...]
    most: float  # strength that is never passed
    most_negative: float = 0.0  # the same the other way; 0: one sign only
    by_mocap: bool = False  # nobody can see it without motion capture
    scatter: bool = False  # its course cannot be predicted
    least: float = 0.0  # strength below which it is within what is allowed: 5 sigma of a parameter or bias of its kind

    @property
    def known(self) -> bool:
        """Whether the catalogue has a label for it."""
        return not self.label.startswith("x_")

    def draw(self, rng: np.random.Generator) -> tuple[np.ndarray, float]:
        """Sizes of the entries at strength 1, with sign and direction drawn, and the most strength they may have."""
        sizes = np.array(self.sizes)
        if len(sizes) == 1:
            negative = self.most_negative > 0.0 and rng.random() < 0.5
            return (-sizes, self.most_negative) if negative else (sizes, self.most)
        direction = rng.standard_normal(len(sizes))
        return sizes * direction / np.linalg.norm(direction), self.most


def _form(label: str, subsystem: str, element: str, entries, sizes, most, negative=0.0, **further) -> Form:
    entries = entries if isinstance(entries, tuple) else (entries,)
    sizes = sizes if isinstance(sizes, tuple) else len(entries) * (sizes,)
    return Form(label, ((subsystem, element),), entries, sizes, most, negative, **further)


KNOWN = (
    _form("servo_slow", "actuation", "servo", fo.FS_SERVO_SLOW, 1.0, 8.0),
    _form("servo_backlash", "actuation", "servo", fo.FS_SERVO_BACKLASH, 0.15, 3.0),
    _form("servo_offset", "actuation", "servo", fo.FS_SERVO_OFFSET, 0.25, 2.0, 2.0),
    _form("servo_limit", "actuation", "servo", fo.FS_SERVO_LIMIT, 1.2, 3.5),
    _form("slider_slow", "actuation", "slider", fo.FS_SLIDER_SLOW, 1.0, 8.0),
    _form("slider_backlash", "actuation", "slider", fo.FS_SLIDER_BACKLASH, 0.004, 3.0),
    _form("pump_slow", "actuation", "ballast", fo.FS_PUMP_SLOW, 1.0, 3.0),
    _form("pump_droop", "actuation", "ballast", fo.FS_PUMP_DROOP, 0.3, 10.0),
    _form("ballast_leak", "actuation", "ballast", fo.FS_BALLAST_LEAK, 0.05, 1.5),
    _form("drag", "hydrodynamics", "surge", fo.FS_DRAG, 0.6, 4.0, 1.1, least=0.25),
    _form("linear_drag", "hydrodynamics", "surge", fo.FS_LINEAR_DRAG, 0.6, 4.0),
    _form("climb_dive_asymmetry", "hydrodynamics", "surge", fo.FS_ASYMMETRY, 0.4, 1.8, 1.8),
    _form("tether", "hydrodynamics", "surge", fo.FS_TETHER, 0.3, 4.0),
    _form("lift", "hydrodynamics", "heave", fo.FS_LIFT, 0.4, 3.0, 1.6, least=0.375),
    _form("stall", "hydrodynamics", "heave", fo.FS_STALL, 8.0, 3.0),
    _form("added_mass", "hydrodynamics", "heave", fo.FS_ADDED_MASS, 0.8, 4.0, 0.9, least=0.3125),
    _form("side_force", "hydrodynamics", "sway", fo.FS_SIDE_FORCE, 0.8, 4.0, 1.1, least=0.1875),
    _form("roll_trim", "hydrodynamics", "roll", fo.FS_ROLL_TRIM, 0.08, 4.0, 4.0),
    _form("pitch_trim", "hydrodynamics", "pitch", fo.FS_PITCH_TRIM, 0.3, 2.0, 2.0),
    _form("pitch_damping", "hydrodynamics", "pitch", fo.FS_PITCH_DAMPING, 1.0, 6.0, 0.8, least=0.15),
    _form("yaw_trim", "hydrodynamics", "yaw", fo.FS_YAW_TRIM, 0.2, 3.0, 3.0),
    _form("weathercock", "hydrodynamics", "yaw", fo.FS_WEATHERCOCK, 0.4, 3.0, 1.5, least=0.375),
    _form("yaw_damping", "hydrodynamics", "yaw", fo.FS_YAW_DAMPING, 1.0, 6.0, 0.8, least=0.15),
    _form("net_buoyancy", "mass", "net", fo.FS_NET_BUOYANCY, 0.04, 1.5, 1.5, least=0.125),
    _form("ballast_scale", "mass", "net", fo.FS_BALLAST_SCALE, 0.15, 1.5, 1.5),
    _form("compressibility", "mass", "net", fo.FS_COMPRESSIBILITY, 0.06, 3.0),
    _form("stratification", "mass", "net", fo.FS_STRATIFICATION, 0.06, 2.0),
    _form("cg_longitudinal", "mass", "longitudinal", fo.FS_CG_LONGITUDINAL, 0.001, 3.0, 3.0, least=0.25),
    _form("slider_scale", "mass", "longitudinal", fo.FS_SLIDER_SCALE, 0.3, 2.5, 2.5),
    _form("cg_lateral", "mass", "lateral", fo.FS_CG_LATERAL, 0.001, 3.0, 3.0, least=0.25),
    _form("cg_vertical", "mass", "vertical", fo.FS_CG_VERTICAL, 0.001, 4.0, 2.0, least=0.25),
    _form("inertia", "mass", "inertia", fo.FS_INERTIA, 1.5, 3.0, 0.6, least=0.085),
    _form("current", "environment", "water", (fo.FS_CURRENT_N, fo.FS_CURRENT_E), 0.08, 3.0, by_mocap=True),
    _form("current_shear", "environment", "water", (fo.FS_SHEAR_N, fo.FS_SHEAR_E), 0.06, 3.0, by_mocap=True),
    _form("waves", "environment", "water", fo.FS_WAVES, 1.0, 6.0, scatter=True),
    _form("turbulence", "environment", "water", fo.FS_TURBULENCE, 6.0, 4.0, scatter=True),
    _form("imu_pitch_bias", "sensing", "attitude", fo.FS_IMU_PITCH, 0.06, 2.5, 2.5, least=0.217),
    _form("imu_roll_bias", "sensing", "attitude", fo.FS_IMU_ROLL, 0.08, 2.5, 2.5, least=0.1625),
    _form("attitude_scale", "sensing", "attitude", fo.FS_PITCH_SCALE, 0.2, 3.0, 3.0),
    _form("compass", "sensing", "attitude", (fo.FS_COMPASS_1, fo.FS_COMPASS_2), 0.15, 3.0),
    _form("attitude_lag", "sensing", "attitude", fo.FS_ATTITUDE_LAG, 0.4, 5.0),
    _form("gyro_scale", "sensing", "gyro", fo.FS_GYRO_SCALE, 0.3, 5.0, 2.8),
    _form("gyro_bias", "sensing", "gyro", (fo.FS_GYRO_P, fo.FS_GYRO_Q, fo.FS_GYRO_R), 0.02, 6.0, least=0.075),
    _form("depth_offset", "sensing", "depth", fo.FS_DEPTH_OFFSET, 0.15, 3.0, 3.0, by_mocap=True, least=0.17),
    _form("depth_scale", "sensing", "depth", fo.FS_DEPTH_SCALE, 0.1, 4.0, 4.0),
    _form("depth_lag", "sensing", "depth", fo.FS_DEPTH_LAG, 0.6, 6.0),
    _form("pressure_lever", "sensing", "depth", fo.FS_LEVER, 0.15, 3.5, 3.5),
    _form("command_delay", "timing", "command", fo.FS_COMMAND_DELAY, 0.8, 3.0),
    _form("mocap_delay", "timing", "mocap", fo.FS_MOCAP_DELAY, 0.5, 4.0, by_mocap=True),
    _form("clock_skew", "timing", "mocap", fo.FS_CLOCK_SKEW, 0.01, 3.0, 3.0, by_mocap=True),
)

# Outside the catalogue. Two places where the effect acts in both.
SECRET = (
    _form("x_flapping_tail", "hydrodynamics", "pitch", fo.FS_FLAP, 1.0, 8.0),
    Form("x_pump_jet", (("actuation", "ballast"), ("hydrodynamics", "surge")), (fo.FS_PUMP_JET,), (0.4,), 5.0, 1.5),
    Form("x_fouling", (("hydrodynamics", "surge"), ("hydrodynamics", "heave")), (fo.FS_FOULING,), (0.8,), 3.0),
    _form("x_roll_pitch", "hydrodynamics", "pitch", fo.FS_ROLL_PITCH, 0.5, 4.0, 4.0),
    Form("x_entanglement", (("hydrodynamics", "surge"), ("hydrodynamics", "yaw")), (fo.FS_TANGLE,), (3.0,), 4.0),
    _form("x_lagging_lift", "hydrodynamics", "heave", fo.FS_LIFT_LAG, 0.6, 1.5),
    _form("x_gyro_depth", "sensing", "gyro", fo.FS_GYRO_DEPTH, 0.004, 5.0, 5.0),
    _form("x_wire_drift", "actuation", "slider", fo.FS_WIRE_DRIFT, 0.005, 4.0, 4.0),
    _form("x_roll_pull", "sensing", "attitude", fo.FS_ROLL_PULL, 0.15, 4.0, 4.0),
)

FORMS = {form.label: form for form in (*KNOWN, *SECRET)}


def blank() -> np.ndarray:
    """F (N_FS,) without an effect; shapes at plain values, so that no kernel divides by zero."""
    F = np.zeros(fo.N_FS)
    F[fo.FS_EXPONENT] = 2.0
    F[fo.FS_LEAK_TIME] = F[fo.FS_DEPTH_SCALE_M] = F[fo.FS_LAYER_WIDTH] = F[fo.FS_GUST_TIME] = F[fo.FS_FLAP_OMEGA] = 1.0
    F[fo.FS_DRIFT_TIME], F[fo.FS_SKEW_TIME], F[fo.FS_LIFT_TIME] = 100.0, 1e9, 1.0
    F[fo.FS_SHELL_TIME] = F[fo.FS_LOOSE_TIME] = 1.0
    return F


def draw_shapes(rng: np.random.Generator, seconds: float, depths: tuple[float, float]) -> np.ndarray:
    """F without an effect but with the shapes that effects of this case would have; depths (m): of its flights."""
    F, (shallow, deep) = blank(), depths
    F[fo.FS_EXPONENT] = rng.choice([1.8, 1.85, 2.15])
    F[fo.FS_LEAK_START], F[fo.FS_LEAK_TIME] = rng.uniform(5.0, 15.0), rng.uniform(0.4, 0.8) * seconds
    F[fo.FS_TRAPPED_AIR], F[fo.FS_DEPTH_SCALE_M] = float(rng.random() < 0.5), rng.uniform(0.5, 1.0) * deep
    F[fo.FS_LAYER_DEPTH] = rng.uniform(0.4, 0.6) * (shallow + deep)
    F[fo.FS_LAYER_WIDTH] = rng.uniform(0.3, 0.5) * (deep - shallow)
    F[fo.FS_COMPASS_PHASE_1], F[fo.FS_COMPASS_PHASE_2] = rng.uniform(0.0, 2.0 * np.pi, 2)
    F[fo.FS_GUST_TIME], F[fo.FS_JITTER] = rng.uniform(0.3, 1.0), rng.uniform(0.1, 0.25)
    F[fo.FS_SKEW_STEP], F[fo.FS_SKEW_TIME] = rng.uniform(3.0, 8.0), rng.uniform(0.3, 0.7) * seconds
    F[fo.FS_DRIFT_TIME], F[fo.FS_DRIFT_PHASE] = rng.uniform(1.0, 2.0) * seconds, rng.uniform(0.0, 2.0 * np.pi)
    F[fo.FS_FLAP_OMEGA], F[fo.FS_FLAP_ZETA] = rng.uniform(1.5, 3.0), rng.uniform(0.04, 0.1)
    F[fo.FS_FOUL_TIME], F[fo.FS_LIFT_TIME] = rng.uniform(0.35, 0.6) * seconds, rng.uniform(2.0, 4.0)
    return F


def draw_waves(rng: np.random.Generator) -> np.ndarray:
    """A narrow sea of five components about one period and direction, (5, N_W); phases are the run's own."""
    period, direction = rng.uniform(3.0, 7.0), rng.uniform(0.0, 2.0 * np.pi)
    waves = np.zeros((5, fo.N_FW))
    for row in waves:
        omega = 2.0 * np.pi / period * rng.uniform(0.85, 1.15)
        toward, k = direction + 0.3 * rng.standard_normal(), omega * omega / GRAVITY
        row[:] = 0.04 * rng.uniform(0.6, 1.0), omega, k * np.cos(toward), k * np.sin(toward), 0.0
    return waves
