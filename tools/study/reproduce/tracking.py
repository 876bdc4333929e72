"""Figures 5 and 6: how well each controller keeps a pitch or a depth reference, against the strength of the noise."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np

from glider.firmware.model.gains import BEST_TUNED, Control
from glider.firmware.model.vehicle import Vehicle
from glider.sim_backend.core.closed_loop import END_ERROR_DEPTH, END_ERROR_PITCH
from glider.tools.study.reproduce import design

STRENGTHS = (0.0, 0.003, 0.01, 0.03, 0.06, 0.1, 0.2, 0.3, 0.5)  # m/s2 and rad/s2
PAPER_DISTURBANCE_SCALE = 10.0  # times the vehicle file's disturbance: the strength of the JSON unless one is given
COMPLETE_WITHIN = 0.2  # m of the target depth at the end
BIG = (30.0, -30.0, 45.0, -45.0)  # deg, the paper's "larger target final values"
PAPER_PID_ERROR = 13.0  # % that the paper prints for its PID there


@dataclass(frozen=True)
class TrackingFigure:
    """What figures 5 and 6 differ in."""

    name: str
    unit: str
    targets: tuple[float, ...]
    leg: Callable
    error_column: int  # of FleetResult.errors: mean |measured - reference|
    trace: str  # the plant's true value in the trace
    scale: float  # from the trace's unit to the target's
    offset: float  # what is taken off the trace's value, in the target's unit


FIG5 = TrackingFigure(
    "fig5", "deg", design.PITCH_TARGETS, design.pitch_leg, END_ERROR_PITCH, "true_pitch", 180.0 / np.pi, 0.0
)
FIG6 = TrackingFigure(
    "fig6", "m", design.DEPTH_TARGETS, design.depth_leg, END_ERROR_DEPTH, "true_depth", 1.0, design.START_DEPTH
)


def variants(vehicle: Vehicle) -> list[design.Variant]:
    """The controllers compared: the law, the hybrid, the ruled and the best-tuned PID, and law+."""
    base = vehicle.control or Control()
    made = [
        design.Variant(name, msgspec.structs.replace(base, controller=name))
        for name in ("law", "hybrid", "pid", "law+")
    ]
    tuned = msgspec.structs.replace(base, controller="pid", pitch=BEST_TUNED.pitch, depth=BEST_TUNED.depth)
    return [*made, design.Variant("pid_tuned", tuned)]


def tracking_error(figure: TrackingFigure, batch: design.Batch) -> np.ndarray:
    """Mean |measured - reference| of each flight in percent of its target (of 1 m where that is 0), shape (n,)."""
    assert batch.result is not None
    size = np.array([abs(key["target"]) or 1.0 for key in batch.keys])
    return 100.0 * batch.result.ends[:, figure.error_column] * figure.scale / size


def final_error(figure: TrackingFigure, batch: design.Batch) -> np.ndarray:
    """Mean |true value - target| over the last 5 s of each flight, deg or m, shape (n,)."""
    assert batch.result is not None
    target = np.array([key["target"] for key in batch.keys])
    last = batch.result.column(figure.trace)[:, -design.LAST - 1 : -1] * figure.scale - figure.offset
    return np.abs(last - target[:, None]).mean(axis=1)


def interval(values: np.ndarray, rng: np.random.Generator) -> tuple[float, float]:
    """90 % interval of the mean over seeds, by bootstrap."""
    means = rng.choice(values, size=(1000, len(values))).mean(axis=1)
    low, high = np.percentile(means, [5.0, 95.0])
    return float(low), float(high)


def summary(figure: TrackingFigure, batch: design.Batch) -> list[dict[str, Any]]:
    """One entry a target, controller, strength and state: the mean over seeds, with its interval."""
    errors, finals = tracking_error(figure, batch), final_error(figure, batch)
    rng = np.random.default_rng(0)
    groups: dict[tuple, list[int]] = {}
    for i, key in enumerate(batch.keys):
        groups.setdefault((key["target"], key["controller"], key["noise"], key["state"]), []).append(i)
    rows = []
    for (target, controller, noise, state), members in groups.items():
        done = finals[members] <= COMPLETE_WITHIN if figure is FIG6 else np.isfinite(finals[members])
        rows.append(
            {
                "target": target,
                "unit": figure.unit,
                "controller": controller,
                "noise": noise,
                "state": state,
                "tracking_error_pct": float(errors[members].mean()),
                "tracking_error_ci90": interval(errors[members], rng),
                "final_error": float(finals[members].mean()),
                "completed": float(np.mean(done)),
                "seeds": len(members),
            }
        )
    return rows


def compare(figure: TrackingFigure, batch: design.Batch, targets: tuple[float, ...]) -> list[dict[str, Any]]:
    """One entry a strength, state and controller, over several targets together: means and 90 % intervals over seeds.

    A seed is the same vehicle, water and sensors for all controllers, so `less_pid_tuned_ci90`, the interval of what a
    controller has less the best-tuned PID (% of the target), is one of differences in pairs. `completed`: share.
    """
    errors, finals, rng = tracking_error(figure, batch), final_error(figure, batch), np.random.default_rng(0)
    groups: dict[tuple, dict[int, list[int]]] = {}
    for i, key in enumerate(batch.keys):
        if key["target"] in targets:
            seeds = groups.setdefault((key["noise"], key["state"], key["controller"]), {})
            seeds.setdefault(key["seed"], []).append(i)
    means = {group: np.array([errors[i].mean() for i in seeds.values()]) for group, seeds in groups.items()}
    rows = []
    for (noise, state, controller), seeds in groups.items():
        of_seed, members = means[noise, state, controller], np.concatenate(list(seeds.values()))
        best = means.get((noise, state, "pid_tuned"), of_seed)
        rows.append(
            {
                "noise": noise,
                "state": state,
                "controller": controller,
                "targets": list(targets),
                "tracking_error_pct": float(of_seed.mean()),
                "tracking_error_ci90": interval(of_seed, rng),
                "less_pid_tuned_ci90": interval(of_seed - best, rng),
                "final_error": float(finals[members].mean()),
                "completed": float((finals[members] <= COMPLETE_WITHIN).mean()) if figure is FIG6 else None,
                "seeds": len(of_seed),
            }
        )
    return rows


def average(
    rows: list[dict], controller: str, noise: float, targets: tuple[float, ...], key="tracking_error_pct"
) -> float:
    """Mean tracking error (%), or another entry, of a controller at one strength over targets, on estimated states."""
    picked = [
        row[key]
        for row in rows
        if (row["controller"], row["noise"], row["state"]) == (controller, noise, "estimated")
        and row["target"] in targets
    ]
    return float(np.mean(picked))


def strength_at(rows: list[dict], controller: str, targets: tuple[float, ...], error: float) -> float | None:
    """Strength at which a controller's mean error first reaches `error` %, between two measured ones; None: never."""
    strengths = sorted({row["noise"] for row in rows})
    values = [average(rows, controller, s, targets) for s in strengths]
    if values[0] >= error:
        return None
    for (s0, v0), (s1, v1) in zip(
        zip(strengths, values, strict=True), zip(strengths[1:], values[1:], strict=True), strict=False
    ):
        if v0 < error <= v1:
            return s0 + (error - v0) / (v1 - v0) * (s1 - s0)
    return None


def error_at(rows: list[dict], controller: str, targets: tuple[float, ...], strength: float) -> float:
    """Mean error (%) of a controller at a strength between measured ones."""
    strengths = sorted({row["noise"] for row in rows})
    return float(np.interp(strength, strengths, [average(rows, controller, s, targets) for s in strengths]))


def fly_figure(
    figure: TrackingFigure, vehicle: Vehicle, strengths: tuple[float, ...], seeds: int, states: tuple[str, ...]
) -> design.Batch:
    """All flights of a figure."""
    legs = {target: figure.leg(target) for target in figure.targets}
    return design.fly_design(vehicle, legs, variants(vehicle), list(strengths), range(seeds), states)
