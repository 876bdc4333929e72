"""Missions: legs of depth or time with pitch, roll and ballast, as a strict file and as the kernels' matrix."""

import math
from typing import Annotated, Literal

import msgspec
import numpy as np

from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.model.gains import Control
from glider.firmware.model.vehicle import Vehicle
from glider.hal.strict import ConfigError, Table, decode

Seconds = Annotated[float, msgspec.Meta(gt=0.0, le=86400.0)]
PitchAngle = Annotated[float, msgspec.Meta(ge=-75.0, le=75.0)]
RollAngle = Annotated[float, msgspec.Meta(ge=-60.0, le=60.0)]
Depth = Annotated[float, msgspec.Meta(ge=0.0, le=1000.0)]


class Site(Table):
    """Where the mission is flown."""

    name: Annotated[str, msgspec.Meta(min_length=1, max_length=100)]
    depth_m: Annotated[float, msgspec.Meta(gt=0.0, le=1000.0)]  # of the water; deeper than this aborts
    salinity: Annotated[float, msgspec.Meta(ge=0.0, le=42.0)] = 0.0  # PSU
    clearance_m: Annotated[float, msgspec.Meta(ge=0.0, le=100.0)] = 0.5  # kept from the bottom


class Leg(Table):
    """One leg: to a depth (depth_m), for a time (duration_s) or through a turn (turned_deg). Degrees, nose up positive.

    A leg rolls by roll_deg; with `turn` it rolls to whichever side turns the vehicle that way, diving or climbing; with
    heading_deg it holds that heading by rolling up to roll_deg either way.
    """

    pitch_deg: PitchAngle
    roll_deg: RollAngle = 0.0
    turn: Literal["starboard", "port"] | None = None
    heading_deg: Annotated[float, msgspec.Meta(ge=-360.0, le=360.0)] | None = None
    depth_m: Depth | None = None
    turned_deg: Annotated[float, msgspec.Meta(gt=0.0, le=7200.0)] | None = None
    time_limit_s: Seconds | None = None
    duration_s: Seconds | None = None
    ballast_kg: float | None = None  # held; without it the depth loop commands the ballast
    hold_s: Annotated[float, msgspec.Meta(ge=0.0, le=86400.0)] = 0.0
    tolerance_m: Annotated[float, msgspec.Meta(gt=0.0, le=10.0)] = 0.2

    def __post_init__(self):
        ends = [name for name in ("depth_m", "duration_s", "turned_deg") if getattr(self, name) is not None]
        if len(ends) != 1:
            raise ValueError(
                "expected one of depth_m (a leg to a depth), duration_s (for a time), turned_deg (through a turn), "
                f"got {' and '.join(ends) or 'none of them'}"
            )
        if self.duration_s is None and self.time_limit_s is None:
            raise ValueError("time_limit_s: a leg to a depth or through a turn needs one; past it the dive is given up")
        if self.duration_s is not None and self.time_limit_s is not None:
            raise ValueError("time_limit_s: a leg for a time has its duration_s, and no limit beside it")
        if self.depth_m is None and self.hold_s:
            raise ValueError("hold_s: belongs to a leg to a depth")
        if self.turn is not None and self.heading_deg is not None:
            raise ValueError("turn, heading_deg: a leg turns or holds a heading, not both")
        steers = self.turn is not None or self.heading_deg is not None
        if steers and self.roll_deg <= 0.0:
            raise ValueError("roll_deg: a leg that turns or holds a heading needs one above 0, the most it may roll")
        if self.turned_deg is not None and (self.heading_deg is not None or not self.roll_deg):
            raise ValueError("turned_deg: a leg through a turn needs a roll_deg and holds no heading")


class Mission(Table):
    """A mission file."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    name: Annotated[str, msgspec.Meta(min_length=1, max_length=100)]
    time_limit_s: Seconds
    site: Site
    leg: Annotated[list[Leg], msgspec.Meta(min_length=1, max_length=1000)]
    description: str = ""
    control: Control | None = None

    def __post_init__(self):
        deepest = self.site.depth_m - self.site.clearance_m
        for number, leg in enumerate(self.leg):
            if leg.depth_m is not None and leg.depth_m > deepest:
                raise ValueError(
                    f"leg[{number}].depth_m: {leg.depth_m} m is deeper than the site allows "
                    f"({self.site.depth_m} m less {self.site.clearance_m} m clearance)"
                )
        if all(leg.depth_m is None and leg.ballast_kg is None for leg in self.leg):
            raise ValueError("no leg has a depth_m or a ballast_kg: the mission would go nowhere")

    def matrix(self, vehicle: Vehicle, source: str) -> np.ndarray:
        """The legs as the kernels take them, shape (legs, N_LEG), SI; ConfigError where the vehicle cannot do it."""
        low, high = vehicle.actuators.ballast.range
        legs = np.full((len(self.leg), ctl.N_LEG), math.nan)
        for row, leg in enumerate(self.leg):
            if leg.ballast_kg is not None and not low <= leg.ballast_kg <= high:
                message = f"{leg.ballast_kg} kg is outside {vehicle.name}'s {low} to {high} kg"
                raise ConfigError(source, message, key=f"leg[{row}].ballast_kg")
            legs[row, ctl.LEG_PITCH] = math.radians(leg.pitch_deg)
            legs[row, ctl.LEG_ROLL] = math.radians(leg.roll_deg)
            legs[row, ctl.LEG_HOLD] = leg.hold_s
            legs[row, ctl.LEG_TOLERANCE] = leg.tolerance_m
            for index, value in (
                (ctl.LEG_DEPTH, leg.depth_m),
                (ctl.LEG_BALLAST, leg.ballast_kg),
                (ctl.LEG_TIME_LIMIT, leg.time_limit_s),
                (ctl.LEG_DURATION, leg.duration_s),
                (ctl.LEG_TURN, None if leg.turn is None else (1.0 if leg.turn == "starboard" else -1.0)),
                (ctl.LEG_HEADING, None if leg.heading_deg is None else math.radians(leg.heading_deg)),
                (ctl.LEG_TURNED, None if leg.turned_deg is None else math.radians(leg.turned_deg)),
            ):
                if value is not None:
                    legs[row, index] = value
        return legs


def decode_mission(text: str, source: str) -> Mission:
    """A mission file's text as a Mission; raises ConfigError with file, line and key."""
    return decode(text, Mission, source)
