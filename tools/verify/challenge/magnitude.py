"""How large an effect of a blind case is: found by bisection on the gap it makes against a perfect model's."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from glider.tools.verify.challenge.design import FITTED
from glider.tools.verify.challenge.evidence import evidence as weigh
from glider.tools.verify.challenge.forms import Form
from glider.tools.verify.challenge.trial import Trial, by_channel, flyable, predictable, total, with_effect

LEAST_GAP_FLOORS, WEAK_GAP_FLOORS, STRONG_GAP_FLOORS = 2.0, 8.0, 25.0  # gap over floor
WEIGHED = 4  # runs
EVIDENCE = 20.0  # nat against a model that takes all that is allowed
FIRST, GROWTH, CLOSE, EVALUATIONS = 0.15, 8.0, 0.1, 9


@dataclass
class Magnitude:
    """An effect with its size, and what of it shows: gaps over floors."""

    form: Form
    sizes: np.ndarray  # of the entries of F at strength 1
    strength: float
    visible: float  # against a model that lacks the effect only
    evidence: float | None  # nat, against one that takes all that is allowed; None for scatter, and where nobody asked
    nominal: float  # against the nominal model


def visible(trial: Trial, form: Form, sizes: np.ndarray, strength: float) -> float:
    """Gap of a model that lacks only this effect, over a perfect one's; NaN where the runs are not flyable.

    For what cannot be predicted it is the scatter: the perfect model's gap over its gap in the same flights without.
    """
    F = with_effect(trial.shapes, form, sizes, strength)
    flights = trial.fly(F, FITTED)
    if not flyable(flights, trial.site):
        return float("nan")
    perfect = total(trial.channels(flights, trial.P, predictable(F), plain=False))
    if form.scatter:
        calm = trial.fly(trial.shapes, FITTED)
        return perfect / total(trial.channels(calm, trial.P, trial.shapes, plain=False))
    return total(trial.channels(flights, trial.P, trial.shapes, plain=True, seen=True)) / perfect


def find_strength(value: Callable[[float], float], target: float, most: float) -> float:
    """A strength at which `value` (1 at 0, growing) comes within CLOSE of the target; 0 if nothing flyable does.

    Bisection with the guess that value^2 - 1 grows as the strength's square, which small effects do; where the most
    that can be flown falls short, that.
    """
    low, high, best = 0.0, float("inf"), 0.0
    strength = min(FIRST, most)
    for _ in range(EVALUATIONS):
        found = value(strength)
        if abs(np.log(found / target)) < CLOSE:
            return strength
        if found < target:
            low = best = strength
        else:  # too much, or not flyable
            high = strength
        if low >= most:
            break
        guess = strength * np.sqrt((target**2 - 1.0) / max(found**2 - 1.0, 1e-2)) if np.isfinite(found) else np.nan
        bounded = min(high, most)
        if not low < guess < bounded:
            guess = 0.5 * (low + high) if np.isfinite(high) else bounded
        strength = float(min(guess, GROWTH * low if low > 0.0 and not np.isfinite(high) else bounded))
    return best


def measure(trial: Trial, form: Form, sizes: np.ndarray, strength: float, weighed: bool = True) -> Magnitude | None:
    """The effect alone at a strength, its evidence `weighed` or not; None where its runs are not flyable."""
    seen = visible(trial, form, sizes, strength)
    if not np.isfinite(seen):
        return None
    F = with_effect(trial.shapes, form, sizes, strength)
    flights = trial.fly(F, FITTED)
    gaps = trial.channels(flights, trial.P, predictable(F), plain=False)
    nominal = total(trial.channels(flights, trial.vehicle.vector(), trial.shapes, plain=True, seen=True)) / total(gaps)
    evidence = None if form.scatter or not weighed else weigh(trial, flights[:WEIGHED], F, by_channel(gaps))
    return Magnitude(form, sizes, strength, seen, evidence, nominal)


def choose(
    rng: np.random.Generator, trial: Trial, form: Form, weak: bool, least: float = LEAST_GAP_FLOORS
) -> Magnitude | None:
    """An effect of a drawn size: from what can be seen at all to WEAK_GAP_FLOORS, or from there to STRONG_GAP_FLOORS.

    None if there is none.

    Weak goes by the nominal model's gap, which what is allowed adds to. least: visible by this factor at least.
    """
    sizes, most = form.draw(rng)
    low, high = WEAK_GAP_FLOORS, STRONG_GAP_FLOORS
    if weak:
        room = WEAK_GAP_FLOORS**2 - allowed(trial) ** 2  # what is allowed takes its part of the nominal gap
        low, high = 1.15 * least, 0.8 * np.sqrt(max(room, 0.0))
        if high < low:
            return None
    target = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    for _ in range(4):
        strength = find_strength(lambda s: visible(trial, form, sizes, s), target, most)
        strength = max(strength, form.least)
        found = measure(trial, form, sizes, strength) if strength > 0.0 else None
        if found is None or found.visible < least or (weak and found.nominal > WEAK_GAP_FLOORS):
            return None
        if found.evidence is None or (found.evidence >= EVIDENCE and found.nominal >= least):
            return found
        if found.visible < 0.8 * target:  # no more to be had
            return None
        target *= 1.5
    return None


def allowed(trial: Trial) -> float:
    """Gap of the nominal model over a perfect one's where there is no effect: what [uncertainty] does."""
    flights = trial.fly(trial.shapes, FITTED)
    perfect = total(trial.channels(flights, trial.P, trial.shapes, plain=False))
    return total(trial.channels(flights, trial.vehicle.vector(), trial.shapes, plain=True, seen=True)) / perfect
