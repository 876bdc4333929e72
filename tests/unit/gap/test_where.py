"""Where a gap sits: faults put into made-up flights are found in their place, and nothing is found in nothing."""

import numpy as np
import pytest

from glider.firmware.core.vehicle import layout
from glider.tools.gap.assess import CaseGap, assess
from glider.tools.gap.where import ALLOWED, evidence
from tests.support.flights import World, fly_case


def measured(world: World, seed: int = 1, spoil=None) -> CaseGap:
    case, flights = fly_case(world, seed, runs=2)
    if spoil is not None:
        for flight in flights:
            spoil(flight.run.columns)
    return assess(case)


def shares(world: World, seed: int = 1, spoil=None) -> dict[tuple[str, str], float]:
    return shares_of(measured(world, seed, spoil))


def shares_of(found: CaseGap) -> dict[tuple[str, str], float]:
    assert sum(share.share for share in found.where) == pytest.approx(1.0)
    assert all(share.share >= 0.0 for share in found.where)
    assert found.where[-1].subsystem == "unexplained"
    assert found.where[-2].subsystem == ALLOWED
    return {(share.subsystem, share.element): share.share for share in found.where}


def first(found: dict[tuple[str, str], float]) -> tuple[str, str]:
    return max(found, key=found.__getitem__)


@pytest.mark.parametrize("mocap", [False, True])
def test_what_the_nominal_allows_for_is_blamed_on_no_part(mocap):
    allowed = [shares(World(mocap=mocap), seed).get((ALLOWED, ALLOWED), 0.0) for seed in range(4)]
    assert np.median(allowed) > 0.9


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({layout.NET_MASS: 0.02}, ("mass", "net")),
        ({layout.K_D0: 1.5}, ("hydrodynamics", "surge")),
        ({layout.CG_X: 0.001}, ("mass", "longitudinal")),
        ({layout.BALLAST_RATE: -0.02}, ("actuation", "ballast")),
        ({layout.SLIDER_RATE: -0.018}, ("actuation", "slider")),
        ({layout.K_MY: 20.0}, ("hydrodynamics", "yaw")),
    ],
    ids=["net", "surge", "longitudinal", "ballast", "slider", "yaw"],
)
def test_a_changed_vehicle(changes, part):
    assert first(shares(World(mocap=True, changes=changes))) == part


def test_water_that_moves():
    assert first(shares(World(mocap=True, water=(0.12, 0.05)))) == ("environment", "water")


def _spoil(name: str, value: float):
    def spoil(columns):
        columns[name] += value

    return spoil


@pytest.fixture(scope="module")
def unspoilt() -> float:
    """Total gap of the flights whose sensors are spoilt below: what the nominal allows for."""
    return measured(World(mocap=True)).total


@pytest.mark.parametrize(
    ("name", "value", "part"),
    [
        ("pitch_rad", 0.06, ("sensing", "attitude")),
        ("q_rad_s", 0.06, ("sensing", "gyro")),
        ("depth_m", 0.4, ("sensing", "depth")),
    ],
)
def test_a_sensor_that_is_off_takes_what_it_adds(unspoilt, name, value, part):
    """A sensor moves no flight, so that the gap without its error is known: the rest is the sensor's."""
    spoilt = measured(World(mocap=True), spoil=_spoil(name, value))
    found = shares_of(spoilt)
    assert first({where: share for where, share in found.items() if where[0] != ALLOWED}) == part
    assert found[part] == pytest.approx(1.0 - (unspoilt / spoilt.total) ** 2, abs=0.05)


def test_evidence_of_one_amplitude_is_the_textbooks():
    """log N(r; 0, I + j j' v) - log N(r; 0, I), for one column j."""
    rng = np.random.default_rng(0)
    j, r, v = rng.standard_normal(6), rng.standard_normal(6), 0.7
    S = np.eye(6) + v * np.outer(j, j)
    expected = 0.5 * (r @ r - r @ np.linalg.solve(S, r)) - 0.5 * np.linalg.slogdet(S)[1]
    found, mean = evidence(np.array([[j @ j]]), np.array([j @ r]), np.array([v]))
    assert found == pytest.approx(expected)
    assert mean[0] == pytest.approx(v * (j @ r) / (1.0 + v * (j @ j)))
