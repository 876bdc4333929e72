"""A blind test of `glider gap watch` on missions of ocean gliders made: as watch_make.py does, with dives for runs."""

from dataclasses import asdict, dataclass
from typing import Any

from glider.firmware.model.vehicle import Vehicle
from glider.tools.verify.challenge.ocean_cases import draw_case, mission_answer, write_dives
from glider.tools.verify.challenge.ocean_plan import MissionPlan, ocean_plan
from glider.tools.verify.challenge.watch_make import WatchOrder


@dataclass(frozen=True)
class OceanOrder(WatchOrder):
    """What is to be made and where."""

    @property
    def plain(self) -> dict[str, Any]:
        return {"seed": self.seed, "ocean": asdict(self.counts)}

    def plans(self) -> list[MissionPlan]:  # type: ignore[override]
        return ocean_plan(self.seed, self.counts)

    def draw(self, case: MissionPlan, vehicle: Vehicle) -> dict[str, Any]:  # type: ignore[override]
        made = draw_case(self.seed, case, self.counts)
        first = self.counts.reference
        write_dives(self.held / case.name, case.vehicle_class, made.runs[:first])
        write_dives(self.cases / case.name, case.vehicle_class, made.runs[first:])
        return mission_answer(made, self.counts)
