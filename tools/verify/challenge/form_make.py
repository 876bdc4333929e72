"""A blind test on vehicles of another form made: as make.py does, with healthy runs before and beside the change."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from glider.firmware.model.vehicle import Vehicle
from glider.tools.verify.challenge.form_cases import draw_form_case, form_answer, write_form_case
from glider.tools.verify.challenge.form_plan import FormCounts, FormPlan, form_plan
from glider.tools.verify.challenge.make import VEHICLE, Order
from glider.tools.verify.challenge.watch_answer import REFERENCE

HEALTHY = "healthy"


@dataclass(frozen=True)
class FormOrder(Order):
    """What is to be made and where."""

    counts: FormCounts  # type: ignore[assignment]

    @property
    def plain(self) -> dict[str, Any]:
        return {"seed": self.seed, "vehicle": VEHICLE, "form": asdict(self.counts)}

    @property
    def folders(self) -> tuple[Path, ...]:
        return self.cases, self.held, self.out / REFERENCE, self.out / HEALTHY

    def plans(self) -> list[FormPlan]:  # type: ignore[override]
        return form_plan(self.seed, self.counts)

    def draw(self, case: FormPlan, vehicle: Vehicle) -> dict[str, Any]:
        made = draw_form_case(self.seed, case, self.counts, vehicle)
        write_form_case(made, *self.folders)
        return form_answer(made)
