"""What the form of a model lacks goes with how it is flown: known where runs were identified, uncertain elsewhere."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glider.tools.own.check import load_own
from glider.tools.own.declare import Declaration, Input
from glider.tools.own.diagnose import diagnose_own
from glider.tools.own.identified import write
from glider.tools.own.identify import identify
from glider.tools.own.observers import observer_of
from glider.tools.own.operating_points import (
    KERNEL_LENGTH,
    NEW_POINT_VARIANCE,
    input_shares,
    point_weights,
    with_operating_points,
)
from glider.tools.own.runs import OwnRun
from tests.support.boat import MODEL

SETTINGS = (-0.4, 0.0, 0.4)  # of the flap, rad
BEYOND = 0.5  # farther than what was identified


def flown(flap: float, seed: int, filed: float = 1.0) -> OwnRun:
    """A run under steady inputs: the drag goes with the flap's square, of which the model knows nothing."""
    random = np.random.default_rng(seed)
    t = np.arange(0.0, 30.0, 0.1)
    u, v, out = np.array([random.uniform(0.2, 0.3), flap]), 0.3, []
    own = 0.002 * random.standard_normal()
    for _ in t:
        out.append(v + 0.01 * random.standard_normal())
        v += 0.1 * (u[0] - 0.45 * v - 0.3 * flap**2 + own + 0.02 * random.standard_normal() / np.sqrt(0.1))
    u[0] *= filed
    return OwnRun(f"run{seed}", t, np.tile(u, (len(t), 1)), np.array(out)[:, None])


@pytest.fixture(scope="module")
def boat(tmp_path_factory):
    """The boat identified from runs at all settings, as its file has it."""
    folder = tmp_path_factory.mktemp("points")
    (folder / "boat.py").write_text(MODEL)
    (folder / "boat.toml").write_text('format = 1\nmodel = "boat"\n[windows]\nseconds = 10.0\n')
    runs = [flown(flap, 10 * n + k) for k in range(5) for n, flap in enumerate(SETTINGS)]
    write(identify(load_own(folder / "boat.toml"), [runs]), folder / "out")
    return load_own(folder / "out" / "identified.toml")


def test_new_runs_at_known_settings_are_predicted(boat):
    kept = [flown(flap, 100 + n) for n, flap in enumerate(SETTINGS)]
    observer = observer_of(boat, kept)
    without = observer.point.copy()
    without.operating[:] = 0.0
    gaps = [np.mean([observer.gaps(n, point, 10.0) for n in range(3)]) for point in (observer.point, without)]
    assert gaps[0] < 0.8 * gaps[1]


@pytest.mark.parametrize("flap", [*SETTINGS, BEYOND])
def test_healthy_runs_are_healthy_at_settings_and_beyond(boat, flap):
    """Beyond the settings the model errs half as much again: no cause, but its form."""
    found, _ = diagnose_own(boat, [flown(flap, 200 + n) for n in range(4)])
    assert max(found.chances, key=lambda label: found.chances[label]) == "none", found.chances


def test_a_change_at_known_settings_is_found(boat):
    runs = [flown(flap, 300 + n, filed=1.25) for n, flap in enumerate((*SETTINGS, 0.0))]
    found, _ = diagnose_own(boat, runs)
    # thrusts of 0.2 to 0.3 N: as much of each, or the same of all, is much the same
    assert found.chances["thrust_gain"] + found.chances["thrust_offset"] > 0.7, found.chances


DECLARED = Declaration((Input("a"), Input("b")), (), (), usual_inputs={"a": (1.0, 0.5), "b": (0.0, 2.0)})
MEANS = st.lists(st.tuples(st.floats(-3.0, 5.0), st.floats(-8.0, 8.0)), min_size=1, max_size=12)


def run_at(means: tuple[float, ...]) -> OwnRun:
    return OwnRun("run", np.arange(3.0), np.tile(means, (3, 1)), np.zeros((3, 0)))


@given(MEANS, MEANS)
def test_points_give_the_process_its_covariance(known, asked):
    runs = [run_at(one) for one in known]
    declared = with_operating_points(DECLARED, runs)
    further = with_operating_points(declared, [run_at(one) for one in asked])
    assert further.operating_points[: len(declared.operating_points)] == declared.operating_points
    for a, b in itertools.pairwise(known):
        mine, theirs = (point_weights(declared, run_at(one).inputs) for one in (a, b))
        distance = np.hypot((a[0] - b[0]) / 0.5, (a[1] - b[1]) / 2.0)
        assert mine @ theirs == pytest.approx(
            np.exp(-0.5 * (distance / KERNEL_LENGTH) ** 2), abs=NEW_POINT_VARIANCE + 1e-9
        )
        assert 1.0 - NEW_POINT_VARIANCE - 1e-9 <= mine @ mine <= 1.0 + 1e-9
    for one in (*known, *asked):  # what was known of a run stays, whatever is asked about beside it
        mine, theirs = (point_weights(some, run_at(one).inputs) for some in (declared, further))
        assert theirs[: len(mine)] == pytest.approx(mine)


def test_inputs_under_one_command_count_as_one():
    """Four motors under one command are no farther from another command than one motor is."""
    usual = dict.fromkeys(("a", "b", "c", "d"), (0.0, 1.0))
    declared = Declaration(tuple(map(Input, usual)), (), (), usual_inputs=usual)
    runs = [run_at((a, b, b, b)) for a in (-1.0, 1.0) for b in (-1.0, 1.0)]
    shares = input_shares(declared, runs)
    assert shares == pytest.approx({"a": 1.0, "b": 1 / 3, "c": 1 / 3, "d": 1 / 3})
    first = with_operating_points(replace(declared, input_shares=shares), runs[:1])
    (to_other_command,) = point_weights(first, runs[1].inputs)
    (to_other_a,) = point_weights(first, runs[2].inputs)
    assert to_other_command == pytest.approx(to_other_a)


def test_a_vehicle_that_was_never_identified_has_none():
    assert with_operating_points(Declaration((Input("a"),), (), ()), [run_at((1.0, 2.0))]).operating_points == ()
