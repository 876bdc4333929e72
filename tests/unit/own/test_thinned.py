"""Rows of a fast log that the observer sees: of every output a reading each tenth of a second."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from glider.tools.own.observers import thinned
from glider.tools.own.runs import OwnRun

NAN = float("nan")


def log(t, outputs) -> OwnRun:
    return OwnRun("run", np.asarray(t, dtype=float), np.arange(len(t), dtype=float)[:, None], np.asarray(outputs))


def at_rows(rows: int, *phases: int | None, every: int = 5) -> np.ndarray:
    """Outputs (rows, phases) that are read on every so many-th row, each from its own on; None: on every row."""
    found = np.full((rows, len(phases)), NAN)
    for n, phase in enumerate(phases):
        found[slice(None) if phase is None else slice(phase, None, every), n] = n
    return found


def test_of_a_log_with_all_outputs_in_every_row_stays_every_so_many_th():
    t = 3.0 + 0.02 * np.arange(1000)
    assert np.array_equal(thinned(log(t, at_rows(1000, None, None))).t, t[::5])


def test_sensors_that_report_on_rows_of_their_own_all_stay_at_their_times():
    t = 0.02 * np.arange(1000)
    found = thinned(log(t, at_rows(1000, 0, 2, None)))
    assert np.array_equal(found.t[np.isfinite(found.outputs[:, 0])], t[::5])
    assert np.array_equal(found.t[np.isfinite(found.outputs[:, 1])], t[2::5])
    assert len(found.t) == 400


def test_a_held_input_is_the_mean_of_the_rows_that_a_row_stands_for():
    """A motor that starts between two rows has run half of their time."""
    run = OwnRun("run", 0.05 * np.arange(8), np.array([[0.0, 0.0]] * 3 + [[1.0, 1.0]] * 5), np.zeros((8, 1)))
    assert thinned(run, [False, True]).inputs.tolist() == [[0.0, 0.0], [0.5, 0.0], [1.0, 1.0], [1.0, 1.0]]


def test_a_log_with_a_row_for_every_message_keeps_its_rate():
    """Four sensors at 10 Hz, a millisecond apart: the usual interval of rows says nothing of how dense they are."""
    t = (0.1 * np.arange(100)[:, None] + 0.001 * np.arange(4)).ravel()
    found = thinned(log(t, at_rows(400, 0, 1, 2, 3, every=4)))
    assert np.array_equal(found.t, t)


@given(
    read=st.lists(st.tuples(*[st.booleans()] * 3), min_size=5, max_size=200),
    interval=st.sampled_from([0.005, 0.01, 0.02, 0.05]),
)
def test_each_output_that_was_read_in_a_tenth_of_a_second_is_there(read, interval):
    t = interval * np.arange(len(read))
    outputs = np.where(np.array(read), 1.0, NAN)
    found = thinned(log(t, outputs), [True])
    assert np.all(np.diff(found.t) > 0.0)
    assert np.array_equal(found.outputs, outputs[found.inputs[:, 0].astype(int)], equal_nan=True)
    for bin_ in np.unique(np.floor(t / 0.1 + 0.01)):
        seen, kept = (np.floor(times / 0.1 + 0.01) == bin_ for times in (t, found.t))
        assert np.array_equal(np.isfinite(outputs[seen]).any(axis=0), np.isfinite(found.outputs[kept]).any(axis=0))
