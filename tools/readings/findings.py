"""What a check of the readings says, and when it says anything at all.

A finding has to be certain and to matter. Certain: CERTAIN_SIGMA standard errors (of blocks, see regression). Matters:
it moves its channel by MATERIAL_TOLERANCES of the channel's tolerance, root mean square over the flight; a constant
error by more than MATERIAL_OFFSET, since any sensor has a bias. The tolerances are those in which gaps are counted
(docs/reference/gap.md, Measures).

CERTAIN_SIGMA is far beyond a normal 5 % point: a case has some sixty comparisons, blocks are few, and what is compared
is filtered by instruments nobody knows. With it and MATERIAL_TOLERANCES no instrument of the simulated cases without a
gap is falsely flagged (docs/explanation/readings.md, How often).
"""

import math
from dataclasses import dataclass, field

from glider.tools.readings.regression import Estimate

CERTAIN_SIGMA = 6.0  # standard errors
WHOLE = ("sign", "units", "axes")  # findings that are right or wrong, and have no size to fit
MATERIAL_TOLERANCES = 0.1  # of a tolerance
MATERIAL_OFFSET = 0.35  # of a tolerance; 3.5 sigma of the bias of the sensors that the vehicle is shipped with
TOLERANCE = {
    "roll_rad": math.radians(1.5), "pitch_rad": math.radians(1.5), "yaw_rad": math.radians(4.0),
    "p_rad_s": math.radians(2.0), "q_rad_s": math.radians(2.0), "r_rad_s": math.radians(2.0),
    "depth_m": 0.05, "slider_m": 0.002, "ballast_kg": 0.005,
}  # fmt: skip


@dataclass(frozen=True)
class Finding:
    """Something wrong with a reading.

    size and its 90 % interval in `unit`; `label` of the catalogue or None; `mended`: whether later stages see the
    reading put right; `values` are what the mending needs.
    """

    channel: str
    against: str
    finding: str  # scale, offset, sign, axes, units, delay, drift, held, saturated, goes_with, not_flying
    size: float
    ci90: tuple[float, float]
    unit: str
    label: str | None
    mended: bool
    text: str
    values: dict[str, float] = field(default_factory=dict)

    def plain(self) -> dict:
        """The entry in diagnosis.json (docs/reference/gap.md, Answers)."""
        return {
            "channel": self.channel, "against": self.against, "finding": self.finding, "size": self.size,
            "ci90": list(self.ci90), "unit": self.unit, "label": self.label, "mended": self.mended, "text": self.text,
        }  # fmt: skip


def certain(
    estimate: Estimate, moves: float, channel: str, null: float = 0.0, least_motion: float = MATERIAL_TOLERANCES
) -> bool:
    """Whether an estimate is a finding: sure, and moving its channel by enough (`moves`, in the channel's unit)."""
    return estimate.sigma(null) >= CERTAIN_SIGMA and moves >= least_motion * TOLERANCE[channel]


def spoken(value: float, interval: tuple[float, float], unit: str = "") -> str:
    """A size with its 90 % interval, as one says it."""
    low, high = interval
    tail = f" {unit}" if unit and unit != "1" else ""
    return f"{value:.3g}{tail} (90 %: {low:.3g} to {high:.3g})"
