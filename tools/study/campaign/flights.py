"""A chunk of flights: what a worker does, whatever started it. Single-threaded; the same numbers wherever it runs."""

import math
from dataclasses import dataclass

import numpy as np

from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.maths.wide import LANES
from glider.firmware.core.vehicle import layout
from glider.sim_backend.core import closed_loop
from glider.sim_backend.fleet import fly_group, groups_of
from glider.tools.data.errors import InputError
from glider.tools.study.campaign.fingerprint import fingerprint
from glider.tools.study.campaign.plan import CampaignPlan
from glider.tools.study.campaign.worlds import draw_world

# what is kept of each flight, one column each; SI
COLUMNS = (
    "mission", "controller", "seed",                                     # numbers within the campaign; the seed itself
    "current_m_s", "wave_height_m", "wave_period_s", "disturbance", "start_depth_m",
    "completed", "within_limits", "ended",                               # 0 or 1, 0 or 1, one of ENDINGS
    "leg", "seconds",
    "depth_error_m", "pitch_error_rad", "roll_error_rad",                # mean |measured - reference| while flying
    "servo_travel_rad", "slider_travel_m", "ballast_travel_kg",          # ways of the plant's actuators
    "deepest_m", "over_range", "over_rate",                              # true depth; share of the range, of the rate
    "worst_attitude_rad",                                                # most that true pitch or roll was off
)  # fmt: skip
ENDINGS = {
    ctl.REASON_NONE: "completed",
    ctl.REASON_LEG_TIME: "leg over its time limit",
    ctl.REASON_MISSION_TIME: "mission over its time limit",
    ctl.REASON_IMU: "no attitude",
    ctl.REASON_BEACON: "no depth",
    ctl.REASON_TOO_DEEP: "deeper than the site, by its own sensor",
    100.0: "deeper than the site, unseen",
    101.0: "a command past its limits",
    102.0: "no ending: still flying",
    103.0: "tumbled",
}
UNSEEN_DEPTH, PAST_LIMITS, STILL_FLYING, TUMBLED = 100.0, 101.0, 102.0, 103.0
TUMBLING = math.radians(60.0)  # off its reference in pitch or roll: a glide has been lost, even if depths are reached
MOST_LINES = 31_000  # of a flight's trace: every tick of a mission of 10 minutes at 50 Hz, fewer of a longer one
ROUNDING = 1e-9  # in a difference of two commands
CHUNK = 60  # flights
_checked: set[str] = set()  # fingerprints that this process has found to be its own


@dataclass(frozen=True)
class Chunk:
    """Flights that go together: some seeds of one mission, each with every controller."""

    number: int
    mission: int
    first_seed: int
    seeds: int


@dataclass(frozen=True)
class FlightJob:
    """What goes to a worker, once: the plan, and the fingerprint that the worker must find too."""

    plan: CampaignPlan
    fingerprint: str


