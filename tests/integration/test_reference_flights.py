"""`glider simulate` against flights of independent implementations: the project's own and those of the contract."""

from pathlib import Path

import numpy as np
import pytest

from glider.tools.flight.simulate import PSI, STATES, fly_commands, read_commands
from glider.tools.verify.arm64.emulated import BOUNDS, CURRENT
from tests.independent.make_reference import FOLDER, MANOEUVRES, fly_manoeuvre
from tests.support.model_states import P

OWN = sorted(FOLDER.glob("*.csv"))
SHARED = ("current", "dive", "reversal", "sawtooth", "steep", "turn_climb", "turn_dive")
SHARED_WATER = {"current": (0.12, -0.07)}
ANGLES = [STATES.index(name) for name in ("phi", "theta", "psi")]


def deviations(path: Path, water: tuple[float, float]) -> np.ndarray:
    """Largest difference of each state between a reference flight and ours from its first row, (15,)."""
    flown = fly_commands(P, read_commands(path), water)
    reference = np.loadtxt(path, delimiter=",", skiprows=1)[:, 4:]
    return np.abs(flown - reference).max(axis=0)


@pytest.mark.parametrize("path", OWN, ids=lambda path: path.stem)
def test_own_reference_flights(path):
    water = MANOEUVRES[path.stem].water
    assert water == tuple(map(float, CURRENT.get(path.stem, "0,0").split(",")))
    worst = dict(zip(STATES, deviations(path, water), strict=True))
    # what is left is the kernels' step over the actuators' kinks, and nine digits
    assert [name for names, bound in BOUNDS for name in names if not worst.pop(name) < bound] == []
    assert worst == {}


def test_every_manoeuvre_has_its_file():
    assert [path.stem for path in OWN] == sorted(MANOEUVRES)


def test_own_reference_is_what_the_independent_model_flies():
    name = "steep"
    stored = np.loadtxt(FOLDER / f"{name}.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(fly_manoeuvre(MANOEUVRES[name]), stored, rtol=2e-8, atol=1e-9)


@pytest.mark.parametrize("name", SHARED)
def test_shared_reference_flights(shared, name):
    path = shared / "reference" / f"{name}.csv"
    if not path.is_file():
        pytest.skip(f"no {path.name} in the shared reference")
    worst = deviations(path, SHARED_WATER.get(name, (0.0, 0.0)))
    assert worst[:3].max() < 1e-5
    assert worst[ANGLES].max() < 1e-5
    assert worst[12:].max() < 1e-5


def test_no_shared_reference_flight_is_left_out(shared):
    assert {path.stem for path in (shared / "reference").glob("*.csv")} <= set(SHARED)


def test_heading_runs_on_through_pi(shared):
    path = shared / "reference" / "turn_climb.csv"
    flown = fly_commands(P, read_commands(path))
    assert flown[-1, PSI] > 4.0 * np.pi - 0.5
    assert np.abs(np.diff(flown[:, PSI])).max() < 0.1
