"""The best-tuned PID: gains searched for, with which the paper's manoeuvres under noise are tracked best.

Cost of a set of gains: for every noise strength the mean tracking error (percent) over targets and seeds, and of the
strengths the geometric mean, so that each counts alike however large its errors are; times 1 + TRAVEL_PRICE for every
full stroke of the loop's actuator a minute (mean over the flights), which tells gains apart that track alike.

Two thirds of the budget go to differential evolution over the logarithms of kp, ki, kd, the rule's gains among the
first candidates; these fly on samples as they come, which is several times quicker than with the Kalman filter. The
last third is Nelder and Mead's simplex from the best of them, with the estimator that the control names and on more
seeds: in rough water a few flights in a hundred are lost, which gains that never met one know nothing of. All
candidates of a phase fly the same flights; the errors that are reported come from flights the search has not seen.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import msgspec
import numpy as np
from scipy.optimize import Bounds, differential_evolution, minimize

from glider.firmware.model.gains import Control
from glider.firmware.model.vehicle import Vehicle
from glider.tools.study.tuning.manoeuvres import FIGURES, STRENGTHS, ManoeuvreScore, fly

TRAVEL_PRICE = 0.002
LOW = {"pitch": (0.01, 0.001, 0.01), "depth": (0.05, 0.001, 0.1)}  # kp, ki, kd
HIGH = {"pitch": (3.0, 3.0, 3.0), "depth": (10.0, 5.0, 20.0)}
POPULATION = 20


@dataclass(frozen=True)
class TuningFlights:
    """Which flights gains are scored on, beside the targets; `fine`: seeds of the simplex, None: the same."""

    seeds: range
    strengths: tuple[float, ...] = STRENGTHS
    fine: range | None = None


SEARCHED = TuningFlights(range(1000, 1003), fine=range(1000, 1008))
REPORTED = TuningFlights(range(2000, 2016))


@dataclass(frozen=True)
class Found:
    """A search's result: the control, its cost, the cost it began with, and how many candidates were flown."""

    control: Control
    cost: float
    cost_before: float
    candidates: int


def gains_of(control: Control, loop: str) -> np.ndarray:
    """kp, ki, kd of a loop, shape (3,)."""
    table = getattr(control, loop)
    return np.array([table.kp, table.ki, table.kd])


def with_gains(control: Control, loop: str, gains: np.ndarray) -> Control:
    """The control with kp, ki, kd of one loop replaced, at the three digits a file carries."""
    kp, ki, kd = (float(f"{gain:.3g}") for gain in gains)
    table = msgspec.structs.replace(getattr(control, loop), kp=kp, ki=ki, kd=kd)
    return msgspec.structs.replace(control, **{loop: table})


def cost(vehicle: Vehicle, loop: str, score: ManoeuvreScore) -> float:
    """What the search makes small."""
    errors = score.error.mean(axis=(0, 2))  # of each strength
    index, actuator = (1, vehicle.actuators.slider) if loop == "pitch" else (2, vehicle.actuators.ballast)
    strokes = score.travel[..., index].mean() / (actuator.range[1] - actuator.range[0])
    return float(np.exp(np.log(errors).mean()) * (1.0 + TRAVEL_PRICE * strokes))


class _Trials:
    """Flies candidates (logarithms of gains) of one loop about one control, and remembers the best."""

    def __init__(
        self, vehicle: Vehicle, loop: str, control: Control, flights: TuningFlights, advance: Callable[[int], None]
    ):
        self.vehicle, self.loop, self.control, self.flights, self.advance = vehicle, loop, control, flights, advance
        self.low, self.high = np.log(LOW[loop]), np.log(HIGH[loop])
        self.flown, self.best, self.best_cost = 0, control, np.inf

    def costs(self, candidates: np.ndarray) -> np.ndarray:
        """Of many at once: candidates (3, n), costs (n,)."""
        inside = np.clip(candidates.T, self.low, self.high)
        controls = [with_gains(self.control, self.loop, np.exp(candidate)) for candidate in inside]
        scores = fly(self.vehicle, self.loop, controls, self.flights.seeds, self.flights.strengths)
        values = np.array([cost(self.vehicle, self.loop, score) for score in scores])
        self.flown += len(controls)
        self.advance(len(controls))
        if values.min() < self.best_cost:
            self.best, self.best_cost = controls[int(values.argmin())], float(values.min())
        return values

    def place(self, control: Control) -> np.ndarray:
        """A control's gains as a candidate (3,)."""
        return np.clip(np.log(np.maximum(gains_of(control, self.loop), 1e-9)), self.low, self.high)


