"""`glider identify`: from a case's runs to parameters and their distribution."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from glider.firmware.model.vehicle import COEFFICIENTS
from glider.tools.data.runs.case import Case
from glider.tools.data.runs.gate import LeftOut
from glider.tools.data.runs.run import Run
from glider.tools.gap.corrected import ReadingCorrections, correct_readings, submerged
from glider.tools.identify.acceleration_likelihood import fit_accelerations, suited
from glider.tools.identify.fit import IdentificationFit, fit
from glider.tools.identify.flight_likelihood import TrajectoryLikelihood
from glider.tools.identify.held import FILE, HeldOut, judge
from glider.tools.identify.identifiability import unidentifiable_directions
from glider.tools.identify.sampler import Chains, Summary, sample, summarise
from glider.tools.identify.screen import despiked, screen
from glider.tools.identify.statistics import Quadratic
from glider.tools.inference.levels import Levels
from glider.tools.inference.model import nominal_model
from glider.tools.inference.problem import Problem
from glider.tools.inference.vehicle_parameters import Parameters, coefficients

CHECKED = 24  # draws at which the whole likelihood is compared with its linearisation
LEAST_EFFECTIVE_SHARE = 0.3  # effective share of the draws, below which intervals are called rough
FLIGHTS, ACCELERATIONS = "flights", "accelerations"


@dataclass(frozen=True)
class PosteriorCheck:
    """How well the linearised likelihood stands for the whole one at draws of the posterior."""

    draws: int
    spread: float  # sd of the difference of their logarithms, nat
    share: float  # effective share of the draws under importance weights


@dataclass
class Identified:
    """What was found."""

    case: Case
    read: ReadingCorrections  # what the readings say of each other, and the model that reads as they do
    likelihood: str
    runs: list[Run]  # that were fitted, without spikes
    free: Parameters
    quadratic: Quadratic
    chains: Chains
    summaries: list[Summary]  # of everything free, the coefficients first
    left_out: list[LeftOut]
    spikes: int
    notes: list[str]
    seconds: float
    fit: IdentificationFit | None = None  # of the flights
    held: HeldOut | None = None  # None by the accelerations
    check: PosteriorCheck | None = None
    accelerations: Quadratic | None = (
        None  # the other likelihood's statistics of the coefficients, where it could be had
    )

    @property
    def coefficients(self) -> list[Summary]:
        return self.summaries[: len(COEFFICIENTS)]

    @property
    def problem(self) -> Problem | None:
        return None if self.fit is None else self.fit.problem

    @property
    def levels(self) -> Levels | None:
        return None if self.fit is None else self.fit.levels

    @property
    def best(self) -> np.ndarray:
        """The posterior's mode within its limits, in units of the priors, (n,): what files hold."""
        return np.maximum(self.quadratic.mode, self.quadratic.low)

    @property
    def file_stays(self) -> bool:
        """Whether the vehicle file's own vehicle is handed out, and what was fitted is only reported."""
        return self.held is not None and self.held.chosen.name == FILE

    def compared(self) -> list[dict[str, Any]]:
        """The coefficients by the accelerations' likelihood, beside this one's."""
        if self.accelerations is None:
            return []
        spread = np.array([f.spread for f in coefficients(self.read.model.P)])
        mean = self.free.nominal[: len(COEFFICIENTS)] + self.accelerations.mode * spread
        sd = np.sqrt(np.diag(self.accelerations.covariance)) * spread
        return [
            {"name": one.name, "mean": m, "sd": s, "difference_in_sd": (m - one.mean) / float(np.hypot(s, one.sd))}
            for one, m, s in zip(self.coefficients, mean.tolist(), sd.tolist(), strict=True)
        ]

    def plain(self) -> dict[str, Any]:
        """The result as `--json` prints it."""
        result: dict[str, Any] = {
            "parameters": [one.plain() for one in self.coefficients],
            "seconds": self.seconds,
            "acceptance": float(self.chains.acceptance.mean()),
            "divergent_runs": [{"run": one.run, "reason": str(one)} for one in self.left_out],
            "likelihood": self.likelihood,
            "readings": [one.plain() for one in self.read.findings],
            "also_free": [one.plain() for one in self.summaries[len(COEFFICIENTS) :]],
            "runs": [run.name for run in self.runs],
            "heat": self.quadratic.inflation,
            "spikes_removed": self.spikes,
            "seed": self.chains.seed,
            "notes": self.notes,
            "unidentifiable": [one.plain() for one in unidentifiable_directions(self.free, self.chains.flat)],
        }
        if self.levels is not None:
            levels = zip(self.levels.names, self.levels.log, self.levels.sd, strict=True)
            result["noise"] = {name: {"factor": np.exp(log), "sd_of_log": sd} for name, log, sd in levels}
        if self.check is not None:
            check = self.check
            result["linearised"] = {
                "draws": check.draws, "spread_nat": check.spread, "effective_share": check.share
            }  # fmt: skip
        if self.held is not None:
            result["held_out"] = self.held.plain()
        if self.accelerations is not None:
            result["accelerations"] = self.compared()
        return result


