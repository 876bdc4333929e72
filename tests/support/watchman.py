"""A supervisor on its own: healthy samples tick by tick, and whatever a test changes about them.

No plant and no filter: what the autopilot believes and is at is written down, so that a detector is looked at alone.
"""

import copy
import math

import msgspec
import numpy as np

from glider.firmware.autopilot import Autopilot, configuration
from glider.firmware.core.layouts import control_layout as ctl
from glider.firmware.core.layouts import supervisor_layout as sup
from glider.firmware.faults import Reaction
from glider.firmware.model.supervisor_settings import Limits
from glider.firmware.supervisor import Supervisor
from glider.hal.ports import SLOTS, Validity
from glider.tools.data.sources import load_mission, load_vehicle

DT = 0.02
SLIDER_RANGE, BALLAST_RANGE = (-0.06, 0.06), (-0.20, 0.20)
KG_PER_M = 998.2 * 0.0062


class Watchman:
    """`step()` is one tick of a flight in which all is well, but for what was changed.

    depth, pitch, roll: what the vehicle does; `silence`: sensors and actuators that say nothing; `say`: values a sensor
    gives instead; `frozen`: sensors that repeat themselves; `wanted`: what the autopilot asks for; `slow_s`: time
    between two samples of leak and battery.
    """

    def __init__(self, *, limits: Limits | None = None, mode: float = ctl.FLYING, fitted: tuple = (),
                 site: float = 1000.0, dt: float = DT, slow_s: float = 0.2, **settings):  # fmt: skip
        self.dt, periods = dt, {"imu": dt, "beacon": 2 * dt, "wires": 2 * dt, "leak": slow_s, "battery": slow_s}
        vehicle = load_vehicle("roughie")
        table = msgspec.structs.replace(vehicle.supervisor, **settings)
        vehicle = msgspec.structs.replace(vehicle, limits=limits, supervisor=table)
        _, source, mission = load_mission("sawtooth")
        mission = msgspec.structs.replace(mission, site=msgspec.structs.replace(mission.site, depth_m=site))
        C = configuration(vehicle, mission, dt=dt, periods=periods)
        self.pilot = Autopilot(vehicle, mission, C, source)
        self.supervisor = Supervisor(self.pilot, vehicle, mission, dt=dt, periods=periods)
        self.slow = max(1, round(slow_s / dt))  # ticks between two samples of leak and battery
        self._share()
        self.fitted = ("imu", "beacon", "slider_wire", "plunger_wire", "servo", "slider", "ballast", *fitted)
        self.t, self.number = -dt, 0
        self.depth, self.pitch, self.roll = 2.0, -0.3, 0.0
        self.sinks = 0.2  # m/s
        self.places = [0.0, 0.0]  # slider m, ballast kg
        self.follows = True  # the actuators go where they are sent
        self.wanted: list[float] = [0.0, 0.0, 0.0]
        self.silence: set[str] = set()
        self.frozen: set[str] = set()
        self.say: dict[str, tuple] = {}
        self.late: dict[str, float] = {}  # s by which a sensor's time is behind
        self.ap[ctl.MODE] = mode
        self.est[ctl.EST_DENSITY] = 998.2
        self._raw = np.full(len(self.frame), np.nan)
        self._spoken: set[str] = set()

    def copy(self) -> "Watchman":
        """Another of the same, at the same moment."""
        other = copy.deepcopy(self)
        other._share()
        return other

    def _share(self) -> None:
        """Arrays that supervisor, autopilot and this have in common."""
        self.G, self.est, self.ap = self.supervisor.G, self.pilot.est, self.pilot.ap
        self.frame, self.commands = self.pilot.frame, self.pilot.commands

    def values(self, name: str) -> tuple:
        """What a healthy sensor says now, never the same twice."""
        wobble = 1e-5 * math.sin(1.7 * self.number)
        return {
            "imu": (self.roll + wobble, self.pitch + wobble, wobble, wobble, wobble, wobble),
            "beacon": (101325.0 + 9789.0 * self.depth + wobble, 20.0),
            "slider_wire": (self.places[0] + wobble,),
            "plunger_wire": (self.places[1] / KG_PER_M + wobble,),
            "leak": (0.0,),
            "battery": (14.0 + wobble,),
        }.get(name, (0.0,))

    def _sample(self, name: str) -> None:
        slot = SLOTS[name]
        if name not in self.silence:
            values = self.say.get(name, self.values(name))
            if name not in self.frozen:
                self._raw[slot.values] = values
            self._raw[slot.time] = self.t - self.late.get(name, 0.0)
            self._raw[slot.validity] = Validity.VALID
            self._spoken.add(name)

    def step(self, ticks: int = 1) -> Reaction:
        """So many ticks; the reaction after the last."""
        for _ in range(ticks):
            self.t = round(self.t + self.dt, 9)
            self.depth += self.sinks * self.dt
            for name in self.fitted:
                due = {"imu": 1, "leak": self.slow, "battery": self.slow}.get(name, 2)
                if self.number % due == 0:
                    self._sample(name)
            for name in self._spoken:
                self.frame[SLOTS[name].all] = self._raw[SLOTS[name].all]
            self.number += 1
            self.supervisor.screen(self.t)
            self._believe()
            self.commands[:] = self.wanted
            self.ap[ctl.WANTED_SERVO : ctl.WANTED_SERVO + 3] = self.wanted
            self.supervisor.guard(self.t)
            if self.follows:
                self.places[:] = self.G[sup.SENT + 1 : sup.SENT + 3]
        return self.supervisor.reaction

    def _believe(self) -> None:
        """What `sense` would take over, where the sample is fit."""
        if self.frame[SLOTS["imu"].validity] == Validity.VALID:
            self.est[ctl.NEW_ROLL], self.est[ctl.NEW_PITCH] = self.frame[SLOTS["imu"].start + 2 :][:2]
        if self.frame[SLOTS["beacon"].validity] == Validity.VALID:
            self.est[ctl.NEW_DEPTH] = (self.frame[SLOTS["beacon"].start + 2] - 101325.0) / 9789.0
            self.est[ctl.EST_BEACON_TIME] = self.t

    def seconds(self, seconds: float) -> Reaction:
        return self.step(round(seconds / self.dt))

    def until(self, reaction: Reaction, most: float) -> float:
        """Seconds until this reaction or a higher one; fails past `most`."""
        begin = self.t
        while self.step() < reaction:
            assert self.t - begin <= most, f"{reaction.name} not within {most} s"
        return self.t - begin

    def asked(self, row: int) -> Reaction:
        """What a row asks for in this tick."""
        return Reaction(int(self.G[sup.ASKED + row]))
