"""A blind test made: cases drawn, flown and written on all cores, what is there kept, answers sealed at the end."""

import os
import shutil
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from glider.firmware.model.vehicle import Vehicle
from glider.tools.data.errors import InputError
from glider.tools.data.files import write_bytes
from glider.tools.data.sources import load_vehicle
from glider.tools.study.workers import end_with_parent
from glider.tools.verify.challenge import seal
from glider.tools.verify.challenge.cases import NoCase, answer, draw_case, write
from glider.tools.verify.challenge.plan import Counts, plan

VEHICLE = "roughie"
MAKING = ".making"  # answers until they are sealed


@dataclass(frozen=True)
class Order:
    """What is to be made and where."""

    out: Path
    seed: int
    counts: Counts
    archive: Path
    messy: bool = False

    @property
    def plain(self) -> dict[str, Any]:
        found = {"seed": self.seed, "vehicle": VEHICLE, "counts": asdict(self.counts)}
        return found | {"messy": True} if self.messy else found

    @property
    def cases(self) -> Path:
        return self.out / "cases"

    @property
    def held(self) -> Path:
        """Where the other runs of each case go."""
        return self.out / "held"

    @property
    def folders(self) -> tuple[Path, ...]:
        """The folders in which a case has runs: the cases' first."""
        return self.cases, self.held

    @property
    def making(self) -> Path:
        return self.out / MAKING

    def plans(self) -> list:
        """The cases in their order."""
        return plan(self.seed, self.counts, self.messy)

    def draw(self, case: Any, vehicle: Vehicle) -> dict[str, Any]:
        """Draw and write one case; its answer. NoCase where it cannot be drawn."""
        made = draw_case(self.seed, case, vehicle)
        write(made, self.cases, self.held)
        return answer(made)


def make_one(order: Order, case: Any, vehicle: Vehicle) -> str | None:
    """Draw and write one case, its answer last; what went wrong, if no such case can be drawn."""
    for folder in order.folders:
        shutil.rmtree(folder / case.name, ignore_errors=True)  # cut off in the middle
    try:
        found = order.draw(case, vehicle)
    except NoCase as error:
        return str(error)
    write_bytes(order.making / f"{case.name}.json", seal.as_json(found))
    return None


def _prepare(order: Order) -> bool:
    """Make the folders; whether everything has been made and sealed already."""
    manifest = order.out / seal.MANIFEST
    if manifest.exists():
        sealed = seal.open_answers(order.archive, ())
        seal.check_seal(sealed, manifest)
        if sealed.plan != order.plain:
            raise InputError(
                "holds another blind test (other seed, counts or kind): name another folder", source=order.out
            )
        return True
    for folder in (*order.folders, order.making, order.archive.parent):
        folder.mkdir(parents=True, exist_ok=True)
    begun = order.making / seal.PLAN
    if begun.exists() and seal.read_object(begun.read_bytes(), begun) != order.plain:
        raise InputError("holds the beginning of another blind test: name another folder", source=order.out)
    if not begun.exists():
        if any(any(folder.iterdir()) for folder in order.folders):
            raise InputError("already holds cases of something else: name another folder", source=order.out)
        write_bytes(begun, seal.as_json(order.plain))
    return False


def missing(order: Order, cases: list) -> list:
    """The cases that are not there yet."""
    return [case for case in cases if not (order.making / f"{case.name}.json").exists()]


def make(order: Order, jobs: int = 0, advance: Callable[[int], None] = lambda n: None) -> tuple[int, list[str]]:
    """Make what is missing and seal; cases made now, and what could not be made (then nothing is sealed).

    jobs: processes, 0 for one a core. The result depends on the seed and the counts alone.
    """
    cases = order.plans()
    if _prepare(order):
        advance(len(cases))
        return 0, []
    todo, failed = missing(order, cases), []
    advance(len(cases) - len(todo))
    vehicle = load_vehicle(VEHICLE)
    here = todo if jobs == 1 else todo[:1]  # the first compiles the kernels into the cache that the processes share
    for case in here:
        failed.append(make_one(order, case, vehicle))
        advance(1)
    spawn = get_context("spawn")
    with ProcessPoolExecutor(jobs or os.cpu_count(), mp_context=spawn, initializer=end_with_parent) as pool:
        waiting = [pool.submit(make_one, order, case, vehicle) for case in todo[len(here) :]]
        try:
            for done in as_completed(waiting):
                failed.append(done.result())
                advance(1)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    wrong = sorted(error for error in failed if error)
    if not wrong:
        _seal(order, cases)
    return len(todo), wrong


def _seal(order: Order, cases: list) -> None:
    answers = {}
    for case in cases:
        path = order.making / f"{case.name}.json"
        answers[case.name] = seal.read_object(path.read_bytes(), path)
    sha256 = seal.seal(order.archive, order.plain, answers)
    seal.write_manifest(order.out / seal.MANIFEST, order.archive, sha256, *order.folders)
    shutil.rmtree(order.making)
