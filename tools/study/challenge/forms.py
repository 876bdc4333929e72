"""What may be wrong in a blind case: every label of the catalogue in its foreign form, and effects that no label names.

A form fills the foreign plant's vector F (foreign_layout): `strength` 0 is no effect, 1 a plain one.
"""

from dataclasses import dataclass

import numpy as np

from sim_backend.foreign import foreign_layout as fo

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
    _form("servo_slow", "actuation", "servo", fo.SERVO_SLOW, 1.0, 8.0),
    _form("servo_backlash", "actuation", "servo", fo.SERVO_BACKLASH, 0.15, 3.0),
    _form("servo_offset", "actuation", "servo", fo.SERVO_OFFSET, 0.25, 2.0, 2.0),
    _form("servo_limit", "actuation", "servo", fo.SERVO_LIMIT, 1.2, 3.5),
    _form("slider_slow", "actuation", "slider", fo.SLIDER_SLOW, 1.0, 8.0),
    _form("slider_backlash", "actuation", "slider", fo.SLIDER_BACKLASH, 0.004, 3.0),
    _form("pump_slow", "actuation", "ballast", fo.PUMP_SLOW, 1.0, 3.0),
    _form("pump_droop", "actuation", "ballast", fo.PUMP_DROOP, 0.3, 10.0),
    _form("ballast_leak", "actuation", "ballast", fo.BALLAST_LEAK, 0.05, 1.5),
    _form("drag", "hydrodynamics", "surge", fo.DRAG, 0.6, 4.0, 1.1, least=0.25),
    _form("linear_drag", "hydrodynamics", "surge", fo.LINEAR_DRAG, 0.6, 4.0),
    _form("climb_dive_asymmetry", "hydrodynamics", "surge", fo.ASYMMETRY, 0.4, 1.8, 1.8),
    _form("tether", "hydrodynamics", "surge", fo.TETHER, 0.3, 4.0),
    _form("lift", "hydrodynamics", "heave", fo.LIFT, 0.4, 3.0, 1.6, least=0.375),
    _form("stall", "hydrodynamics", "heave", fo.STALL, 8.0, 3.0),
    _form("added_mass", "hydrodynamics", "heave", fo.ADDED_MASS, 0.8, 4.0, 0.9, least=0.3125),
    _form("side_force", "hydrodynamics", "sway", fo.SIDE_FORCE, 0.8, 4.0, 1.1, least=0.1875),
    _form("roll_trim", "hydrodynamics", "roll", fo.ROLL_TRIM, 0.08, 4.0, 4.0),
    _form("pitch_trim", "hydrodynamics", "pitch", fo.PITCH_TRIM, 0.3, 2.0, 2.0),
    _form("pitch_damping", "hydrodynamics", "pitch", fo.PITCH_DAMPING, 1.0, 6.0, 0.8, least=0.15),
    _form("yaw_trim", "hydrodynamics", "yaw", fo.YAW_TRIM, 0.2, 3.0, 3.0),
    _form("weathercock", "hydrodynamics", "yaw", fo.WEATHERCOCK, 0.4, 3.0, 1.5, least=0.375),
    _form("yaw_damping", "hydrodynamics", "yaw", fo.YAW_DAMPING, 1.0, 6.0, 0.8, least=0.15),
    _form("net_buoyancy", "mass", "net", fo.NET_BUOYANCY, 0.04, 1.5, 1.5, least=0.125),
    _form("ballast_scale", "mass", "net", fo.BALLAST_SCALE, 0.15, 1.5, 1.5),
    _form("compressibility", "mass", "net", fo.COMPRESSIBILITY, 0.06, 3.0),
    _form("stratification", "mass", "net", fo.STRATIFICATION, 0.06, 2.0),
    _form("cg_longitudinal", "mass", "longitudinal", fo.CG_LONGITUDINAL, 0.001, 3.0, 3.0, least=0.25),
    _form("slider_scale", "mass", "longitudinal", fo.SLIDER_SCALE, 0.3, 2.5, 2.5),
    _form("cg_lateral", "mass", "lateral", fo.CG_LATERAL, 0.001, 3.0, 3.0, least=0.25),
    _form("cg_vertical", "mass", "vertical", fo.CG_VERTICAL, 0.001, 4.0, 2.0, least=0.25),
    _form("inertia", "mass", "inertia", fo.INERTIA, 1.5, 3.0, 0.6, least=0.085),
    _form("current", "environment", "water", (fo.CURRENT_N, fo.CURRENT_E), 0.08, 3.0, by_mocap=True),
    _form("current_shear", "environment", "water", (fo.SHEAR_N, fo.SHEAR_E), 0.06, 3.0, by_mocap=True),
    _form("waves", "environment", "water", fo.WAVES, 1.0, 6.0, scatter=True),
    _form("turbulence", "environment", "water", fo.TURBULENCE, 6.0, 4.0, scatter=True),
    _form("imu_pitch_bias", "sensing", "attitude", fo.IMU_PITCH, 0.06, 2.5, 2.5, least=0.217),
    _form("imu_roll_bias", "sensing", "attitude", fo.IMU_ROLL, 0.08, 2.5, 2.5, least=0.1625),
    _form("compass", "sensing", "attitude", (fo.COMPASS_1, fo.COMPASS_2), 0.15, 3.0),
    _form("attitude_lag", "sensing", "attitude", fo.ATTITUDE_LAG, 0.4, 5.0),
    _form("gyro_scale", "sensing", "gyro", fo.GYRO_SCALE, 0.3, 5.0, 2.8),
    _form("gyro_bias", "sensing", "gyro", (fo.GYRO_P, fo.GYRO_Q, fo.GYRO_R), 0.02, 6.0, least=0.075),
    _form("depth_offset", "sensing", "depth", fo.DEPTH_OFFSET, 0.15, 3.0, 3.0, by_mocap=True, least=0.17),
    _form("depth_scale", "sensing", "depth", fo.DEPTH_SCALE, 0.1, 4.0, 4.0),
    _form("depth_lag", "sensing", "depth", fo.DEPTH_LAG, 0.6, 6.0),
    _form("pressure_lever", "sensing", "depth", fo.LEVER, 0.15, 3.5, 3.5),
    _form("command_delay", "timing", "command", fo.COMMAND_DELAY, 0.8, 3.0),
    _form("mocap_delay", "timing", "mocap", fo.MOCAP_DELAY, 0.5, 4.0, by_mocap=True),
    _form("clock_skew", "timing", "mocap", fo.CLOCK_SKEW, 0.01, 3.0, 3.0, by_mocap=True),
)

