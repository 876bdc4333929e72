"""Ocean gliders: attitude and buoyancy engine measured, depth and speed predicted (docs/explanation/ocean.md)."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from glider.sim_backend.ocean.vehicle import KIND as NAME
from glider.sim_backend.ocean.vehicle import OceanVehicle, decode_ocean_vehicle, shipped_vehicles
from glider.tools.data.errors import InputError, need
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import Case
from glider.tools.data.runs.run import Run
from glider.tools.data.vehicle_kinds import Identified, Say, VehicleKind, no_progress


class OceanGlider:
    """The kind (tools/data/vehicle_kinds.VehicleKind)."""

    name, group, noun, extra = NAME, "ocean", "an ocean glider", "analysis"
    sparse_rows = True
    own_columns: tuple[str, ...] = (names.OIL,)
    vehicle: type = OceanVehicle

    def shipped(self) -> Mapping[str, str]:
        """Vehicle files of sim_backend/ocean."""
        return shipped_vehicles()

    def decode(self, text: str, source: str) -> OceanVehicle:
        """A vehicle file (docs/explanation/ocean.md)."""
        return decode_ocean_vehicle(text, source)

    def equations(self) -> Any:
        """A glide that is steady but for its speed."""
        from glider.tools.inference.ocean_kind import OCEAN

        return OCEAN

    def catalogue(self) -> Mapping[str, Any]:
        """The effects of sim_backend/ocean."""
        from glider.sim_backend.ocean.catalogue import catalogue

        return catalogue()

    def model(self, name: str, vehicle: OceanVehicle) -> Any:
        """What is uncertain as [uncertainty] says, or where it was identified as its covariance."""
        from glider.tools.inference.model import ocean_model

        return ocean_model(name, vehicle)

    def numbers(self, name: str, source: str, model: Any, sd: dict[str, float]) -> Any:
        """Numbers as the vehicle file has them."""
        from glider.tools.inference.numbers_out import OceanNumbers

        return OceanNumbers(name, source, model.P, sd=sd)

    def compile(self, say: Say, progress: Callable[..., Any] = no_progress) -> None:
        """Nothing: its kernels are few, and compile when they are called."""

    def submerged(self, run: Run) -> Run:
        """The run as it is: rows at the surface are not steady, and are not looked at."""
        return run

    def readings(self, case: Case) -> Any:
        """InputError: a watch holds its readings against each other."""
        raise InputError("an ocean glider: its readings are held against each other by gap watch", source=case.folder)

    def disagreements(self, case: Case) -> list[str]:
        """None that are looked for."""
        return []

    def usable_runs(self, runs: Sequence[Run]) -> tuple[dict[int, Run], dict[int, str]]:
        """Dives that are flown steadily for long enough."""
        from glider.tools.watch.usable import usable_dives

        return usable_dives(runs)

    def speeds(self, problem: Any, learned_from: Any) -> Callable[[Any, Any, int], dict[str, Any]]:
        """Mean speed through the water of every watched dive, by the vehicle with what changed."""
        from glider.tools.watch.velocity import own_model, velocity

        own = own_model(problem, learned_from)
        return lambda history, resolved, n: velocity(own, history, resolved, n)

    def identify(self, case: Case, seed: int, likelihood: str, say: Say) -> Identified:
        """Drag, buoyancy and the attitude sensor by least squares over dives; seed and likelihood are ignored."""
        need(self.extra)
        from glider.tools.api.sentences import ocean_lines
        from glider.tools.identify.ocean import files
        from glider.tools.identify.ocean.identify import identify_ocean

        found = identify_ocean(case, say)
        notes = tuple(f"left out: {one}" for one in found.left_out)
        return Identified(
            partial(files.plain, found), partial(files.vehicle_text, found), notes, partial(files.write, found),
            partial(ocean_lines, found), report=False,
        )  # fmt: skip

    def diagnose(self, case: Case, reference: Case | None, without: str | None, say: Say) -> Callable[[Path], str]:
        """What all dives share; InputError with a reference, which a watch takes."""
        from glider.tools.report.pooled import write_pooled_report
        from glider.tools.watch import whole_case

        if reference is not None:
            message = "what changed of an ocean glider asks `glider gap watch --reference CASE0`"
            raise InputError(message, source=case.folder)
        found = whole_case.diagnose_ocean(case, say)

        def write(out: Path) -> str:
            whole_case.write(found, out)
            return write_pooled_report(out)

        return write


KIND: VehicleKind = OceanGlider()
