"""Effective samples a second of `glider identify`'s chains, beside others on the same posterior in the same run.

The posterior is that of some of the paper's runs, flown and captured in simulation. All samplers work in the same
whitened coordinates, from starts as far apart; emcee calls the same compiled, vectorised log density. Counted is the
whole walk, warm-up and all; an effective sample is the smallest bulk ESS (ArviZ) of the twelve coefficients.
"""

import tempfile
import time
from pathlib import Path
from typing import Any

import emcee  # first: the extra that brings it brings all the rest
import numpy as np

from glider.firmware.model.vehicle import COEFFICIENTS
from glider.tools.data.runs.case import load_case
from glider.tools.data.sources import load_vehicle
from glider.tools.identify.design import write_design
from glider.tools.identify.fit import fit
from glider.tools.identify.sampler import START_SIGMA, Whitened, sample, whiten
from glider.tools.identify.statistics import Quadratic
from glider.tools.verify.benchmark.registry import Settings
from glider.tools.verify.benchmark.timing import alternate, median

RUNS, SEED = list(range(0, 45, 5)), 1
DRAWS = 10_000
STEPS, BURN = 6_000, 1_500  # of emcee; 670 steps of its default moves were one effective sample of each walker


def posterior() -> Quadratic:
    """The statistics that are sampled."""
    with tempfile.TemporaryDirectory() as folder:
        write_design(Path(folder), "roughie", load_vehicle("roughie"), SEED, RUNS)
        case = load_case(folder)
        from glider.tools.inference.model import nominal_model

        return fit(case, nominal_model(case), case.runs).quadratic


def smallest_ess(values: np.ndarray) -> float:
    """Of draws (chains, draws, n), the coefficients first."""
    import arviz

    return min(float(arviz.ess(values[:, :, i], method="bulk")) for i in range(len(COEFFICIENTS)))


def ours(statistics: Quadratic) -> float:
    chains = sample(statistics, SEED, draws=DRAWS)
    return smallest_ess(chains.values) / chains.seconds


def emcee_ess(statistics: Quadratic, white: Whitened, evolving: bool = False) -> float:
    """The affine-invariant ensemble, two walkers a dimension and one pair over; or moves of differential evolution."""
    size = len(statistics.at) + len(statistics.groups)
    walkers = 2 * (size + 1)
    rng = np.random.default_rng(SEED)
    start = np.column_stack([
        START_SIGMA * rng.standard_normal((walkers, len(statistics.at))),
        0.01 * rng.standard_normal((walkers, len(statistics.groups))),
    ])  # fmt: skip
    start[~np.isfinite(white.log_densities(start))] *= 0.1
    moves = [(emcee.moves.DEMove(), 0.8), (emcee.moves.DESnookerMove(), 0.2)] if evolving else None
    sampler = emcee.EnsembleSampler(walkers, size, white.log_densities, vectorize=True, moves=moves)
    sampler.random_state = np.random.RandomState(SEED).get_state()
    before = time.perf_counter()
    sampler.run_mcmc(start, STEPS, skip_initial_state_check=True)
    seconds = time.perf_counter() - before
    y = sampler.get_chain(discard=BURN).transpose(1, 0, 2)[:, :, : len(statistics.at)]
    return smallest_ess(white.mode + y @ white.root.T) / seconds


def measure(settings: Settings) -> dict[str, Any]:
    """ess_per_s, emcee_ess_per_s, ratio, the same by moves of differential evolution; parameters."""
    statistics = posterior()
    white = whiten(statistics)
    ours(statistics)  # compiles
    white.log_densities(np.zeros((4, len(statistics.at) + len(statistics.groups))))
    walks, ensembles, evolving = alternate(
        min(settings.repeats, 3), lambda: ours(statistics), lambda: emcee_ess(statistics, white),
        lambda: emcee_ess(statistics, white, evolving=True),
    )  # fmt: skip
    return {
        "ess_per_s": median(walks),
        "emcee_ess_per_s": median(ensembles),
        "ratio": median([one / other for one, other in zip(walks, ensembles, strict=True)]),
        "emcee_evolution_ess_per_s": median(evolving),
        "ratio_evolution": median([one / other for one, other in zip(walks, evolving, strict=True)]),
        "parameters": len(statistics.at) + len(statistics.groups),
    }
