"""What dives say of a vehicle file: calibrations that are far from it, and labels that they do not part.

A calibration's own estimate is that of the dives alone: what the file says of it is taken off again, all else with it
(docs/explanation/ocean.md, Identification).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from glider.sim_backend.ocean.catalogue import catalogue
from glider.sim_backend.ocean.vehicle import PLACES, RELATIVE
from glider.tools.data.intervals import NINETY
from glider.tools.inference.parameters import FreeParameter, of_effect

# names of a vehicle file -> the label by which the catalogue has it
LABELS = {
    "Cd0": "drag", "Cd1": "drag", "lift_slope": "lift", "pitch_scale": "attitude_scale", "volume": "net_buoyancy",
    "oil_scale": "ballast_scale", "pitch_offset": "imu_pitch_bias", "compressibility": "compressibility",
    "thermal_expansion": "thermal_expansion", "roll_trim": "roll_trim",
}  # fmt: skip
# those that are calibrations: trim and volume are of a mission, not of a vehicle
CALIBRATIONS = ("Cd0", "lift_slope", "pitch_scale", "pitch_offset", "oil_scale", "compressibility", "thermal_expansion")
WIDER = 3.0  # times [uncertainty]: a file that is not quite right
CERTAIN_NAT = 3.0  # nat: twenty to one
WORDS = {
    "drag": "drag is {whole:.2f} times the file's ({low:.2f} to {high:.2f})",
    "lift": "lift is {whole:.2f} times the file's ({low:.2f} to {high:.2f})",
    "attitude_scale": "pitch reads {whole:.2f} of the truth ({low:.2f} to {high:.2f}) beside the file",
    "ballast_scale": "the engine moves {whole:.2f} times what it says ({low:.2f} to {high:.2f}) beside the file",
}


@dataclass(frozen=True)
class Calibration:
    """A number of the vehicle file that dives put elsewhere; sizes as the label's parameter has them."""

    label: str
    name: str
    file: float
    size: float
    sd: float
    unit: str
    within: bool  # what the file allows
    group: tuple[str, ...]  # labels that the dives do not part from this one, itself first

    @property
    def ci90(self) -> tuple[float, float]:
        return self.size - NINETY * self.sd, self.size + NINETY * self.sd

    @property
    def sentence(self) -> str:
        """For a person."""
        low, high = self.ci90
        if self.label in WORDS:
            text = WORDS[self.label].format(whole=1.0 + self.size, low=1.0 + low, high=1.0 + high)
        else:
            text = f"{self.name} is {self.size:.3g} {self.unit} beside the file's ({low:.3g} to {high:.3g})"
        text += ", which the file leaves open" if self.within else ", more than the file allows"
        others = [label for label in self.group if label != self.label]
        return text + (f"; or it is {' or '.join(others)}: these dives do not part them" if others else "")

    def plain(self) -> dict[str, Any]:
        """As it is written."""
        return {
            "label": self.label, "parameter": self.name, "file": self.file, "size": self.size, "ci90": list(self.ci90),
            "unit": self.unit, "within_file": self.within, "group": list(self.group), "text": self.sentence,
        }  # fmt: skip


def far_from_file(
    free: Sequence[FreeParameter], x: np.ndarray, normal: np.ndarray, slope: np.ndarray, P: np.ndarray,
    groups: Iterable[Sequence[str]], inflated: float | np.ndarray = 1.0,
) -> list[Calibration]:  # fmt: skip
    """Calibrations that are far from the file P, by a parabola about x (count,) in spreads of the file's.

    normal, slope: curvature with the priors', and half the derivative at x, of the misfit over the variance inflation.
    inflated: variances over those that the parabola predicts. A calibration is far if it is more likely by WIDER times
    what the file allows, or by how far its label is likely to go, than by the file; or if it is sure to be off by more
    than its label's spread, where the file leaves so much open.
    """
    names = {place: name for name, place in PLACES.items()}
    C = np.linalg.inv(normal)
    at = x - C @ slope
    spans, found = np.broadcast_to(inflated, len(free)), []
    for k, one in enumerate(free):
        name = label = ""
        if one.vector == "P" and one.entry in names:
            name = names[one.entry]
        label = one.label or LABELS.get(name, "")
        if not label or (name and name not in CALIBRATIONS):
            continue
        file = float(P[one.entry]) if name else 0.0
        unit = file if name in RELATIVE else 1.0
        allowed = 1.0 if name else 0.0  # variance by the file: none of what it has no uncertainty of
        own = max(1.0 / C[k, k] - 1.0, 1e-9)  # precision by the dives alone
        variance, mean = float(spans[k]) / own, float(at[k] / C[k, k] / own)
        effect = catalogue()[label].parameters[0]
        likely = effect.spread * abs(unit) / one.spread
        wide = max(WIDER * allowed, likely) ** 2
        gained = log_normal(mean, variance + wide) - log_normal(mean, variance + allowed)
        shrunk = wide / (wide + variance)
        size, sd = mean * shrunk, float(np.sqrt(variance * shrunk))
        certain = 0.5 * (size / sd) ** 2 >= CERTAIN_NAT
        if certain and (gained >= CERTAIN_NAT or abs(size) >= likely):
            scale = one.spread / unit
            group = next(([label, *(g for g in group if g != label)] for group in groups if label in group), [label])
            found.append(Calibration(label, name, file, float(size * scale), abs(sd * scale), effect.unit,
                                     bool(abs(size) <= NINETY * allowed), tuple(group)))  # fmt: skip
    return found


def one_of_each_group(found: Iterable[Calibration]) -> list[Calibration]:
    """The surest first; what is not parted from one that is surer is named there."""
    kept: list[Calibration] = []
    for one in sorted(found, key=lambda one: -abs(one.size / one.sd)):
        if not any(one.label in other.group or other.label in one.group for other in kept):
            kept.append(one)
    return kept


def unopened(vehicle_sigma: np.ndarray) -> list[FreeParameter]:
    """Calibrations that a file of 1 sigma (N_P,) has no uncertainty of, as the catalogue's effects have them."""
    missing = dict.fromkeys(LABELS[name] for name in CALIBRATIONS if vehicle_sigma[PLACES[name]] == 0.0)
    return [one for label in missing for one in of_effect(catalogue()[label])]


def log_normal(value: float, variance: float) -> float:
    """Log density at a value of what is normal about 0, but for a constant."""
    return -0.5 * float(value**2 / variance + np.log(variance))


def groups_of(ridges: Iterable[Sequence[str]], always: Sequence[str]) -> list[list[str]]:
    """Labels that dives do not part: of each direction in which next to nothing was learned, and what never parts."""
    found = [list(always)] if always else []
    for names in ridges:
        labels = list(dict.fromkeys(LABELS[name] for name in names))
        if len(labels) > 1 and not any(set(labels) <= set(other) for other in found):
            found = [other for other in found if not set(other) <= set(labels)] + [labels]
    return found