# Outside the catalogue. Two places where the effect acts in both.
SECRET = (
    _form("x_flapping_tail", "hydrodynamics", "pitch", fo.FLAP, 1.0, 8.0),
    Form("x_pump_jet", (("actuation", "ballast"), ("hydrodynamics", "surge")), (fo.PUMP_JET,), (0.4,), 5.0, 1.5),
    Form("x_fouling", (("hydrodynamics", "surge"), ("hydrodynamics", "heave")), (fo.FOULING,), (0.8,), 3.0),
    _form("x_roll_pitch", "hydrodynamics", "pitch", fo.ROLL_PITCH, 0.5, 4.0, 4.0),
    Form("x_entanglement", (("hydrodynamics", "surge"), ("hydrodynamics", "yaw")), (fo.TANGLE,), (3.0,), 4.0),
    _form("x_lagging_lift", "hydrodynamics", "heave", fo.LIFT_LAG, 0.6, 1.5),
    _form("x_gyro_depth", "sensing", "gyro", fo.GYRO_DEPTH, 0.004, 5.0, 5.0),
    _form("x_wire_drift", "actuation", "slider", fo.WIRE_DRIFT, 0.005, 4.0, 4.0),
    _form("x_roll_pull", "sensing", "attitude", fo.ROLL_PULL, 0.15, 4.0, 4.0),
)

FORMS = {form.label: form for form in (*KNOWN, *SECRET)}


def blank() -> np.ndarray:
    """F (N_F,) without an effect; shapes at plain values, so that no kernel divides by zero."""
    F = np.zeros(fo.N_F)
    F[fo.EXPONENT] = 2.0
    F[fo.LEAK_TIME] = F[fo.DEPTH_SCALE_M] = F[fo.LAYER_WIDTH] = F[fo.GUST_TIME] = F[fo.FLAP_OMEGA] = 1.0
    F[fo.DRIFT_TIME], F[fo.SKEW_TIME], F[fo.LIFT_TIME] = 100.0, 1e9, 1.0
    return F


def draw_shapes(rng: np.random.Generator, seconds: float, depths: tuple[float, float]) -> np.ndarray:
    """F without an effect but with the shapes that effects of this case would have; depths (m): of its flights."""
    F, (shallow, deep) = blank(), depths
    F[fo.EXPONENT] = rng.choice([1.8, 1.85, 2.15])
    F[fo.LEAK_START], F[fo.LEAK_TIME] = rng.uniform(5.0, 15.0), rng.uniform(0.4, 0.8) * seconds
    F[fo.TRAPPED_AIR], F[fo.DEPTH_SCALE_M] = float(rng.random() < 0.5), rng.uniform(0.5, 1.0) * deep
    F[fo.LAYER_DEPTH] = rng.uniform(0.4, 0.6) * (shallow + deep)
    F[fo.LAYER_WIDTH] = rng.uniform(0.3, 0.5) * (deep - shallow)
    F[fo.COMPASS_PHASE_1], F[fo.COMPASS_PHASE_2] = rng.uniform(0.0, 2.0 * np.pi, 2)
    F[fo.GUST_TIME], F[fo.JITTER] = rng.uniform(0.3, 1.0), rng.uniform(0.1, 0.25)
    F[fo.SKEW_STEP], F[fo.SKEW_TIME] = rng.uniform(3.0, 8.0), rng.uniform(0.3, 0.7) * seconds
    F[fo.DRIFT_TIME], F[fo.DRIFT_PHASE] = rng.uniform(1.0, 2.0) * seconds, rng.uniform(0.0, 2.0 * np.pi)
    F[fo.FLAP_OMEGA], F[fo.FLAP_ZETA] = rng.uniform(1.5, 3.0), rng.uniform(0.04, 0.1)
    F[fo.FOUL_TIME], F[fo.LIFT_TIME] = rng.uniform(0.35, 0.6) * seconds, rng.uniform(2.0, 4.0)
    return F


def draw_waves(rng: np.random.Generator) -> np.ndarray:
    """A narrow sea of five components about one period and direction, (5, N_W); phases are the run's own."""
    period, direction = rng.uniform(3.0, 7.0), rng.uniform(0.0, 2.0 * np.pi)
    waves = np.zeros((5, fo.N_W))
    for row in waves:
        omega = 2.0 * np.pi / period * rng.uniform(0.85, 1.15)
        toward, k = direction + 0.3 * rng.standard_normal(), omega * omega / 9.80665
        row[:] = 0.04 * rng.uniform(0.6, 1.0), omega, k * np.cos(toward), k * np.sin(toward), 0.0
    return waves