def cut(plan: CampaignPlan, flights: int = CHUNK) -> list[Chunk]:
    """The campaign in chunks of about `flights` flights, in the order of the results: mission, seed, controller."""
    each = max(1, flights // len(plan.campaign.controllers))
    end = plan.campaign.first_seed + plan.campaign.seeds
    starts = [
        (mission, first)
        for mission in range(len(plan.missions))
        for first in range(plan.campaign.first_seed, end, each)
    ]
    return [Chunk(n, mission, first, min(each, end - first)) for n, (mission, first) in enumerate(starts)]


def trace_every(plan: CampaignPlan, mission: int) -> int:
    """Ticks from one line of the trace to the next, by the mission's length."""
    return 1 + int(_longest(plan, mission) / plan.step) // MOST_LINES


def _longest(plan: CampaignPlan, mission: int) -> float:
    """Seconds after which a flight is over: the autopilot itself gives up before."""
    return plan.missions[mission].time_limit_s + 5.0


def _past_limits(P: np.ndarray, commands: np.ndarray, seconds: float) -> tuple[float, float]:
    """Most that commands (n, 3), `seconds` apart, leave range (in ranges) and rate (in rates); NaN if one is NaN."""
    low, high, rate = (P[start : start + 9 : 4] for start in (layout.SERVO_MIN, layout.SERVO_MAX, layout.SERVO_RATE))
    range_ = np.maximum(low - commands, commands - high) / (high - low)
    speed = np.abs(np.diff(commands, axis=0, prepend=0.0)) / (rate * seconds) - 1.0
    # numpy's maximum hands NaN on where Python's max would hide it
    return float(np.maximum(0.0, range_.max())), float(np.maximum(0.0, speed.max()))


def _worst_attitude(flown: np.ndarray) -> float:
    """Most (rad) that the plant's pitch or roll is off its reference in the lines of a trace; NaN if one is NaN."""
    off = [
        flown[:, closed_loop.TRACE.index(f"true_{name}")] - flown[:, closed_loop.TRACE.index(f"ref_{name}")]
        for name in ("pitch", "roll")
    ]
    return float(np.abs(np.angle(np.exp(1j * np.array(off)))).max())


def _ending(end: np.ndarray, deepest: float, site: float, over: tuple[float, float], attitude: float) -> float:
    """How a flight ended, a key of ENDINGS."""
    if end[closed_loop.END_MODE] == ctl.ABORTED:
        return float(end[closed_loop.END_REASON])
    if end[closed_loop.END_MODE] != ctl.COMPLETED:
        return STILL_FLYING
    if not deepest <= site:
        return UNSEEN_DEPTH
    if not (over[0] <= 0.0 and over[1] <= ROUNDING):
        return PAST_LIMITS
    if not attitude <= TUMBLING:
        return TUMBLED
    return ctl.REASON_NONE


def compile_loop(plan: CampaignPlan) -> None:
    """Compile the loop into the kernels' cache, or find it there, before processes that would each do it themselves."""
    pilot, world = plan.pilot(0, plan.campaign.controllers[0]), draw_world(plan, 0, plan.campaign.first_seed).world
    fly_group([world], [pilot], 0, 1, np.zeros((1, 1, closed_loop.N_TRACE)))


def fly_chunk(job: FlightJob, chunk: Chunk) -> np.ndarray:
    """Fly a chunk; one row of COLUMNS a flight, shape (seeds x controllers, len(COLUMNS)).

    InputError where this process would not fly what the campaign's own would.
    """
    plan = job.plan
    if job.fingerprint not in _checked:
        if fingerprint(plan) != job.fingerprint:
            raise InputError("a worker has another version of glider than the campaign was started with")
        _checked.add(job.fingerprint)
    every, site = trace_every(plan, chunk.mission), plan.missions[chunk.mission].site.depth_m
    most_ticks = int(_longest(plan, chunk.mission) / plan.step)
    command, depth = closed_loop.TRACE.index("servo"), closed_loop.TRACE.index("true_depth")
    pilots = [plan.pilot(chunk.mission, name) for name in plan.campaign.controllers]
    held = bool(np.isfinite(pilots[0].legs[:, ctl.LEG_BALLAST]).any())  # the depth then keeps to no reference
    seeds = range(chunk.first_seed, chunk.first_seed + chunk.seeds)
    flights = [(seed, drawn, number) for seed in seeds for drawn in [draw_world(plan, chunk.mission, seed)]
               for number in range(len(pilots))]  # fmt: skip
    worlds, flown_by = [drawn.world for _, drawn, _ in flights], [pilots[number] for _, _, number in flights]
    # Here the cores are shared out by process: a group after the other on this thread, and the same traces serve all.
    traces = np.zeros((LANES, most_ticks // every + 1, closed_loop.N_TRACE))
    rows: list[tuple] = [()] * len(flights)
    for members, count in zip(*groups_of(worlds, flown_by), strict=True):
        members = members[:count]
        ends, ticks = fly_group([worlds[i] for i in members], [flown_by[i] for i in members], most_ticks, every, traces)
        for i, end, ticked, trace in zip(members, ends, ticks, traces, strict=False):
            seed, drawn, number = flights[i]
            pilot = pilots[number]
            flown = trace[: (ticked - 1) // every + 1]
            over = _past_limits(pilot.P, flown[:, command : command + 3], every * plan.step)
            deepest = float(flown[:, depth].max())
            attitude = _worst_attitude(flown)
            ended = _ending(end, deepest, site, over, attitude)
            rows[i] = (
                chunk.mission, number, seed,
                drawn.current, drawn.wave_height, drawn.wave_period, drawn.disturbance, drawn.start_depth,
                end[closed_loop.END_MODE] == ctl.COMPLETED, ended == ctl.REASON_NONE, ended,
                end[closed_loop.END_LEG], end[closed_loop.END_TIME],
                np.nan if held else end[closed_loop.END_ERROR_DEPTH],
                end[closed_loop.END_ERROR_PITCH], end[closed_loop.END_ERROR_ROLL],
                *end[closed_loop.END_TRAVEL_SERVO : closed_loop.END_TRAVEL_SERVO + 3],
                deepest, *over, attitude,
            )  # fmt: skip
    return np.array(rows, dtype=np.float64)
