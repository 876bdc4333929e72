"""Gains of the baseline controllers: read from the vehicle or the mission file, the mission's word counting first."""

from typing import TYPE_CHECKING, Annotated, Literal

import msgspec

from glider.firmware.core.control.controller_rows import CONTROLLERS
from glider.hal.strict import Table

if TYPE_CHECKING:
    Name = str
else:
    Name = Literal[tuple(CONTROLLERS)]

NonNegative = Annotated[float, msgspec.Meta(ge=0.0, le=1e4)]
Bandwidth = Annotated[float, msgspec.Meta(gt=0.0, le=10.0)]
Damping = Annotated[float, msgspec.Meta(ge=0.3, le=3.0)]


class ReferenceTable(Table):
    """Second-order reference filter: natural frequency (rad/s) and damping ratio."""

    wn: Bandwidth
    zeta: Damping = 1.0


class PitchGains(Table):
    """Slider (m) against pitch error (rad).

    Defaults by the rule of `glider tune` on the nominal vehicle (docs/how-to/tuning.md): 60 deg of phase margin at
    three times
    the reference filter's natural frequency, Ti = 2 Td, at the worse of a dive and a climb at 20 deg.
    """

    kp: NonNegative = 0.121
    ki: NonNegative = 0.0519
    kd: NonNegative = 0.142
    reference: ReferenceTable = ReferenceTable(wn=0.4)


class DepthGains(Table):
    """Ballast (kg) against depth error (m).

    Defaults by the same rule; the ballast's rate holds the crossover at 0.29 rad/s, a little below three times.
    """

    kp: NonNegative = 0.577
    ki: NonNegative = 0.101
    kd: NonNegative = 1.64
    reference: ReferenceTable = ReferenceTable(wn=0.1)
    rate_bandwidth: Bandwidth = 2.9  # rad/s, of the observer that makes depth rate from depth


class RollGains(Table):
    """Servo (rad) against roll error (rad), beside the feedforward: equation (37)."""

    kp: NonNegative = 0.3
    kd: NonNegative = 0.2
    reference: ReferenceTable = ReferenceTable(wn=0.8)


class HeadingGains(Table):
    """Roll (rad) against heading error (rad) and yaw rate (rad/s), for legs that hold a heading."""

    kp: NonNegative = 1.0
    kd: NonNegative = 2.0


Gain = Annotated[float, msgspec.Meta(gt=0.0, le=1e3)]


class LawGains(Table):
    """One axis of the law: k1, k3 in 1/s, k2 in the actuator's unit (m, kg), eps in the unit of s (rad/s, m/s)."""

    k1: Gain
    k2: Gain
    k3: Gain
    eps: Gain


class HybridTable(Table):
    """When the hybrid hands over to the law, and back: pitch still to go (rad), depth off its reference (m).

    The noise scale is the disturbance that the filter sees over the one in the vehicle file, 1 in calm water.
    """

    roughness_on: Gain = 8.0
    roughness_off: Gain = 4.0
    pitch_on: Gain = 0.06
    pitch_off: Gain = 0.02
    depth_on: Gain = 0.3
    depth_off: Gain = 0.1
    dwell_s: NonNegative = 3.0

    def __post_init__(self):
        for name in ("roughness", "pitch", "depth"):
            if not getattr(self, f"{name}_off") < getattr(self, f"{name}_on"):
                raise ValueError(f"{name}_off: expected less than {name}_on, or the hybrid would chatter")


class Law(Table):
    """[control.law] and [control.law_plus]: gains of both axes, the form of the model, the share of the observed error.

    Defaults by a search over the paper's pitch manoeuvres and rough water (docs/how-to/tuning.md).
    """

    pitch: LawGains = LawGains(k1=1.55, k2=0.0045, k3=0.8, eps=0.1)
    depth: LawGains = LawGains(k1=0.2, k2=0.05, k3=0.9, eps=0.14)
    form: Literal["exact", "paper"] = "exact"
    observer_share: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 1.0


class LawPlus(Law):
    """[control.law_plus]: what braking lets law+ afford."""

    pitch: LawGains = LawGains(k1=1.5, k2=0.008, k3=1.8, eps=0.1)
    depth: LawGains = LawGains(k1=0.6, k2=0.05, k3=0.8, eps=0.2)


class Control(Table):
    """[control]: gains of the loops; what is left out keeps its default."""

    pitch: PitchGains = PitchGains()
    depth: DepthGains = DepthGains()
    roll: RollGains = RollGains()
    heading: HeadingGains = HeadingGains()
    estimator: Literal["measured", "filter"] = "filter"
    controller: Name = "pid"
    law: Law = Law()
    law_plus: LawPlus = LawPlus()
    hybrid: HybridTable = HybridTable()

    def __post_init__(self):
        if CONTROLLERS[self.controller].needs_velocities and self.estimator == "measured":
            raise ValueError(f"controller {self.controller!r} needs body velocities: estimator = 'filter'")

    @property
    def law_flown(self) -> Law:
        """The law's gains under this controller."""
        law: Law = getattr(self, CONTROLLERS[self.controller].law_gains)
        return law


# The best-tuned PID: gains that track the paper's manoeuvres under noise best, whatever their margins
# (docs/how-to/tuning.md).
BEST_TUNED = Control(pitch=PitchGains(kp=0.214, ki=0.0652, kd=0.279), depth=DepthGains(kp=0.949, ki=0.00112, kd=2.84))
