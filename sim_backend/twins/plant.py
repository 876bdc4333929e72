"""The vehicle behind the twins: on a stand, where only its actuators move, until it is let go; then it flies.

The flight's world starts afresh when it is let go, so the same seed gives the same disturbance as on the simulated
board.
"""

from typing import Any

import numpy as np

from glider.firmware.core.maths.rotations import quaternion_from_euler
from glider.firmware.core.vehicle.layout import X_ACT, X_NU, X_POS, X_QUAT
from glider.hal.ports import BEACON, IMU, PLUNGER_WIRE, SLIDER_WIRE
from glider.sim_backend.core import layout as wl
from glider.sim_backend.core.effects.effect_layout import X_LAG
from glider.sim_backend.world import Environment, SampledSensor, SampledSensors, Start, World, build_world

AT_ONCE = SampledSensor(rate_hz=100.0, delay_s=0.0)  # the lines add the delays
CMD_SERVO, CMD_SLIDER, CMD_BALLAST = 0, 1, 2


class TwinPlant:
    """`advance(t)` moves it; readings are of the newest sample, noise and bias as the vehicle file has them."""

    def __init__(self, vehicle: Any, environment: Environment, start: Start, seed: int, effects: dict, *, let_go: bool):
        sensors = SampledSensors(imu=AT_ONCE, beacon=AT_ONCE, slider_wire=AT_ONCE, plunger_wire=AT_ONCE)
        self._flight = build_world(vehicle, environment, sensors, start, seed, effects)
        self.world: World = build_world(vehicle, environment, sensors, start, seed, effects)
        self.kg_per_m = float(self.world.E[wl.ENV_WATER_DENSITY]) * vehicle.actuators.ballast.plunger_area
        self.free = False
        self._let_go = let_go
        self._released_at = 0.0
        self._pose = self.world.x[X_POS : X_POS + 7].copy()
        self.world.advance(0.0)

    @property
    def time(self) -> float:
        """Seconds since the twins began."""
        return self._released_at + self.world.time

    @property
    def flight_time(self) -> float:
        """Seconds since the vehicle was let go."""
        return self.world.time if self.free else 0.0

    @property
    def commands(self) -> np.ndarray:
        """Servo (rad), slider (m), ballast (kg), as its actuators are commanded."""
        return self.world.cmd

    def first_command(self) -> None:
        """The servo was commanded: whoever holds the vehicle lets it go, if that is agreed."""
        if self._let_go and not self.free:
            self.release()

    def release(self) -> None:
        """Let it go where it stands, its actuators as they are."""
        stand, self.world = self.world, self._flight
        self._released_at = stand.time
        self.world.x[X_ACT:X_LAG] = stand.x[X_ACT:X_LAG]  # and what hangs behind their play
        self.world.cmd[:] = stand.cmd
        self.world.advance(0.0)
        self.free = True

    def pose(self, roll: float, pitch: float, yaw: float, depth: float) -> None:
        """Turn the stand (rad), and lower it into the water (m)."""
        self._pose[:3] = 0.0, 0.0, depth
        self._pose[3:] = quaternion_from_euler(roll, pitch, yaw)

    def step(self) -> None:
        """One plant step."""
        world = self.world
        if not self.free:
            world.x[X_POS : X_QUAT + 4] = self._pose
            world.x[X_NU : X_NU + 6] = 0.0
        world.advance(world.time + world.dt)

    def imu(self) -> tuple[float, ...]:
        """Roll, pitch, yaw (rad), p, q, r (rad/s)."""
        values = self.world.frame[IMU + 2 : IMU + 8].copy()
        if not self.free:  # the stand holds it; what it would turn in one step is no motion
            values[3:] -= self.world.x[X_NU + 3 : X_NU + 6]
        return tuple(values.tolist())

    def pressure(self) -> tuple[float, float]:
        """Absolute pressure (Pa) and temperature (deg C)."""
        return float(self.world.frame[BEACON + 2]), float(self.world.frame[BEACON + 3])

    def wire(self, name: str) -> float:
        """A draw-wire, m."""
        return float(self.world.frame[(SLIDER_WIRE if name == "slider_wire" else PLUNGER_WIRE) + 2])

    def actuator(self, index: int) -> float:
        """Where the slider or the plunger is, m; the servo, rad."""
        value = float(self.world.x[X_ACT + index])
        return value / self.kg_per_m if index == CMD_BALLAST else value

    def drive(self, index: int, metres: float) -> None:
        """Move the slider's or the plunger's drive to a place, m."""
        self.world.cmd[index] = metres * self.kg_per_m if index == CMD_BALLAST else metres

    def state(self) -> dict[str, float]:
        """The truth, for people and tests."""
        return {"flight_s": self.flight_time, **self.world.truth()}
