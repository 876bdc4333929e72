"""Windows of any clock: they cut the run, in order, and never look at what is behind their end."""

import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from glider.tools.inference.channels import ROUGHIE_MEASURES
from tests.support.examples import examples

START, WINDOW = ROUGHIE_MEASURES.look_in, ROUGHIE_MEASURES.window

clocks = st.builds(
    lambda begin, steps: begin + np.concatenate([[0.0], np.cumsum(steps)]),
    st.floats(-100.0, 1e6),
    st.lists(st.floats(0.005, 30.0), max_size=150),
)


@examples()
@given(clocks)
def test_windows_cut_the_run(t):
    found = ROUGHIE_MEASURES.windows(t)
    assert found[0].first == 0
    assert found[-1].end == len(t)
    for before, after in itertools.pairwise(found):
        assert before.end == after.first
    for window in found:
        since = t[window.first : window.end] - t[0]
        assert window.first <= window.start <= window.end
        assert np.floor((since[0] + 1e-5) / WINDOW) == np.floor((since[-1] + 1e-5 - 2e-5) / WINDOW) or len(since) == 1
        begin = np.floor((since[0] + 1e-5) / WINDOW) * WINDOW
        assert (since[: window.start - window.first] < begin + START).all()
        assert (since[window.start - window.first :] > begin + START - 1e-5).all()


@examples()
@given(st.integers(1, 1500), st.sampled_from([1.0, 5.0, 10.0, 20.0, 50.0]))
def test_whole_windows_at_an_even_rate_are_counted_by_their_samples(count, rate):
    scored = [window for window in ROUGHIE_MEASURES.windows(np.arange(count) / rate) if window.scored]
    assert len(scored) == max(1, int(count // (WINDOW * rate)))
