"""Is the filter as sure as it may be: normalised squared errors over seeded flights within chi-square bounds."""

import numpy as np

from glider.firmware.core.layouts import estimator_layout as kf
from tests.support.estimating import Filter, state_error
from tests.support.flights import World, fly

# Depth, attitude and nu; position north and east is dead reckoning, actuators are known but for their noise.
KEPT = [2, *range(kf.E_ATT, kf.E_ACT)]
EVERY, AFTER = 50, 100  # rows: once in 5 s, from 10 s on, when one launch no longer colours the next sample


def squared_errors(world: World, seeds: range, uncertain: bool) -> np.ndarray:
    """e' P^-1 e of the kept errors, one for each look at each flight."""
    found = []
    for seed in seeds:
        flight = fly(world, seed)
        columns, t = flight.run.columns, flight.run.t
        z = np.full((len(t), kf.N_Z), np.nan)
        for slot, name in enumerate(
            ("roll_rad", "pitch_rad", "yaw_rad", "p_rad_s", "q_rad_s", "r_rad_s", "depth_m", "slider_m", "ballast_kg")
        ):
            z[:, slot] = columns[name]
        commands = np.column_stack([columns[f"cmd_{n}"] for n in ("servo_rad", "slider_m", "ballast_kg")])
        filtered = Filter(uncertain=uncertain).start(z[0, 6], z[0, :3], world.start_speed)
        filtered.take(z[0])
        for i in range(1, len(t)):
            filtered.predict(0.1, commands[i - 1])
            filtered.take(z[i])
            if i >= AFTER and i % EVERY == 0:
                error = state_error(flight.truth[i], filtered.x)[KEPT]
                cov = filtered.cov[np.ix_(KEPT, KEPT)]
                found.append(error @ np.linalg.solve(cov, error))
    return np.array(found)


def test_with_disturbance_alone_errors_are_as_large_as_the_filter_says():
    from scipy.stats import chi2

    world = World(uncertainty=0.0, bias=0.0, start_speed=0.3)
    found = squared_errors(world, range(12), uncertain=False)
    n, k = len(found), len(KEPT)
    assert n >= 100
    low, high = chi2.ppf([0.0005, 0.9995], n * k) / n
    assert low * 0.9 < found.mean() < high * 1.1  # a tenth for what linearising leaves out


def test_with_uncertain_parameters_it_is_not_too_sure():
    from scipy.stats import chi2

    found = squared_errors(World(bias=0.0, start_speed=0.3), range(12), uncertain=True)
    n, k = len(found), len(KEPT)
    assert found.mean() < 1.1 * chi2.ppf(0.9995, n * k) / n
    assert found.mean() > 0.5 * k  # nor uselessly unsure
