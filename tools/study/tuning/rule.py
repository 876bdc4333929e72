"""Gains by rule: a phase margin of 60 degrees at a stated crossover, as a tuner of MATLAB's kind sets them (paper 4.2).

For each loop, at the worst of the design trims (plant.DESIGN_TRIMS):

1. Crossover: FASTER times the natural frequency of the loop's reference filter, so that the filter sets the pace and
   not the loop; slower where the actuator's rate says so: an error of SWING_ERROR_SHARE of the largest step of target,
   swinging at the crossover, may not ask for more speed than the actuator has.
2. Phase margin there: PHASE_MARGIN.
3. Integral: Ti = 2 Td, which gives the controller's zeros a damping of 1/sqrt(2).
4. Depth only: the observer of depth rate is OBSERVER times as fast as the crossover.

Pitch first, on its own; then depth, with the pitch loop closed.
"""

import math
from dataclasses import dataclass

import msgspec
import numpy as np
from scipy.optimize import fsolve

from glider.firmware.core.vehicle.layout import BALLAST_RATE, SLIDER_RATE
from glider.firmware.model.gains import Control, DepthGains, PitchGains
from glider.firmware.model.vehicle import Vehicle
from glider.sim_backend.board import SimBoardFile
from glider.tools.data.errors import InputError
from glider.tools.study.tuning.linear_plant import DESIGN_TRIMS, OTHER_TRIMS, Trim, linearise
from glider.tools.study.tuning.loops import OMEGA, Delays, Margins, depth_terms, margins, open_loop, pitch_terms

PHASE_MARGIN = 60.0  # deg
FASTER = 3.0
OBSERVER = 10.0
SWING_ERROR_SHARE = 0.03
LARGEST_STEP = {"pitch": math.radians(45.0), "depth": 5.0}  # rad, m: the paper's
EXACT = 1e-4  # relative in crossover, deg in margin


@dataclass(frozen=True)
class Row:
    """A loop's margins at a trim."""

    loop: str
    trim: Trim
    design: bool
    margins: Margins


def crossover_wanted(terms: np.ndarray, loop: str, wn: float, rate: float) -> float:
    """The crossover of step 1 (rad/s), from the terms of the design trims (trims, 3, n)."""
    # |C| = 1 / |plant| at a crossover: an error a there makes the actuator swing at a omega / |plant|
    speed = SWING_ERROR_SHARE * LARGEST_STEP[loop] * OMEGA / np.abs(terms[:, 0]).min(axis=0)
    too_fast = np.nonzero(speed > rate)[0]
    fastest = OMEGA[too_fast[0]] if len(too_fast) else OMEGA[-1]
    return float(min(FASTER * wn, fastest))


def pid_at(terms: np.ndarray, crossover: float, phase_margin: float) -> tuple[float, float, float]:
    """kp, ki, kd that give one loop of terms (3, n) this crossover (rad/s) and phase margin (rad), with Ti = 2 Td."""
    there = [np.interp(crossover, OMEGA, term.real) + 1j * np.interp(crossover, OMEGA, term.imag) for term in terms]
    wanted = -np.exp(1j * phase_margin)

    def gains(log_gains: np.ndarray) -> np.ndarray:
        kp, kd = np.exp(log_gains)
        return np.array([kp, kp * kp / (2.0 * kd), kd])

    def off(log_gains: np.ndarray) -> tuple[float, float]:
        ratio = complex(gains(log_gains) @ there) / wanted
        return math.log(abs(ratio)), math.atan2(ratio.imag, ratio.real)

    size = 1.0 / abs(there[0])
    solution, _, good, _ = fsolve(off, np.log([0.7 * size, 0.7 * size / crossover]), full_output=True)
    if good != 1:
        degrees = math.degrees(phase_margin)
        raise InputError(f"no PID has a phase margin of {degrees:.0f} deg at {crossover:.3g} rad/s on this vehicle")
    kp, ki, kd = gains(solution)
    return float(kp), float(ki), float(kd)


def _significant(gains: tuple[float, float, float]) -> tuple[float, float, float]:
    """Three digits: what a file carries."""
    return tuple(float(f"{gain:.3g}") for gain in gains)  # type: ignore[return-value]


def worst_case(terms: np.ndarray, crossover: float, kind: type[PitchGains] | type[DepthGains]) -> tuple:
    """kp, ki, kd with which the fastest trim of terms (trims, 3, n) crosses at `crossover`, the least margin 60 deg."""
    aim, phase = crossover, PHASE_MARGIN
    for _ in range(30):
        found = pid_at(terms[0], aim, math.radians(phase))
        seen = [margins(open_loop(kind(kp=found[0], ki=found[1], kd=found[2]), term)) for term in terms]
        fastest, least = max(m.crossover for m in seen), min(m.phase for m in seen)
        if abs(fastest / crossover - 1.0) < EXACT and abs(least - PHASE_MARGIN) < EXACT:
            return found
        aim, phase = aim * crossover / fastest, phase + PHASE_MARGIN - least
    raise InputError(f"no gains keep {PHASE_MARGIN:.0f} deg at {crossover:.3g} rad/s at all design trims")


def tune(vehicle: Vehicle, board: SimBoardFile) -> Control:
    """The vehicle's [control] with pitch and depth gains by the rule; reference filters and the rest stay."""
    P, delays, control = vehicle.vector(), Delays.of(board), vehicle.control or Control()
    plants = [linearise(P, trim) for trim in DESIGN_TRIMS]

    terms = np.array([pitch_terms(plant, delays) for plant in plants])
    crossover = crossover_wanted(terms, "pitch", control.pitch.reference.wn, P[SLIDER_RATE])
    kp, ki, kd = _significant(worst_case(terms, crossover, PitchGains))
    pitch = PitchGains(kp=kp, ki=ki, kd=kd, reference=control.pitch.reference)

    wn = control.depth.reference.wn
    observer = OBSERVER * FASTER * wn  # as fast as the crossover can come out
    terms = np.array([depth_terms(P, plant, delays, pitch, observer) for plant in plants])
    crossover = crossover_wanted(terms, "depth", wn, P[BALLAST_RATE])
    observer = float(f"{OBSERVER * crossover:.2g}")
    terms = np.array([depth_terms(P, plant, delays, pitch, observer) for plant in plants])
    kp, ki, kd = _significant(worst_case(terms, crossover, DepthGains))
    depth = DepthGains(kp=kp, ki=ki, kd=kd, reference=control.depth.reference, rate_bandwidth=observer)
    return msgspec.structs.replace(control, pitch=pitch, depth=depth)


def table(vehicle: Vehicle, board: SimBoardFile, control: Control) -> list[Row]:
    """Margins of both loops at every trim, for any gains."""
    P, delays = vehicle.vector(), Delays.of(board)
    rows = []
    for loop in ("pitch", "depth"):
        for trim in (*DESIGN_TRIMS, *OTHER_TRIMS):
            plant = linearise(P, trim)
            if loop == "pitch":
                L = open_loop(control.pitch, pitch_terms(plant, delays))
            else:
                terms = depth_terms(P, plant, delays, control.pitch, control.depth.rate_bandwidth)
                L = open_loop(control.depth, terms)
            rows.append(Row(loop, trim, trim in DESIGN_TRIMS, margins(L)))
    return rows
