"""The supervisor of one flight: screens samples before the autopilot's tick, has the last word after it.

The readable face of core/screening and core/supervisor, which do the work without allocation.
"""

import math

import numpy as np

from glider.firmware.autopilot import Autopilot
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.core.supervision.screening import screen
from glider.firmware.core.supervision.supervisor import guard
from glider.firmware.faults import FAULTS, Reaction
from glider.firmware.guidance.mission import Mission
from glider.firmware.model.supervisor_settings import Limits, settings_vector
from glider.firmware.model.vehicle import Vehicle


class Supervisor:
    """Watches one autopilot. `G` is its whole memory; the runtime writes LATENESS, RECORDER and GROWTH into it."""

    def __init__(
        self, autopilot: Autopilot, vehicle: Vehicle, mission: Mission, *, dt: float, periods: dict[str, float],
        restarted: bool = False,
    ):  # fmt: skip
        self.autopilot = autopilot
        self.G = settings_vector(
            vehicle.limits or Limits(), vehicle.supervisor, dt=dt, periods=periods, site_depth=mission.site.depth_m,
            mission_time=mission.time_limit_s, restarted=restarted,
        )  # fmt: skip
        self.table = vehicle.supervisor
        self._said = np.zeros(sup.N_ROWS)

    def screen(self, t: float) -> None:
        """Before the autopilot's tick at time t (s): what is not fit is marked in its frame."""
        screen(self.autopilot.P, self.G, self.autopilot.frame, t)

    def guard(self, t: float) -> None:
        """After it: the autopilot's commands become what may be sent; NaN: an actuator is left alone."""
        pilot = self.autopilot
        guard(pilot.P, pilot.C, self.G, pilot.frame, pilot.est, pilot.ap, pilot.commands, t)

    @property
    def reaction(self) -> Reaction:
        """What is done now."""
        return Reaction(int(self.G[sup.HIGHEST]))

    @property
    def row(self) -> int:
        """Row of the fault table that asked for it; 0: none."""
        return int(self.G[sup.HIGHEST_ROW])

    def noticed(self, row: int) -> float | None:
        """When a row asked for anything for the first time, s; None: never."""
        first = float(self.G[sup.FIRST + row])
        return None if first < 0.0 else first

    def worst(self, row: int) -> Reaction:
        """The highest reaction that a row ever asked for."""
        return Reaction(int(self.G[sup.WORST + row]))

    def disable(self, row: int) -> None:
        """Switch a row's detector off: to show that it is what notices the fault."""
        self.G[sup.ENABLED + row] = 0.0

    def news(self) -> list[tuple[Reaction, str]]:
        """Rows that ask for more than when this was last called, with their names."""
        worst = self.G[sup.WORST : sup.WORST + sup.N_ROWS]
        rows = np.flatnonzero(worst > self._said)
        self._said[:] = worst
        return [(Reaction(int(worst[row])), f"fault {row}: {FAULTS[int(row)]}") for row in rows]

    def measured_depth(self) -> float:
        """Depth by the newest fit sample of the beacon, m; NaN once it has had nothing fit to say for too long."""
        age = float(self.G[sup.CLOCK]) - float(self.G[sup.TAKEN + sup.SENSOR_BEACON])
        known = age <= float(self.G[sup.LOST_AFTER + sup.SENSOR_BEACON])
        return float(self.autopilot.est[ctl.NEW_DEPTH]) if known else math.nan

    @property
    def surface_depth(self) -> float:
        """Depth, m, above which the vehicle is at the surface."""
        return float(self.G[sup.SURFACE_DEPTH])
