"""What real vehicles have beside the effect that is looked for: noise that no file foretold, and small effects.

The files of a messy case state the nominal noise, biases and disturbance; its vehicle flies with these times factors
of its own. Beside the main effect, or without one, four small ones act, each of another place, each of which makes a
model that lacks it alone at most twice as wrong as a perfect one.
"""

from dataclasses import dataclass

import msgspec
import numpy as np

from glider.firmware.model.vehicle import SensorsTable, Vehicle
from glider.tools.verify.challenge.forms import KNOWN, Form, Place
from glider.tools.verify.challenge.magnitude import Magnitude, find_strength, measure, visible
from glider.tools.verify.challenge.trial import Trial

NOISE, BIAS, DISTURBANCE = (0.7, 1.5), (0.5, 1.5), (0.6, 2.0)  # times what the file says
COUNT = 4
SMALL_EFFECT_GAP = (1.2, 1.8)  # gap over a perfect model's that a small effect is drawn for
LEAST_SMALL_GAP, LARGEST_SMALL_GAP = 1.1, 2.0  # and between which it may come out
LARGE = 3.5  # the same of the main effect at least: root(3.5^2 - 1) is twice root(2^2 - 1)


@dataclass(frozen=True)
class Factors:
    """Times what the vehicle file says, by table of [sensors] and by entry of [disturbance]."""

    noise: dict[str, float]
    bias: dict[str, float]
    disturbance: dict[str, float]

    def applied(self, vehicle: Vehicle) -> Vehicle:
        """The vehicle as it flies."""
        tables = {}
        for name in SensorsTable.__struct_fields__:
            table = getattr(vehicle.sensors, name)
            tables[name] = msgspec.structs.replace(
                table, noise=table.noise * self.noise[name], bias=table.bias * self.bias[name]
            )
        scaled = {name: getattr(vehicle.disturbance, name) * factor for name, factor in self.disturbance.items()}
        return msgspec.structs.replace(
            vehicle, sensors=SensorsTable(**tables), disturbance=msgspec.structs.replace(vehicle.disturbance, **scaled)
        )


def _drawn(rng: np.random.Generator, names: tuple[str, ...], between: tuple[float, float]) -> dict[str, float]:
    low, high = np.log(between)
    return {name: float(np.exp(rng.uniform(low, high))) for name in names}


def draw_factors(rng: np.random.Generator, vehicle: Vehicle) -> Factors:
    """Factors, each log-uniform and of its own."""
    sensors, scaled = SensorsTable.__struct_fields__, vehicle.disturbance.__struct_fields__
    return Factors(_drawn(rng, sensors, NOISE), _drawn(rng, sensors, BIAS), _drawn(rng, scaled, DISTURBANCE))


def small_one(rng: np.random.Generator, trial: Trial, form: Form) -> Magnitude | None:
    """A form in a size that hardly shows; None where it cannot be had in these runs."""
    sizes, most = form.draw(rng)
    target = float(np.exp(rng.uniform(*np.log(SMALL_EFFECT_GAP))))
    strength = find_strength(lambda s: visible(trial, form, sizes, s), target, most)
    found = measure(trial, form, sizes, strength, weighed=False) if strength > 0.0 else None
    return found if found is not None and LEAST_SMALL_GAP < found.visible <= LARGEST_SMALL_GAP else None


def small_ones(rng: np.random.Generator, trial: Trial, taken: set[Place]) -> list[Magnitude]:
    """COUNT small effects of different places, none of them `taken`; fewer where no more can be had."""
    found: list[Magnitude] = []
    taken = set(taken)
    for n in rng.permutation(len(KNOWN)):
        form = KNOWN[n]
        if taken & set(form.places) or (form.by_mocap and not trial.site.mocap):
            continue
        size = small_one(rng, trial, form)
        if size is not None:
            found.append(size)
            taken |= set(form.places)
        if len(found) == COUNT:
            break
    return found