def search_loop(
    vehicle: Vehicle, loop: str, begin: Control, seed: int, budget: int, flights: TuningFlights | None = None,
    advance: Callable[[int], None] = lambda flown: None,
) -> Found:  # fmt: skip
    """Search kp, ki, kd of a loop, beginning with those of `begin`; about `budget` candidates are flown."""
    flights = flights or SEARCHED
    rng = np.random.default_rng(seed)

    # a law has no use for samples as they come; what is tuned is the PID in any case
    quick = msgspec.structs.replace(begin, controller="pid", estimator="measured")
    broad = _Trials(vehicle, loop, quick, flights, advance)
    population = min(POPULATION, max(5, budget // 3))
    start = broad.low + (broad.high - broad.low) * rng.random((population, 3))
    start[0] = broad.place(begin)
    differential_evolution(
        broad.costs, Bounds(broad.low, broad.high), init=start, maxiter=max(1, (2 * budget) // (3 * population) - 1),
        rng=rng, vectorized=True, updating="deferred", polish=False, tol=0.0, atol=0.0,
    )  # fmt: skip

    closer = replace(flights, seeds=flights.fine or flights.seeds)
    fine = _Trials(vehicle, loop, begin, closer, advance)
    before = float(fine.costs(fine.place(begin)[:, None])[0])
    middle = fine.place(broad.best)
    minimize(
        lambda candidate: fine.costs(candidate[:, None])[0], middle, method="Nelder-Mead",
        options={
            "maxfev": max(4, budget - broad.flown - 1), "xatol": 0.01, "fatol": 1e-4,
            "initial_simplex": np.vstack([middle, middle + 0.3 * np.eye(3)]),
        },
    )  # fmt: skip
    return Found(fine.best, fine.best_cost, before, broad.flown + fine.flown)


def search(
    vehicle: Vehicle, begin: Control, seed: int, budget: int, advance: Callable[[int], None] = lambda flown: None
) -> tuple[Control, dict[str, Found]]:
    """Pitch first, then depth with the pitch found; `begin` is where both start, the rule's gains."""
    control, found = begin, {}
    for loop in ("pitch", "depth"):
        found[loop] = search_loop(vehicle, loop, control, seed, budget, advance=advance)
        control = found[loop].control
    return control, found


def report(vehicle: Vehicle, controls: dict[str, Control]) -> list[dict]:
    """Tracking errors (percent) and actuators' ways of controls by name, on flights that no search has seen."""
    rows = []
    for loop in ("pitch", "depth"):
        targets = FIGURES[loop].targets
        scores = fly(vehicle, loop, list(controls.values()), REPORTED.seeds, REPORTED.strengths)
        for name, score in zip(controls, scores, strict=True):
            for k, strength in enumerate(REPORTED.strengths):
                errors, travel = score.error[:, k], score.travel[:, k].mean(axis=(0, 1))
                by_target = {f"{target:g}": error for target, error in zip(targets, errors.mean(axis=1), strict=True)}
                row = {"loop": loop, "gains": name, "noise": strength, "tracking_error_pct": errors.mean()}
                ways = zip(("servo_rad_per_min", "slider_m_per_min", "ballast_kg_per_min"), travel, strict=True)
                rows.append({**row, "by_target": by_target, **dict(ways)})
    return rows
