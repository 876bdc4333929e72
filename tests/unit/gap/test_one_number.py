"""One nominal gap for one case, whichever command says it."""

import numpy as np
import pytest

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.diagnose.shrink import gaps
from glider.tools.gap.assess import assess
from glider.tools.gap.measure import root_mean_square, run_gap
from glider.tools.identify.predict import predicted
from glider.tools.inference.channels import ROUGHIE_MEASURES
from glider.tools.inference.model import nominal_model
from glider.tools.inference.predict import predict
from glider.tools.inference.problem import problem_of
from tests.support.flights import World, fly_case


@pytest.mark.parametrize("mocap", [False, True])
def test_measure_predict_identify_and_diagnose_name_the_same_gap(mocap):
    case, _ = fly_case(World(mocap=mocap), 21, runs=2)
    model, F = nominal_model(case), np.zeros(ef.N_F)
    measured = {run.name: run.total for run in assess(case).runs}
    identified = {run.name: predicted(case, model, run, model.P, F)[0].total for run in case.runs}
    before = {gap.name: gap.total for gap in gaps(problem_of(case), 2 * [(model.P, F)])[0]}
    flown = zip(case.runs, predict(case, model, case.runs), strict=True)
    written = {run.name: run_gap(ROUGHIE_MEASURES, run, Y, ROUGHIE_MEASURES.windows(run.t)).total for run, Y in flown}
    for other in (identified, before, written):
        assert other == pytest.approx(measured, rel=1e-9)
    assert root_mean_square(measured.values()) > 0.0
