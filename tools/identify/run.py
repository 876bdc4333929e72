"""`glider identify`: from a case's runs to parameters and their distribution."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from firmware.model.vehicle import COEFFICIENTS
from tools.errors import InputError
from tools.gap.model import nominal_model
from tools.identify.fit import Fit, fit
from tools.identify.flights import Flights
from tools.identify.sampler import Chains, Summary, sample, summarise
from tools.identify.screen import LeftOut, despiked, screen
from tools.runs.case import Case

CHECKED = 24  # draws at which the whole likelihood is compared with its linearisation
SEED = 1


@dataclass(frozen=True)
class Check:
    """How well the linearised likelihood stands for the whole one at draws of the posterior."""

    draws: int
    spread: float  # sd of the difference of their logarithms, nat
    share: float  # effective share of the draws under importance weights


@dataclass
class Identified:
    """What was found."""

    case: Case
    fit: Fit
    chains: Chains
    summaries: list[Summary]  # of everything free, the coefficients first
    left_out: list[LeftOut]
    check: Check
    spikes: int
    seconds: float

    @property
    def coefficients(self) -> list[Summary]:
        return self.summaries[: len(COEFFICIENTS)]

    def plain(self) -> dict[str, Any]:
        """The result as `--json` prints it."""
        return {
            "parameters": [one.plain() for one in self.coefficients],
            "seconds": self.seconds,
            "acceptance": float(self.chains.acceptance.mean()),
            "divergent_runs": [{"run": one.run, "reason": str(one)} for one in self.left_out],
            "also_free": [one.plain() for one in self.summaries[len(COEFFICIENTS) :]],
            "noise": {
                name: {"factor": float(np.exp(log)), "sd_of_log": float(sd)}
                for name, log, sd in zip(
                    self.fit.levels.names, self.fit.levels.log, self.fit.levels.sd, strict=True
                )
            },
            "runs": [run.name for run in self.fit.problem.runs],
            "heat": self.fit.quadratic.heat,
            "linearised": {
                "draws": self.check.draws, "spread_nat": self.check.spread, "effective_share": self.check.share
            },
            "spikes_removed": self.spikes,
            "seed": self.chains.seed,
            "notes": self.fit.notes,
        }  # fmt: skip


def check_linearised(found: Fit, chains: Chains, draws: int = CHECKED) -> Check:
    """The whole likelihood (gains kept) at draws of the posterior, against its linearisation."""
    flat = chains.flat
    picked = flat[np.linspace(0, len(flat) - 1, draws).astype(int)]
    E = Flights(found.problem, found.free).follow(list(picked), found.at.gains)
    whole = np.square(E).sum(axis=1) / found.quadratic.heat
    log = -0.5 * (whole - found.quadratic.misfit(picked))
    weights = np.exp(log - log.max())
    return Check(draws, float(log.std(ddof=1)), float(weights.sum() ** 2 / (weights @ weights) / draws))


def usable(case: Case) -> tuple[list, list[LeftOut], int]:
    """Runs that may be fitted, without their spikes; InputError, naming the first, where there is none."""
    kept, left_out = screen(case.runs, case.motion_capture)
    if not kept:
        first = left_out[0]
        raise InputError(
            f"{first.reason} (none of {len(case.runs)} runs can be used)", source=first.path, column=first.column
        )
    cleaned = [despiked(run) for run in kept]
    return [run for run, _ in cleaned], left_out, sum(count for _, count in cleaned)


def identify(case: Case, seed: int = SEED, say: Callable[[str], None] = lambda text: None) -> Identified:
    """Identify the vehicle of a case from its runs."""
    began = time.perf_counter()
    runs, left_out, spikes = usable(case)
    found = fit(case, nominal_model(case), runs, say)
    say("chains")
    chains = sample(found.quadratic, seed)
    free = found.free
    summaries = summarise(free.names, [f.unit for f in free.free], free.si(chains.values))
    check = check_linearised(found, chains)
    return Identified(
        case, found, chains, summaries, left_out + found.left_out, check, spikes, time.perf_counter() - began
    )
