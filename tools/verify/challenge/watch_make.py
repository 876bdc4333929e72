"""A blind test of `glider gap watch` made: as make.py does, with the runs before the change for held ones."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from glider.firmware.model.vehicle import Vehicle
from glider.tools.verify.challenge.make import VEHICLE, Order
from glider.tools.verify.challenge.watch_answer import REFERENCE
from glider.tools.verify.challenge.watch_cases import draw_vehicle, watch_answer, write_vehicle
from glider.tools.verify.challenge.watch_plan import VehiclePlan, WatchCounts, watch_plan


@dataclass(frozen=True)
class WatchOrder(Order):
    """What is to be made and where."""

    counts: WatchCounts  # type: ignore[assignment]

    @property
    def plain(self) -> dict[str, Any]:
        return {"seed": self.seed, "vehicle": VEHICLE, "watch": asdict(self.counts)}

    @property
    def held(self) -> Path:
        return self.out / REFERENCE

    def plans(self) -> list[VehiclePlan]:
        return watch_plan(self.seed, self.counts)

    def draw(self, case: VehiclePlan, vehicle: Vehicle) -> dict[str, Any]:
        made = draw_vehicle(self.seed, case, self.counts, vehicle)
        write_vehicle(made, self.counts, self.cases, self.held)
        return watch_answer(made, self.counts)
