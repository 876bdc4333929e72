"""Steps of the nominal plant in a second, many vehicles at once on one core, beside one after the other.

No two vehicles are alike: each has parameters, commands and a current of its own.
"""

from typing import Any

import numpy as np

from glider.firmware.core.maths.wide import LANES
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.batch import nominal_batch
from glider.firmware.core.vehicle.flight import nominal_run
from glider.tools.verify.benchmark.timing import seconds

VEHICLES = 64
SPREAD = 0.05  # of every parameter and command, either way
CURRENT = 0.1  # m/s, either way


class Fleet:
    """Vehicles about one, all starting alike."""

    def __init__(self, P: np.ndarray, commands: tuple, start: np.ndarray, dt: float) -> None:
        rng = np.random.default_rng(0)
        self.Ps = P * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD, (VEHICLES, len(P)))
        self.commands = np.array(commands) * rng.uniform(1.0 - SPREAD, 1.0 + SPREAD, (VEHICLES, 3))
        self.waters = rng.uniform(-CURRENT, CURRENT, (VEHICLES, 3))
        self.start, self.dt = start, dt

    def states(self) -> np.ndarray:
        """All of them at the beginning, (VEHICLES, N_X)."""
        return np.tile(self.start, (VEHICLES, 1))

    def speed(self, steps: int) -> float:
        """Steps per second, those of all vehicles together."""
        xs = self.states()
        took = seconds(lambda: nominal_batch(self.Ps, xs, self.commands, self.waters, self.dt, steps))
        return VEHICLES * steps / took

    def difference(self, steps: int) -> float:
        """Largest difference of a last state from that of the kernel of one vehicle."""
        many, alone, work = self.states(), self.states(), np.zeros((3, layout.N_X))
        nominal_batch(self.Ps, many, self.commands, self.waters, self.dt, steps)
        for P, x, command, water in zip(self.Ps, alone, self.commands, self.waters, strict=True):
            nominal_run(P, x, *command, *water, self.dt, steps, work)
        return float(np.abs(many - alone).max())

    def found(self, steps: int) -> dict[str, Any]:
        """What is said of the batch beside its speed."""
        return {"vehicles": VEHICLES, "lanes": LANES, "max_state_difference": self.difference(steps)}
