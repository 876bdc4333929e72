"""A force that lasts is told from water in disorder: watched, diagnosed, and by the evidence itself."""

from dataclasses import replace

import numpy as np
import pytest

from glider.sim_backend.foreign import ocean as foreign
from glider.tools.data.runs.case import load_case
from glider.tools.identify.ocean.files import vehicle_text
from glider.tools.identify.ocean.identify import BANDS, identify_ocean
from glider.tools.inference.hyperparameters import WATCH
from glider.tools.inference.problem import problem_of
from glider.tools.inference.shared_parameters import shared_parameters
from glider.tools.verify.challenge.ocean_cases import as_run, flown, with_change
from glider.tools.watch.flights import RunEnsemble
from glider.tools.watch.lasting import beside_all, lasting
from glider.tools.watch.watch import watch
from glider.tools.watch.whole_case import diagnose_ocean
from tests.support.ocean import as_case, drawn

pytestmark = pytest.mark.computes(seconds=10)

CRAFT, BEFORE, AFTER = "seaglider", 6, 4
ROUGHER = 3.0


def dives(first: int, count: int, label: str | None = None, size: float = 0.0, noise_beats_label: float = 1.0):
    """Dives of a mission by a vehicle that is changed, in water that moves so many times as much."""
    mission, runs = drawn(CRAFT, 1), []
    V = mission.V if label is None else with_change(mission.V, label, size)
    for n in range(first, first + count):
        S = mission.seas[n].copy()
        S[foreign.WATER] *= noise_beats_label
        runs.append(as_run(mission, n, flown(mission, n, V, S), False))
    return runs


@pytest.fixture(scope="module")
def before(tmp_path_factory):
    """The mission's first dives, and the vehicle's file identified from them."""
    folder = tmp_path_factory.mktemp("before")
    case = as_case(folder / "case", dives(0, BEFORE), CRAFT)
    (folder / "identified.toml").write_text(vehicle_text(identify_ocean(case)))
    return case.folder, str(folder / "identified.toml")


def watched(folder, before, runs):
    reference, vehicle = before
    return watch(load_case(as_case(folder / "case", runs, CRAFT).folder, vehicle), load_case(reference, vehicle))


@pytest.mark.parametrize(("label", "size"), [("x_thruster", 0.5), ("x_mud", 0.2)])
def test_a_force_that_lasts_is_unknown_and_no_water(before, tmp_path, label, size):
    found = watched(tmp_path, before, dives(BEFORE, AFTER, label, size))
    assert [event.label for event in found.events] == [None]
    assert [run.verdict for run in found.runs] == ["unknown"] * AFTER
    assert found.events[0].where[0]["subsystem"] in ("hydrodynamics", "mass")


def test_rougher_water_is_that_and_no_force(before, tmp_path):
    found = watched(tmp_path, before, dives(BEFORE, AFTER, noise_beats_label=ROUGHER))
    assert [event.label for event in found.events] == ["vertical_water"]


def test_a_force_that_all_dives_have_is_not_called_water(before, tmp_path):
    case = as_case(tmp_path, dives(BEFORE, AFTER, "x_thruster", 0.5), CRAFT)
    found = diagnose_ocean(load_case(case.folder, before[1]))
    assert found.verdict != "none"
    assert "vertical_water" not in found.selected


@pytest.fixture(scope="module")
def flights(before):
    """Dives as before, the first of them learned from."""
    reference, vehicle = before
    runs = [*load_case(reference, vehicle).runs, *dives(BEFORE, AFTER)]
    problem = problem_of(load_case(reference, vehicle), runs=runs)
    parts = [problem.part(n) for n in range(len(runs))]
    found = RunEnsemble(parts, shared_parameters(problem), np.arange(len(runs)) < BEFORE)
    found.learn()
    return found


def sunk(flights, rates):
    """The flights with a vertical velocity of the readings (m/s) added to each of the last dives, by way."""
    parts = list(flights.parts)
    for n, rate in zip(range(BEFORE, BEFORE + AFTER), rates, strict=True):
        part = parts[n]
        down = np.where(part.recording.inputs[:, 0] < 0.0, rate[0], rate[1])
        z = part.z.copy()
        z[:, 0] += np.cumsum(down * np.diff(part.recording.t, prepend=part.recording.t[:1]))
        parts[n] = part.reading(z)
    found = replace(flights, parts=parts)
    found.deviations, found.raw = {}, [found.expanded(n, found.values) for n in range(len(parts))]
    return lasting(found, range(BEFORE, BEFORE + AFTER), np.ones(len(parts)))


def test_what_is_the_same_in_every_dive_lasts_and_what_changes_its_way_does_not(flights):
    assert sunk(flights, [(0.0, 0.0)] * AFTER).evidence < 0.0
    confounded = sunk(flights, [(0.02, -0.02)] * AFTER)
    assert confounded.evidence > 10.0
    assert confounded.chance(-WATCH.lasting_odds) > 0.99
    assert np.median(confounded.size[:BANDS]) == pytest.approx(0.02, rel=0.4)
    assert np.median(confounded.size[BANDS:]) == pytest.approx(-0.02, rel=0.4)
    assert confounded.place.element == "surge"
    assert sunk(flights, [(0.02, 0.02)] * AFTER).place.element == "net"
    to_and_fro = sunk(flights, [(0.02 * s, -0.02 * s) for s in (1.0, -1.0, 1.0, -1.0)])
    assert to_and_fro.evidence < 0.2 * confounded.evidence
    half = sunk(flights, [(0.01, -0.01)] * AFTER)
    assert half.moves(flights.parts[0].kind.measures) == pytest.approx(
        0.5 * confounded.moves(flights.parts[0].kind.measures), rel=0.3
    )


def test_nothing_lasts_beside_the_vehicle_that_flew(before, flights):
    parts, shared = flights.parts[:BEFORE], replace(flights.shared, allowed=1.0, effects=1e-6)
    x = np.zeros(shared.count)
    calm = beside_all(parts, shared, x, flights.inflation)
    strange = beside_all([sunk_part(part) for part in parts], shared, x, flights.inflation)
    assert strange.evidence > calm.evidence + 10.0


def sunk_part(part):
    """A dive that sinks by 2 cm/s more in the upper half of its depths, both ways."""
    z = part.z.copy()
    upper = part.z[:, 0] < 0.5 * np.nanmax(part.z[:, 0])
    z[:, 0] += np.cumsum(0.02 * upper * np.diff(part.recording.t, prepend=part.recording.t[:1]))
    return part.reading(z)
