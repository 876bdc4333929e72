"""What to fly next, in a pilot's words: the dives that part labels, by how the vehicle was flown."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from glider.tools.data.runs.run import Run
from glider.tools.inference.ocean_inputs import OTHER_DEPTH, OTHER_OIL, OTHER_PITCH, regime

PITCH_CHANGE_DEG, RANGE_SHARE, FLATTEST_PITCH_DEG, STEEPEST_PITCH_DEG = (
    8.0,
    0.5,
    14.0,
    40.0,
)  # degrees; of oil or depth; degrees that are asked for


@dataclass(frozen=True)
class FlownRange:
    """How the dives were flown, as a pilot commands it: degrees of pitch, cm3 of oil, m of depth."""

    depth: float
    pitch_down: float
    pitch_up: float
    oil_down: float
    oil_up: float

    @property
    def pitches(self) -> str:
        """The two angles to ask for instead."""
        steep = np.clip(
            max(abs(self.pitch_down), self.pitch_up) + PITCH_CHANGE_DEG, FLATTEST_PITCH_DEG, STEEPEST_PITCH_DEG
        )
        flat = np.clip(
            min(abs(self.pitch_down), self.pitch_up) - PITCH_CHANGE_DEG, FLATTEST_PITCH_DEG, STEEPEST_PITCH_DEG
        )
        was = f"they were {abs(self.pitch_down):.0f} down, {self.pitch_up:.0f} up"
        return f"{steep:.0f} degrees of pitch and two at {flat:.0f} degrees ({was})"

    @property
    def less_oil(self) -> str:
        """Half the drive, either way about the middle."""
        middle, half = 0.5 * (self.oil_up + self.oil_down), 0.5 * RANGE_SHARE * (self.oil_up - self.oil_down)
        was = f"it was {self.oil_down:.0f} and {self.oil_up:.0f}"
        return f"oil {middle - half:.0f} cm3 down and {middle + half:.0f} cm3 up ({was})"


def flown(runs: Sequence[Run]) -> FlownRange | None:
    """The medians over runs; None where they do not glide both ways."""
    units = np.array([OTHER_DEPTH, np.degrees(OTHER_PITCH), 1e6 * OTHER_OIL, np.degrees(OTHER_PITCH), 1e6 * OTHER_OIL])
    table = np.array([regime(run) for run in runs]) * units
    if not np.isfinite(table).any(axis=0).all():
        return None
    depth, pitch_down, oil_down, pitch_up, oil_up = np.nanmedian(table, axis=0)
    return FlownRange(depth, pitch_down, pitch_up, oil_down, oil_up)


def _angles(one: FlownRange) -> str:
    return f"command two dives at {one.pitches}, down and up alike, oil as before"


def _oil(one: FlownRange) -> str:
    return f"command two dives with {one.less_oil}, pitch as before"


def _depth(one: FlownRange) -> str:
    shallower = RANGE_SHARE * one.depth
    return f"command two dives to {shallower:.0f} m (they went to {one.depth:.0f} m), pitch and oil as before"


def _speed(one: FlownRange) -> str:
    return f"{_angles(one)}; a speed log or an ADCP parts them surely"


def _water(one: FlownRange) -> str:
    return f"{_depth(one)}, and two where the water is colder or warmer"


def _sample(one: FlownRange) -> str:
    return "no dive parts weight from density: lower a CTD beside the vehicle, or hold its deep salinity against others"


PARTED_BY = (
    (("drag", "lift", "attitude_scale"), _speed),
    (("ballast_scale", "drag", "attitude_scale", "net_buoyancy"), _oil),
    (("compressibility", "thermal_expansion", "ballast_leak"), _water),
    (("net_buoyancy", "density_bias"), _sample),
    (("imu_pitch_bias", "climb_dive_asymmetry", "net_buoyancy", "density_bias"), _angles),
    (("compressibility", "net_buoyancy", "density_bias"), _depth),
)  # labels, of which two at least are not parted, and what parts them


def to_part(groups: Iterable[Sequence[str]], how: FlownRange | None) -> str:
    """What to command so that the labels of each group are distinguished; nothing where nobody knows."""
    if how is None:
        return ""
    questions: dict[str, None] = {}
    for group in groups:
        listed, words = max(PARTED_BY, key=lambda one: len(set(one[0]) & set(group)))
        if len(set(listed) & set(group)) > 1:
            questions[words(how)] = None
    return "; ".join(questions)


def to_find(regime_words: str, how: FlownRange | None) -> str:
    """What to command where no label explains what is left: by which of them it goes tells what it is."""
    if how is None:
        return ""
    where = f"; it is mostly {regime_words}, look there" if regime_words else ""
    return (
        "switch off whatever can push or pull (thruster, towed instrument) and command two dives as before; then two "
        f"with {how.less_oil}; then one on the reverse heading: what goes with the oil weighs or drags, what goes with "
        f"the heading is the current or the compass, what stays is the vehicle's own{where}"
    )
