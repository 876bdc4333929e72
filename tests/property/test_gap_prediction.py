"""A prediction never looks ahead: measurements behind a window's first 2 s change nothing in that window."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from glider.tools.data.runs.run import Run
from glider.tools.inference.channels import ROUGHIE_MEASURES
from glider.tools.inference.model import nominal_model
from glider.tools.inference.predict import predict
from tests.support.examples import examples
from tests.support.flights import World, case_of, fly

FLIGHTS = {mocap: fly(World(mocap=mocap), 5).run for mocap in (False, True)}
PREDICTIONS = {}


def predicted(run: Run, mocap: bool) -> np.ndarray:
    case = case_of(World(mocap=mocap), [run])
    return predict(case, nominal_model(case), case.runs)[0]


@examples(40)
@given(
    mocap=st.booleans(),
    number=st.integers(0, 2),
    later=st.integers(0, 30),
    blank=st.sampled_from([np.nan, 0.0, 1e9, -3.0]),
    seed=st.integers(0, 10_000),
)
def test_what_comes_after_the_start_changes_nothing(mocap, number, later, blank, seed):
    run = FLIGHTS[mocap]
    if mocap not in PREDICTIONS:
        PREDICTIONS[mocap] = predicted(run, mocap)
    window = ROUGHIE_MEASURES.windows(run.t)[number]
    rng = np.random.default_rng(seed)
    columns = {}
    for name, values in run.columns.items():
        columns[name] = values.copy()
        if name != "t_s" and not name.startswith("cmd_") and rng.random() < 0.7:
            columns[name][window.start + later :] = blank
    spoiled = predicted(Run("run00", None, columns), mocap)
    np.testing.assert_array_equal(spoiled[: window.end], PREDICTIONS[mocap][: window.end])
    assert np.isfinite(spoiled).all()


@examples(15)
@given(mocap=st.booleans(), count=st.integers(20, 599))
def test_a_run_cut_short_is_predicted_alike_as_far_as_it_goes(mocap, count):
    """From the first window's 2 s on: those rows may know of each other."""
    run = FLIGHTS[mocap]
    if mocap not in PREDICTIONS:
        PREDICTIONS[mocap] = predicted(run, mocap)
    cut = predicted(Run("run00", None, {name: values[:count] for name, values in run.columns.items()}), mocap)
    np.testing.assert_array_equal(cut, PREDICTIONS[mocap][:count])
