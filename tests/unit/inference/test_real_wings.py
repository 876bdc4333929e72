"""A vehicle whose wings damp its roll eleven times as much as the shipped file says, observed and predicted."""

import numpy as np
import pytest

from glider.firmware.core.vehicle import layout
from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.gap.measure import root_mean_square, run_gap
from glider.tools.inference.channels import ROUGHIE_MEASURES
from glider.tools.inference.predict import fly_windows_from, observe
from glider.tools.inference.problem import problem_of
from tests.support.flights import World, fly_case

DAMPED = -20.0  # kg s/rad, beside the file's K_p
LARGEST_RATE = 0.6  # rad/s; those of the flights stay below


@pytest.mark.parametrize("mocap", [False, True])
def test_a_vehicle_with_real_wings_is_predicted_by_its_own_file(mocap):
    gaps = []
    for seed in range(3):
        world = World(mocap=mocap, start_speed=1.0, uncertainty=0.0, changes={layout.K_P: DAMPED})
        case, flights = fly_case(world, seed, runs=2)
        problem, F = problem_of(case), np.zeros(ef.N_F)
        P = problem.model.P.copy()
        P[layout.K_P] += DAMPED
        gains = observe(problem, P, F)
        Y = fly_windows_from(problem, P, F, gains)
        assert np.nanmax(np.abs(np.concatenate([flight.truth for flight in flights])[:, 10:13])) < LARGEST_RATE
        assert np.nanmax(np.abs(Y[:, ef.Y_P : ef.Y_P + 3])) < LARGEST_RATE
        parts = np.split(Y, problem.recording.bounds[1:-1])
        for run, one in zip(case.runs, parts, strict=True):
            gaps.append(run_gap(ROUGHIE_MEASURES, run, one, ROUGHIE_MEASURES.windows(run.t)).total)
    assert root_mean_square(gaps) < 1.0
