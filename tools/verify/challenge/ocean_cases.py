"""One mission of a blind test of ocean gliders: drawn, flown by the foreign glider, read by its sensors, written."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from glider.sim_backend.foreign import ocean as at
from glider.sim_backend.ocean.vehicle import OceanVehicle, decode_ocean_vehicle, shipped_vehicles
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import write_case
from glider.tools.data.runs.run import Run
from glider.tools.verify.challenge.cases import NoCase
from glider.tools.verify.challenge.ocean_design import CRAFTS, SPEED_NOISE, MissionDesign, draw_mission
from glider.tools.verify.challenge.ocean_plan import OUTSIDE_CHANGES, MissionPlan
from glider.tools.verify.challenge.watch_plan import CHANGED, GROWING, OUTSIDE, UNCHANGED, WatchCounts

# Sizes of a change at its full strength, drawn uniformly, in the unit of the catalogue's parameter.
SIZES = {
    "drag": (0.1, 0.6), "attitude_scale": (0.05, 0.15), "net_buoyancy": (0.03, 0.15), "density_bias": (0.3, 1.5),
    "lift": (0.2, 0.5),
    # outside the catalogue, in the unit of what they set in the glider: N, N a metre, of AREA, kg
    "x_thruster": (0.2, 0.8), "x_line": (2e-4, 2e-3), "x_fouled_wing": (0.05, 0.2), "x_mud": (0.05, 0.2),
}  # fmt: skip
EITHER_WAY = ("attitude_scale", "net_buoyancy", "density_bias", "x_fouled_wing")
WING_DRAG = 0.1  # of the camber's size: drag of grown-over wings that goes with the speed
# What moves each label that an answer may give by a small size, to ask what it leaves of a change that no label names.
LABEL_STEPS = {
    "drag": (at.DRAG, 0.01), "climb_dive_asymmetry": (at.CLIMB_DRAG, 0.01), "lift": (at.LIFT, 0.05),
    "net_buoyancy": (at.MASS, 0.005), "ballast_scale": (at.OIL_SCALE, 0.01), "compressibility": (at.COMPRESSION, 1e-11),
    "thermal_expansion": (at.EXPANSION, 2e-6), "imu_pitch_bias": (at.PITCH_OFFSET, 0.003),
    "attitude_scale": (at.PITCH_SCALE, 0.01),
}  # fmt: skip
# What no observer could place is no case: a first run two dives off is preferred to the true one in some 2 of 100
# missions where a dive has 4 nat (a normal deviate beyond 2), in 8 where it has 2. All together: as in evidence.py.
DIVE_NAT, ALL_NAT = 4.0, 20.0
# m/s by which a change moves the depth rate: less is none by definition, and a growth that stays below what a quiet
# flight is known to is the fouling of any mission (docs/explanation/ocean.md, Windows)
MATERIAL_SPEED, MATERIAL_GROWTH = 0.005, 0.01
SIZE_TRIES, TRIES = 12, 500
LEAST_SINK_SPEED, MIDDLE_DEPTH_SHARE = (
    0.04,
    0.45,
)  # m/s, share of the depth about its middle: a dive that sinks slower there is none
STALLED = 0.12  # rad, angle of attack: with too little lift for its pitch a glider has no glide at all, and falls
FLATTER = 0.015  # rad: the pitch wanders
LEAST_STRANGE = 0.1  # of the squares that a change moves: with less left it acts as a label does
NEAREST, NEWTON, STEP_SHARES = 3, 4, (1.0, 0.4, 0.1)  # labels that are fitted, with so many steps, whole or in part
DEPTHS = 200  # at which the ways of two dives are compared
TRUTH_EVERY = 60.0  # s, at which true speeds are kept
PITCH_NOISE, ROLL_NOISE, YAW_NOISE, DENSITY_NOISE, TEMPERATURE_NOISE, OIL_NOISE = 0.001, 0.003, 0.01, 0.004, 0.002, 1e-7
LOST = 0.003  # of the samples of the water
DECIMALS = {
    names.TIME: 2, names.DEPTH: 3, names.OIL: 8, names.DENSITY: 4, names.TEMPERATURE: 4, names.PUMP: 0, names.SPEED: 4,
} | dict.fromkeys(names.ATTITUDE, 5)  # fmt: skip


@dataclass
class MadeMission:
    """A mission ready to be written."""

    plan: MissionPlan
    mission: MissionDesign
    size: float  # of the change at its full strength, 0 for none
    nat: float  # of evidence in a dive at full strength
    runs: list[Run]  # reference first
    truth: list[np.ndarray]  # horizontal speed through the water every TRUTH_EVERY s, m/s


def shipped_vehicle(name: str) -> OceanVehicle:
    """A shipped ocean glider's file."""
    return decode_ocean_vehicle(shipped_vehicles()[name], name)


