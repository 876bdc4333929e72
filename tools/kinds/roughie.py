"""ROUGHIE and vehicles of its form: flown by commands, six degrees of freedom, equation (4)."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from glider.firmware.model.library import shipped
from glider.firmware.model.vehicle import Vehicle, decode_vehicle
from glider.tools.data.errors import InputError, need
from glider.tools.data.runs.case import Case
from glider.tools.data.runs.run import Run
from glider.tools.data.vehicle_kinds import Identified, Say, VehicleKind, no_progress

if TYPE_CHECKING:
    from glider.tools.identify.pipeline import Identified as PoolIdentification


def _write_identified(found: "PoolIdentification", folder: Path) -> None:
    """identified.toml, identified.json, corrected.toml, posterior.nc and the report into a folder."""
    from glider.tools.identify import files
    from glider.tools.report.identified import write_report

    files.write(found, folder)
    write_report(folder / "report.html", found)


class Roughie:
    """The kind (tools/data/vehicle_kinds.VehicleKind)."""

    name, group, noun, extra = "roughie", "pool", "a ROUGHIE-like vehicle", "identify"
    sparse_rows = False
    own_columns: tuple[str, ...] = ()
    vehicle: type = Vehicle

    def shipped(self) -> Mapping[str, str]:
        """Vehicle files of firmware/model/vehicles."""
        return shipped("model/vehicles")

    def decode(self, text: str, source: str) -> Vehicle:
        """A vehicle file (docs/explanation/model.md)."""
        return decode_vehicle(text, source)

    def equations(self) -> Any:
        """Equation (4) with the catalogue's effects."""
        from glider.tools.inference.kind import ROUGHIE

        return ROUGHIE

    def catalogue(self) -> Mapping[str, Any]:
        """The effects of sim_backend/core/effects."""
        from glider.sim_backend.core.effects.catalogue import catalogue

        return catalogue()

    def model(self, name: str, vehicle: Vehicle) -> Any:
        """What is uncertain as [uncertainty] says, or where it was identified as its covariance."""
        from glider.tools.inference.model import roughie_model

        return roughie_model(name, vehicle)

    def numbers(self, name: str, source: str, model: Any, sd: dict[str, float]) -> Any:
        """Numbers with the effects that scale them folded in."""
        from glider.tools.inference.model import effect_vector
        from glider.tools.inference.numbers_out import VehicleNumbers

        return VehicleNumbers(name, source, model.P, effect_vector(model), sd)

    def compile(self, say: Say, progress: Callable[..., Any] = no_progress) -> None:
        """Compile the kernels of a diagnosis, unless that was done."""
        from glider.tools.diagnose.precompile import DIAGNOSIS
        from glider.tools.flight.precompile import ensure_compiled

        ensure_compiled(DIAGNOSIS, say, progress)

    def submerged(self, run: Run) -> Run:
        """The run without what was measured afloat."""
        from glider.tools.readings.stretches import under_water

        return under_water(run)

    def readings(self, case: Case) -> Any:
        """Readings held against each other (docs/explanation/readings.md)."""
        from glider.tools.readings.check import check

        return check(case.runs)

    def disagreements(self, case: Case) -> list[str]:
        """Sentences on readings that contradict each other."""
        from glider.tools.readings.check import disagreement

        return disagreement(case.runs)

    def usable_runs(self, runs: Sequence[Run]) -> tuple[dict[int, Run], dict[int, str]]:
        """Each run's longest stretch of flight, where it has the readings that the others have."""
        from glider.tools.watch.usable import usable_flights

        return usable_flights(runs)

    def speeds(self, problem: Any, learned_from: Any) -> None:
        """None: readings have no speed through the water that a watch would judge."""

    def identify(self, case: Case, seed: int, likelihood: str, say: Say) -> Identified:
        """The twelve coefficients by MCMC (docs/explanation/identification.md)."""
        need(self.extra)
        from glider.tools.api.sentences import identified_lines
        from glider.tools.identify import files
        from glider.tools.identify.pipeline import identify

        found = identify(case, seed, likelihood, say)
        notes = (*(f"left out: {one}" for one in found.left_out), *found.notes)
        write, lines = partial(_write_identified, found), partial(identified_lines, found)
        return Identified(found.plain, partial(files.vehicle_text, found), notes, write, lines, report=True)

    def diagnose(self, case: Case, reference: Case | None, without: str | None, say: Say) -> Callable[[Path], str]:
        """Against healthy runs, where they are given or the vehicle file knows what they leave, else by evidence."""
        from glider.tools.diagnose.gates import form_stands_out

        if reference is not None and without is not None:
            raise InputError("a part of the method is left out only without a reference", source="without")
        self.compile(say)
        if reference is not None or (without is None and form_stands_out(case.vehicle.form)):
            return self._against_healthy(case, reference, say)
        from glider.tools.diagnose import diagnosis as single
        from glider.tools.inference.rules import Rules
        from glider.tools.report.diagnosis import write_report
        from glider.tools.report.words import sentence

        found = single.diagnose(case, say, Rules() if without is None else Rules().without(without))

        def write(out: Path) -> str:
            single.write(found, out)
            return sentence(write_report(out))

        return write

    def _against_healthy(self, case: Case, reference: Case | None, say: Say) -> Callable[[Path], str]:
        from glider.tools.diagnose import against_answer
        from glider.tools.diagnose.against_healthy import diagnose_against_healthy
        from glider.tools.report.pooled import write_pooled_report

        found = diagnose_against_healthy(case, reference, say)

        def write(out: Path) -> str:
            against_answer.write(found, out)
            return write_pooled_report(out)

        return write


KIND: VehicleKind = Roughie()
