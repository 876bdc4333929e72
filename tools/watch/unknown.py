"""Whether what is left of a change, once its label is in the model, is a change that no label explains."""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from glider.tools.diagnose.noise_probes import NoiseProbe, probes
from glider.tools.diagnose.unknown import place_alone
from glider.tools.inference.hyperparameters import DIAGNOSIS, WATCH
from glider.tools.inference.parameters import CLOCK_PLACE
from glider.tools.watch.excess_noise import SCALES, WATER, beyond_reference
from glider.tools.watch.flights import excess_nis_sigma
from glider.tools.watch.history import ChangeEvent, History

PROBED, REFERENCE = 3, 2  # runs at most


@dataclass(frozen=True)
class Residual:
    """What an event leaves in its runs: nat that the best probe gains there, over that and what the event explains."""

    share: float
    probes: list[tuple[NoiseProbe, float, float]]  # with gain and scale, the one that gains most first
    own: bool = False  # whether it is left at the sensor that the event's label is of, and nowhere else

    @property
    def probability(self) -> float:
        """That this is no effect of the catalogue."""
        middle = DIAGNOSIS.sensor_misfit_share if self.own else DIAGNOSIS.misfit_share
        z = (np.log(max(self.share, 1e-6)) - np.log(middle)) / DIAGNOSIS.misfit_share_width
        return float(np.clip(ndtr(z), DIAGNOSIS.least_unknown, 1.0 - DIAGNOSIS.least_unknown))


NO_RESIDUAL = Residual(0.0, [])


def what_is_left(history: History, event: ChangeEvent) -> Residual:
    """Of an event in the runs that it has for itself."""
    runs = alone(history, event)
    explained = event.explained / max(1, int((event.span.weights(history.flights.count) > 0.0).sum()))
    flights = history.flights
    noisy = sorted(runs, key=lambda n: -excess_nis_sigma(flights, n))[:PROBED]
    if not noisy or excess_nis_sigma(flights, noisy[0]) < WATCH.excess_noise_sigma:
        return NO_RESIDUAL
    wanted = [probe for probe in probes(flights.parts[noisy[0]]) if probe.name not in WATER]
    together = beyond_reference(flights, wanted, noisy, REFERENCE).sum(axis=1)
    order = np.argsort(-together.max(axis=1))
    found = [(wanted[n], float(together[n].max()), SCALES[int(together[n].argmax())]) for n in order]
    if event.has_course and found[0][0].element == CLOCK_PLACE[1] and history.effects[event.label].place == CLOCK_PLACE:
        return NO_RESIDUAL  # a clock that wanders is still one that is wrong
    left = max(found[0][1], 0.0)
    place = history.effects[event.label].place if event.label in history.effects else ("", "")
    first, sure = place_alone((probe, gain) for probe, gain, _ in found)
    own = place[0] == "sensing" and place == first and sure > WATCH.majority
    return Residual(left / max(left + explained * len(noisy), 1e-9), found, own)


def alone(history: History, event: ChangeEvent) -> np.ndarray:
    """The runs that have this event and no other of another span; all of its runs, where there are none."""
    count = history.flights.count
    own = event.span.weights(count) > 0.0
    free = own.copy()
    for other in history.events:
        if other is not event and other.span != event.span:
            free &= other.span.weights(count) == 0.0
    found = free if (free & history.judged).any() else own
    return np.flatnonzero(found & history.judged)