OUTSIDE_PLACES = {"x_thruster": at.THRUST, "x_line": at.PULL, "x_mud": at.MUD}


def with_change(V: np.ndarray, label: str, size: float) -> np.ndarray:
    """The vehicle (N_V,) changed by a label at a size in the catalogue's unit."""
    V = V.copy()
    if label == "drag":
        V[at.DRAG] *= 1.0 + size
    elif label == "lift":
        V[at.LIFT] *= 1.0 + size
    elif label == "attitude_scale":
        V[at.PITCH_SCALE] += size
    elif label == "net_buoyancy":  # a volume that is lost, not a mass that is gained
        V[at.VOLUME] *= 1.0 - size / V[at.MASS]
    elif label == "density_bias":
        V[at.DENSITY_BIAS] += size
    elif label == "x_fouled_wing":
        V[at.CAMBER] += size
        V[at.WING_DRAG] += WING_DRAG * abs(size)
    elif label in OUTSIDE_PLACES:
        V[OUTSIDE_PLACES[label]] += size
    else:
        raise ValueError(f"no change of an ocean glider: {label!r}")
    return V


def flown(mission: MissionDesign, dive: int, V: np.ndarray, S: np.ndarray, D: np.ndarray | None = None) -> np.ndarray:
    """Rows (rows, N_R) of a dive without noise, D in place of what its pilot asks for."""
    out = at.room()
    asked = mission.dives[dive] if D is None else D
    count = at.fly_dive(V, asked, S, np.uint64(mission.seed + dive), out)
    return out[:count].copy()


