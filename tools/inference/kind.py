"""A kind of vehicle, as the observer is built for it: its layouts, readings, inputs, numbers and compiled functions.

Recordings, problems, filters and predictions take all of it from here; docs/how-to/adding.md, A vehicle kind.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field

import numpy as np

from glider.firmware.core.layouts import estimator_layout as kf
from glider.firmware.core.maths.rotations import quaternion_from_euler
from glider.firmware.core.vehicle.layout import X_BALLAST, X_DOWN, X_EAST, X_NORTH, X_NU, X_QUAT, X_SLIDER
from glider.firmware.model.estimator_settings import UNSEEN_SERVO_WALK
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.base import Effect
from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.run import Run
from glider.tools.inference.channels import ROUGHIE_MEASURES, Measures
from glider.tools.inference.core.error_layout import E_ACT, E_NU, N_ERR, N_PATH, N_SPECTRAL, Q_ACC, Q_ACT
from glider.tools.inference.core.filter import filter_runs, follow_runs
from glider.tools.inference.core.flight import fly_followed, fly_windows, read_rows, simulate_runs
from glider.tools.inference.core.model_error import MODEL_ERROR_SD
from glider.tools.inference.hyperparameters import DIAGNOSIS, WATCH


@dataclass(frozen=True)
class Reading:
    """A value that the model reads at every row, in the order of y."""

    name: str
    column: str  # in which it is recorded
    source: str  # its table in [sensors]
    bias: int = -1  # the entry of F with its constant error; -1: none is allowed


@dataclass(frozen=True)
class Input:
    """What drives the model: a command, or where none was recorded the speed of what was seen moving."""

    command: str  # column
    driven: int  # what the mode has more where it is not commanded
    position: str | None = None  # column of what was seen moving; None: nothing sees it
    reading: int = -1  # its place in y
    unseen: tuple[float, float] | None = None  # where it is neither: spread, and spectral density of its walk


def _none(seen: Collection[str]) -> tuple[str, ...]:
    """No labels."""
    return ()


@dataclass(frozen=True)
class Kind:
    """Numbers in SI, spreads 1 sigma, walks as spectral densities (per s)."""

    name: str
    measures: Measures
    catalogue: Callable[[], Mapping[str, Effect]]  # effects by label
    readings: tuple[Reading, ...]
    inputs: tuple[Input, ...]  # none where `input_table` makes them
    doubled: tuple[tuple[int, int], ...]  # readings that motion capture has too, and its own
    n_state: int
    n_error: int
    n_spectral: int
    n_path: int
    speed: int  # state that has no reading: several first values are tried
    speed_errors: slice  # the errors that go with it
    actuator_errors: slice
    accelerations: slice  # of the spectral densities
    actuator_walks: slice
    disturbance: tuple[str, ...]  # entries of [disturbance], of each acceleration, held `hold` s
    hold: float
    walks: tuple[float, ...]  # of actuators, which go as the model says
    inflated_walks: tuple[
        float, ...
    ]  # times the process-noise scale squared, of filters that are not to trust the model
    first_state: Callable[[np.ndarray], np.ndarray]  # by the first readings (prediction columns)
    spread: tuple[float, ...]  # (n_error,) about it
    speeds: tuple[float, ...]  # tried
    window_speeds: tuple[float, ...]  # tried by the filter that finds where windows start
    window_speed_spread: tuple[float, ...]
    model_error_sd: tuple[float, ...]  # of what the model lacks
    drift: tuple[float, ...]
    filter_runs: Callable[..., None]
    follow_runs: Callable[..., None]
    fly_windows: Callable[..., None]
    fly_followed: Callable[..., None]
    read_rows: Callable[..., None]
    simulate_runs: Callable[..., None]
    input_table: Callable[[Run], np.ndarray] | None = None  # (rows, inputs) of a kind whose inputs are measured
    # t (rows,) s, runs' bounds (runs + 1,), inputs: (rows, N_Y) bool, the readings that the observer does not look at
    unread: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray] | None = None
    # of what an effect explains, by which another may explain less and still be it: a law of drag is not nature's
    form_share: float = 0.0
    one_group: Callable[[Collection[str]], tuple[str, ...]] = _none  # labels that these readings never tell apart
    odds: Mapping[str, float] = field(default_factory=dict)  # of labels that are seldom the cause: nat
    regime: Callable[[Run], np.ndarray] | None = None  # how a run was flown, in what makes a difference to the model
    # of a size, 1 sigma: nature's form is not the catalogue's (docs/explanation/watch.md)
    form: float = WATCH.form_error
    # of the first, from which a watch without a reference learns what all share
    learned_runs: int = WATCH.reference_runs
    material_growth: float = DIAGNOSIS.material  # the same of what grows slowly
    material: float = (
        DIAGNOSIS.material  # tolerances: what moves no channel of any window so far is no gap (docs/reference/gap.md)
    )


def _first_state(first: np.ndarray) -> np.ndarray:
    """State (N_XF,) under way and without rates, at the first readings; the servo at rest."""
    x = np.zeros(ef.N_XF)
    x[X_NORTH], x[X_EAST], x[X_DOWN] = first[ef.Y_MOCAP_X], first[ef.Y_MOCAP_Y], first[ef.Y_DEPTH]
    x[X_QUAT:X_NU] = quaternion_from_euler(*first[ef.Y_ROLL : ef.Y_YAW + 1])
    x[X_NU] = 0.2
    x[X_SLIDER], x[X_BALLAST] = first[ef.Y_SLIDER], first[ef.Y_BALLAST]
    x[ef.X_GEAR_SLIDER] = x[X_SLIDER]
    return x


_ANGLES = ("roll", "pitch", "yaw")
_READINGS = tuple(
    Reading(name, column, source, ef.BIAS + n if n < ef.N_BIASES else -1)
    for n, (name, column, source) in enumerate(
        (
            *((x, y, "attitude") for x, y in zip(_ANGLES, names.ATTITUDE, strict=True)),
            *((x, y, "gyro") for x, y in zip("pqr", names.RATES, strict=True)),
            ("depth", names.DEPTH, "depth"),
            *((x, y, x) for x, y in zip(("slider", "ballast"), names.DRAW_WIRES, strict=True)),
            *((f"mocap {x}", y, "mocap_position") for x, y in zip("xyz", names.MOCAP_POSITION, strict=True)),
            *((f"mocap {x}", y, "mocap_attitude") for x, y in zip(_ANGLES, names.MOCAP_ATTITUDE, strict=True)),
        )
    )
)

# Recordings begin at rest, at a launch or within a glide. One linearisation does not reach from one to the other, so
# forward speeds are tried one by one.
ROUGHIE = Kind(
    name="roughie",
    measures=ROUGHIE_MEASURES,
    catalogue=catalogue,
    readings=_READINGS,
    inputs=(
        Input(names.COMMANDS[0], kf.SERVO_DRIVEN, unseen=(0.3, UNSEEN_SERVO_WALK**2)),
        Input(names.COMMANDS[1], kf.SLIDER_DRIVEN, names.DRAW_WIRES[0], ef.Y_SLIDER),
        Input(names.COMMANDS[2], kf.BALLAST_DRIVEN, names.DRAW_WIRES[1], ef.Y_BALLAST),
    ),
    doubled=(
        (ef.Y_ROLL, ef.Y_MOCAP_ROLL), (ef.Y_PITCH, ef.Y_MOCAP_PITCH), (ef.Y_YAW, ef.Y_MOCAP_YAW),
        (ef.Y_DEPTH, ef.Y_MOCAP_Z),
    ),
    n_state=ef.N_XF,
    n_error=N_ERR,
    n_spectral=N_SPECTRAL,
    n_path=N_PATH,
    speed=X_NU,
    speed_errors=slice(E_NU, E_NU + 3),
    actuator_errors=slice(E_ACT, E_ACT + 3),
    accelerations=slice(Q_ACC, Q_ACC + 6),
    actuator_walks=slice(Q_ACT, Q_ACT + 3),
    disturbance=(*3 * ("linear",), *3 * ("angular",)),
    hold=kf.DISTURBANCE_HOLD,
    walks=(1e-8, 1e-12, 1e-12),
    inflated_walks=(1e-6, 4e-10, 2.5e-9),
    first_state=_first_state,
    # m, rad, m/s, rad/s about readings; rad, m, kg where commanded: they begin at 0 and at the draw-wires
    spread=(*3 * (0.05,), *3 * (0.05,), 0.1, 0.03, 0.03, *3 * (0.05,), 1e-4, 3e-4, 5e-4, 0.0),
    speeds=(0.03, 0.2, 0.4),  # m/s
    window_speeds=(0.0, 0.1, 0.2, 0.3, 0.45, 0.6),
    window_speed_spread=(0.05, 0.02, 0.02),
    model_error_sd=MODEL_ERROR_SD,
    drift=(10.0, 0.0005**2, 0.005**2),  # s, (rad/s)2/s, (m/s)2/s
    filter_runs=filter_runs,
    follow_runs=follow_runs,
    fly_windows=fly_windows,
    fly_followed=fly_followed,
    read_rows=read_rows,
    simulate_runs=simulate_runs,
)  # fmt: skip