def check_linearised(found: IdentificationFit, chains: Chains, draws: int = CHECKED) -> PosteriorCheck:
    """The whole likelihood (gains kept) at draws of the posterior, against its linearisation."""
    flat = chains.flat
    picked = flat[np.linspace(0, len(flat) - 1, draws).astype(int)]
    assert found.at is not None
    E = TrajectoryLikelihood(found.problem, found.free).follow(list(picked), found.at.gains)
    whole = np.square(E).sum(axis=1) / found.quadratic.inflation
    log = -0.5 * (whole - found.quadratic.misfit(picked))
    weights = np.exp(log - log.max())
    return PosteriorCheck(draws, float(log.std(ddof=1)), float(weights.sum() ** 2 / (weights @ weights) / draws))


def usable(case: Case) -> tuple[list[Run], list[LeftOut], int]:
    """Runs that may be fitted, without their spikes; InputError, naming the first, where there is none."""
    kept, unfit = screen(case.runs, case.motion_capture)
    left_out = [*case.left_out, *unfit]
    if not kept:
        raise left_out[0].error(len(left_out))
    cleaned = [despiked(run) for run in kept]
    return [run for run, _ in cleaned], left_out, sum(count for _, count in cleaned)


def identify(
    case: Case,
    seed: int = 1,
    likelihood: str = FLIGHTS,
    say: Callable[[str], None] = lambda text: None,
) -> Identified:
    """Identify the vehicle of a case from its runs: the candidate that flies runs left out best (held.py)."""
    began = time.perf_counter()
    runs, left_out, spikes = usable(case)
    read = correct_readings(case, nominal_model(case), runs)
    runs, model, case = read.runs, read.model, submerged(case)
    first = None
    if likelihood == ACCELERATIONS or suited(runs):
        say("accelerations")
        first, free = fit_accelerations(model, runs)
    if likelihood == ACCELERATIONS:
        assert first is not None
        chains = sample(first, seed)
        summaries = summarise(free.names, [f.unit for f in free.free], free.si(chains.values))
        took = time.perf_counter() - began
        return Identified(
            case, read, likelihood, runs, free, first, chains, summaries, left_out, spikes, [], took
        )  # fmt: skip
    begin = None if first is None else dict(zip(COEFFICIENTS, free.si(first.mode).tolist(), strict=True))
    found = fit(case, model, runs, begin, say)
    held = judge(case, model, found, begin, say)
    kept = min(held.candidates[1:], key=lambda one: one.total) if held.chosen.fit is None else held.chosen
    assert kept.fit is not None
    found = kept.fit
    if held.chosen.fit is None:
        found.notes.append(f"identified.toml holds the vehicle file's own numbers: {held.why}; worst in {held.worst}")
    say("chains")
    chains = sample(found.quadratic, seed)
    free = found.free
    summaries = summarise(free.names, [f.unit for f in free.free], free.si(chains.values))
    check = None if found.at is None else check_linearised(found, chains)
    if check is not None and check.share < LEAST_EFFECTIVE_SHARE:
        found.notes.append(
            "the posterior is not normal: its linearisation misses the whole likelihood "
            f"(effective share of draws {check.share:.2f}); intervals are rough, the vehicle file may be far off"
        )
    return Identified(
        case, read, likelihood, found.problem.runs, free, found.quadratic, chains, summaries, left_out + found.left_out,
        spikes, found.notes, time.perf_counter() - began, found, held, check, first,
    )  # fmt: skip
