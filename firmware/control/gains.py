"""Gains of the baseline controllers: read from the vehicle or the mission file, the mission's word counting first."""

from typing import Annotated, Literal

import msgspec

from firmware.model.strict import Table

NonNegative = Annotated[float, msgspec.Meta(ge=0.0, le=1e4)]
Bandwidth = Annotated[float, msgspec.Meta(gt=0.0, le=10.0)]
Damping = Annotated[float, msgspec.Meta(ge=0.3, le=3.0)]


class ReferenceTable(Table):
    """Second-order reference filter: natural frequency (rad/s) and damping ratio."""

    wn: Bandwidth
    zeta: Damping = 1.0


class PitchGains(Table):
    """Slider (m) against pitch error (rad). Defaults set on the nominal vehicle."""

    kp: NonNegative = 0.2
    ki: NonNegative = 0.03
    kd: NonNegative = 0.35
    reference: ReferenceTable = ReferenceTable(wn=0.4)


class DepthGains(Table):
    """Ballast (kg) against depth error (m)."""

    kp: NonNegative = 0.4
    ki: NonNegative = 0.01
    kd: NonNegative = 1.5
    reference: ReferenceTable = ReferenceTable(wn=0.1)
    rate_bandwidth: Bandwidth = 2.0  # rad/s, of the observer that makes depth rate from depth


class RollGains(Table):
    """Servo (rad) against roll error (rad), beside the feedforward: equation (37)."""

    kp: NonNegative = 0.3
    kd: NonNegative = 0.2
    reference: ReferenceTable = ReferenceTable(wn=0.8)


class HeadingGains(Table):
    """Roll (rad) against heading error (rad) and yaw rate (rad/s), for legs that hold a heading."""

    kp: NonNegative = 1.0
    kd: NonNegative = 2.0


class Control(Table):
    """[control]: gains of the loops; what is left out keeps its default."""

    pitch: PitchGains = PitchGains()
    depth: DepthGains = DepthGains()
    roll: RollGains = RollGains()
    heading: HeadingGains = HeadingGains()
    estimator: Literal["measured", "filter"] = "filter"
