"""Gains scored on the paper's manoeuvres (section 4.2) under noise: the flights are those of `glider reproduce`.

Pitch targets at held ballast and changes of depth, 60 s each, vehicles drawn from [uncertainty] (reproduce/design.py).
A seed is the same water, vehicle and sensors for every set of gains: they are compared in pairs.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from glider.firmware.model.gains import Control
from glider.firmware.model.vehicle import Vehicle
from glider.sim_backend.core.closed_loop import END_TRAVEL_BALLAST, END_TRAVEL_SERVO
from glider.tools.study.reproduce.design import SECONDS, Variant, fly_design
from glider.tools.study.reproduce.tracking import FIG5, FIG6, tracking_error

STRENGTHS = (0.003, 0.03, 0.1)  # m/s2 and rad/s2, 1 sigma
FIGURES = {"pitch": FIG5, "depth": FIG6}


@dataclass(frozen=True)
class ManoeuvreScore:
    """Outcomes of one set of gains: flights by target, strength and seed."""

    error: np.ndarray  # (targets, strengths, seeds), percent of the target
    travel: np.ndarray  # (targets, strengths, seeds, 3), rad, m and kg that servo, slider and ballast went in a minute


def fly(
    vehicle: Vehicle, loop: str, controls: Sequence[Control], seeds: range, strengths: Sequence[float] = STRENGTHS
) -> list[ManoeuvreScore]:
    """Score the PID of all controls on a loop's manoeuvres, "pitch" or "depth", in one call over all cores."""
    figure = FIGURES[loop]
    legs = {target: figure.leg(target) for target in figure.targets}
    flown = [msgspec.structs.replace(control, controller="pid") for control in controls]
    variants = [Variant(str(number), control) for number, control in enumerate(flown)]
    batch = fly_design(vehicle, legs, variants, list(strengths), seeds, trace_every=0.0)
    assert batch.result is not None
    shape = (len(controls), len(legs), len(strengths), len(seeds))
    errors = tracking_error(figure, batch).reshape(shape)
    travel = batch.result.ends[:, END_TRAVEL_SERVO : END_TRAVEL_BALLAST + 1].reshape(*shape, 3) * 60.0 / SECONDS
    return [ManoeuvreScore(error, gone) for error, gone in zip(errors, travel, strict=True)]