def legs(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the way down and of the way up."""
    deepest = int(rows[:, at.R_DEPTH].argmax())
    return rows[: deepest + 1], rows[deepest:]


def flies(mission: MissionDesign) -> bool:
    """Whether a dive as flat as the flattest goes down and comes up again, at a speed, and gliding."""
    D, depth = mission.dives[0].copy(), mission.dives[0][at.DEPTH]
    D[at.PITCH_DOWN] = max(dive[at.PITCH_DOWN] for dive in mission.dives) + FLATTER
    D[at.PITCH_UP] = min(dive[at.PITCH_UP] for dive in mission.dives) - FLATTER
    rows = flown(mission, 0, mission.V, mission.calm(0), D)
    if rows[-1, at.R_DEPTH] > 5.0 or rows[:, at.R_DEPTH].max() < depth:
        return False
    for leg in legs(rows):
        near = np.abs(leg[:, at.R_DEPTH] - 0.5 * depth) < MIDDLE_DEPTH_SHARE * depth
        rate = np.abs(np.gradient(leg[:, at.R_DEPTH], leg[:, at.R_TIME]))[near]
        pitch = (leg[near, at.R_PITCH] - mission.V[at.PITCH_OFFSET]) / mission.V[at.PITCH_SCALE]
        path = np.arccos(np.minimum(leg[near, at.R_HORIZONTAL] / leg[near, at.R_SPEED], 1.0))
        if len(rate) < 5 or np.percentile(rate, 5) < LEAST_SINK_SPEED or np.median(path - np.abs(pitch)) > STALLED:
            return False
    return True


@dataclass
class Course:
    """The depth rate of a calm dive at depths alike in every dive of a mission, (2 DEPTHS,) of both ways."""

    rate: np.ndarray  # m/s
    density: np.ndarray  # kg/m3, as it is read
    step: float  # m


def course_of(mission: MissionDesign, V: np.ndarray) -> Course:
    """The first dive's, flown by a vehicle in a sea without motion."""
    depths = np.linspace(0.15, 0.9, DEPTHS) * mission.dives[0][at.DEPTH]
    rates, densities = [], []
    for leg in legs(flown(mission, 0, V, mission.calm(0))):
        z, rate = leg[:, at.R_DEPTH], np.abs(np.gradient(leg[:, at.R_DEPTH], leg[:, at.R_TIME]))
        order = np.argsort(z)
        rates.append(np.maximum(np.interp(depths, z[order], rate[order]), 1e-3))
        densities.append(np.interp(depths, z[order], leg[order, at.R_DENSITY]))
    return Course(np.concatenate(rates), np.concatenate(densities), float(depths[1] - depths[0]))


def shown(mission: MissionDesign, label: str, size: float) -> tuple[float, float]:
    """How a change shows in a dive: by evidence, nat, and by how it moves the depth rate, rms, m/s.

    Evidence is that of the depth rate over the water's density at 0 Hz: a mean over T of water that has size s and
    decorrelates in tau varies by 2 s2 tau / T. What makes the readings of the water wrong shows as the weight that it
    pretends. Of a change that no label names only that shows which the nearest label leaves, whatever its size, and
    nothing where that is less than nature's form and a label's differ by anyhow.
    """
    bare, heavier = course_of(mission, mission.V), mission.V.copy()
    heavier[at.MASS] += 0.01
    by_mass = (course_of(mission, heavier).rate - bare.rate) / 0.01
    other = course_of(mission, with_change(mission.V, label, size))
    moved = other.rate - bare.rate + (other.density - bare.density) * mission.V[at.VOLUME] * by_mass
    seconds = bare.step / bare.rate
    whole = total = float(moved**2 @ seconds)
    if label in OUTSIDE_CHANGES:
        total = float(left_by_labels(mission, bare, moved, seconds) ** 2 @ seconds)
    if total < LEAST_STRANGE * whole:
        return 0.0, 0.0
    water, time = mission.seas[0][at.WATER], mission.seas[0][at.WATER_TIME]
    return 0.5 * total / (2.0 * water**2 * time), float(np.sqrt(total / float(seconds.sum())))


def left_by_labels(mission: MissionDesign, bare: Course, moved: np.ndarray, seconds: np.ndarray) -> np.ndarray:
    """What is left of moved depth rates (2 DEPTHS,) by the label that comes nearest to them, at its best size."""

    def course(label: str, size: float) -> np.ndarray:
        V = mission.V.copy()
        V[LABEL_STEPS[label][0]] += size
        return course_of(mission, V).rate - bare.rate

    def left_by(label: str, steps: int) -> np.ndarray:
        step, size, left = LABEL_STEPS[label][1], 0.0, moved
        for _ in range(steps):  # Gauss and Newton's, the largest share of a step that leaves less
            column = (course(label, size + step) - (moved - left)) / step
            better = float(column * seconds @ left) / max(float(column**2 @ seconds), 1e-18)
            for share in STEP_SHARES:
                tried = moved - course(label, size + share * better)
                if float(tried**2 @ seconds) < float(left**2 @ seconds):
                    size, left = size + share * better, tried
                    break
        return left

    def squares(label: str) -> float:
        return float(left_by(label, 1) ** 2 @ seconds)

    nearest = sorted(LABEL_STEPS, key=squares)[:NEAREST]
    return min((left_by(label, NEWTON) for label in nearest), key=lambda one: float(one**2 @ seconds))


def draw_size(
    rng: np.random.Generator, mission: MissionDesign, plan: MissionPlan, judged: int
) -> tuple[float, float] | None:
    """A size that shows, with its evidence in a dive; None where none does."""
    assert plan.label is not None
    strengths = plan.strengths(judged)
    for _ in range(SIZE_TRIES):
        size = float(rng.uniform(*SIZES[plan.label]))
        if plan.label == "lift" or (plan.label in EITHER_WAY and rng.random() < 0.5):
            size = -size
        if not flies(mission.changed(with_change(mission.V, plan.label, size))):
            continue
        nat, moved = shown(mission, plan.label, size)
        material = moved >= (MATERIAL_GROWTH if plan.course == GROWING else MATERIAL_SPEED)
        if material and nat >= DIVE_NAT and nat * float(np.sum(strengths**2)) >= ALL_NAT:
            return size, nat
    return None


def as_run(mission: MissionDesign, dive: int, rows: np.ndarray, speed: bool) -> Run:
    """What is logged of a dive."""
    rng = np.random.default_rng(np.random.SeedSequence([mission.seed, dive, 5]))
    count, (depth_step, oil_step, angle_step) = len(rows), mission.vehicle_class.steps

    def noisy(place: int, noise: float, step: float = 0.0) -> np.ndarray:
        values = rows[:, place] + noise * rng.standard_normal(count)
        return np.round(values / step) * step if step > 0.0 else values

    yaw = noisy(at.R_YAW, YAW_NOISE, angle_step)
    columns = {
        names.TIME: rows[:, at.R_TIME] - rows[0, at.R_TIME],
        names.ATTITUDE[0]: noisy(at.R_ROLL, ROLL_NOISE, angle_step),
        names.ATTITUDE[1]: noisy(at.R_PITCH, PITCH_NOISE, angle_step),
        names.ATTITUDE[2]: np.angle(np.exp(1j * yaw)),
        names.DEPTH: noisy(at.R_DEPTH, mission.vehicle_class.depth_noise, depth_step),
        names.OIL: noisy(at.R_OIL, OIL_NOISE, oil_step),
        names.DENSITY: noisy(at.R_DENSITY, DENSITY_NOISE),
        names.TEMPERATURE: noisy(at.R_TEMPERATURE, TEMPERATURE_NOISE),
        names.PUMP: rows[:, at.R_PUMP].copy(),
    }
    lost = rng.random(count) < LOST
    columns[names.DENSITY][lost] = columns[names.TEMPERATURE][lost] = np.nan
    if speed:
        columns[names.SPEED] = np.maximum(noisy(at.R_SPEED, SPEED_NOISE) + mission.speed_bias, 0.0)
    return Run(f"run{dive:02d}", None, columns)


def fly_mission(
    mission: MissionDesign, changes: list[tuple[str | None, float]], speed: bool
) -> tuple[list[Run], list[np.ndarray]]:
    """Every dive's run and true horizontal speeds; changes: label and size of each dive."""
    runs, truth = [], []
    for dive, (label, size) in enumerate(changes):
        V = mission.V if label is None or size == 0.0 else with_change(mission.V, label, size)
        rows = flown(mission, dive, V, mission.seas[dive])
        runs.append(as_run(mission, dive, rows, speed))
        at_times = np.arange(0.0, rows[-1, at.R_TIME], TRUTH_EVERY)
        truth.append(np.interp(at_times, rows[:, at.R_TIME], rows[:, at.R_HORIZONTAL]))
    return runs, truth


def draw_case(seed: int, plan: MissionPlan, counts: WatchCounts) -> MadeMission:
    """Draw until the mission flies and the change shows; NoCase where it never does."""
    vehicle = shipped_vehicle(plan.vehicle_class)
    for number in range(TRIES):
        rng = np.random.default_rng(np.random.SeedSequence([seed, 2001 + plan.number, number]))
        mission = draw_mission(rng, CRAFTS[plan.vehicle_class], vehicle, counts.runs)
        if not flies(mission):
            continue
        size, nat = 0.0, 0.0
        if plan.label is not None:
            found = draw_size(rng, mission, plan, counts.judged)
            if found is None:
                continue
            size, nat = found
        strengths = np.concatenate([np.zeros(counts.reference), plan.strengths(counts.judged)])
        changes = [(plan.label, size * float(strength)) for strength in strengths]
        runs, truth = fly_mission(mission, changes, plan.speed)
        return MadeMission(plan, mission, size, nat, runs, truth)
    raise NoCase(f"{plan.name}: {plan.label} cannot be seen in {TRIES} drawn missions")


def mission_answer(made: MadeMission, counts: WatchCounts) -> dict[str, Any]:
    """The truth: what changed, from which dive to which, how large; the true speeds of the watched dives, mm/s."""
    plan = made.plan
    outside = plan.kind == OUTSIDE
    return {
        "case": plan.name, "kind": plan.kind, "label": None if outside else plan.label,
        "secret": plan.label if outside else None, "course": plan.course,
        "from_run": plan.first, "to_run": plan.last, "strengths": plan.strengths(counts.judged).tolist(),
        "values": [] if plan.label is None else [made.size], "runs": counts.judged, "speed": plan.speed,
        "craft": plan.vehicle_class, "same_unit": True, "nat": made.nat, "water": float(made.mission.seas[0][at.WATER]),
        "water_time": float(made.mission.seas[0][at.WATER_TIME]), "every_s": TRUTH_EVERY,
        "horizontal_mm_s": [np.round(1000.0 * one).astype(int).tolist() for one in made.truth[counts.reference :]],
    }  # fmt: skip


def write_dives(folder: Path, vehicle_class: str, runs: list[Run]) -> None:
    """Dives as a case of the shipped vehicle."""
    density = float(np.nanmean(np.concatenate([run.columns[names.DENSITY] for run in runs])))
    step = float(np.median(np.concatenate([np.diff(run.t) for run in runs])))
    write_case(
        folder, runs, vehicle=vehicle_class, site="ocean", log_rate_hz=round(1.0 / step, 5),
        water_density_kg_m3=round(density, 2), motion_capture=False, suffix=".csv.gz", decimals=DECIMALS,
    )  # fmt: skip


def example_mission(
    folder: Path,
    vehicle_class: str = "slocum",
    dives: int = 6,
    seed: int = 1,
    change: tuple[str, float, int] | None = None,
    speed: bool = False,
) -> None:
    """A short mission as a case, for a walk or a test. change: label, size, and the dive from which on it is there."""
    label, size, first = change or (None, 0.0, dives)
    plan = MissionPlan(0, UNCHANGED if label is None else CHANGED, None, None, None, None, False, vehicle_class, speed)
    made = draw_case(seed, plan, WatchCounts(1, 1, dives, 0))
    runs, _ = fly_mission(made.mission, [(label, size if n >= first else 0.0) for n in range(dives)], speed)
    write_dives(folder, vehicle_class, runs)
