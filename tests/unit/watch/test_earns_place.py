"""A further event in runs that another event has already."""

from types import SimpleNamespace

import numpy as np
import pytest

from glider.tools.watch.events import STEP, Span
from glider.tools.watch.history import ChangeEvent, History, earns_place

RUNS = 20


def event(label, evidence, explained, matters=True):
    return ChangeEvent(label, Span(5, RUNS, STEP), evidence, {}, np.zeros(1), np.eye(1), explained, matters=matters)


@pytest.mark.parametrize(("matters", "earned"), [(True, False), (False, True)])
def test_only_what_matters_hides_an_event_of_other_readings(matters, earned):
    """Months of a slow growth that moves little leave much, of which a step in the roll explains nothing."""
    expansion = SimpleNamespace(curvature=np.eye(2))
    flights = SimpleNamespace(
        count=RUNS, run_inflation=np.ones(RUNS), excess=lambda n: 40.0, raw=[expansion] * RUNS,
        shared=SimpleNamespace(labels={"thermal_expansion": np.array([0]), "roll_trim": np.array([1])}),
    )  # fmt: skip
    history = History(flights, np.ones(RUNS, dtype=bool), 1)
    history.events.append(event("thermal_expansion", 90.0, 1400.0, matters))
    assert earns_place(history, event("roll_trim", 60.0, 60.0)) is earned
    assert earns_place(history, event("roll_trim", 300.0, 300.0))
