"""What healthy runs of an identified vehicle leave: by channel, from run to run, and as parameters of labels."""

from collections.abc import Set
from dataclasses import dataclass, field, replace

import numpy as np

from glider.firmware.model.vehicle import FormTable
from glider.tools.data.runs import columns
from glider.tools.data.runs.case import Case
from glider.tools.data.runs.run import Run
from glider.tools.diagnose.held_out import HeldOutWindows
from glider.tools.gap.regimes import ALL
from glider.tools.inference.channels import recorded
from glider.tools.inference.healthy_level import HealthyLevel
from glider.tools.inference.hyperparameters import HEALTHY
from glider.tools.inference.parameters import FreeParameter, effect_parameters, nuisance_parameters
from glider.tools.inference.pooled import Pooled, log_prior
from glider.tools.inference.problem import Problem, problem_of

TOTAL = "total"
FILE_ERRORS = np.geomspace(0.02, 2.0, 41)


@dataclass(frozen=True)
class AsUsual:
    """What the vehicle file is off by, as a label's parameters: normal, in units of their priors."""

    mean: np.ndarray  # (k,)
    covariance: np.ndarray  # (k, k)

    @classmethod
    def learned(cls, precision: np.ndarray, score: np.ndarray) -> "AsUsual":
        """From what healthy runs say, precision (k, k) and score (k,): the variance is the most probable one with an
        inverse gamma prior about `file_error` squared, worth one observation."""
        one = np.eye(len(score))

        def log_posterior(size: float) -> float:
            evidence = prior_evidence(precision, score, 0.0 * score, size**2 * one)
            return evidence + float(log_prior(size**2, HEALTHY.file_error**2))

        size = max(FILE_ERRORS, key=log_posterior)
        covariance = np.linalg.inv(precision + one / size**2)
        return cls(covariance @ score, covariance)


def prior_evidence(precision: np.ndarray, score: np.ndarray, mean: np.ndarray, covariance: np.ndarray) -> float:
    """Of a normal prior, mean (k,) and covariance (k, k); precision (k, k) and score (k,) of the likelihood about 0."""
    score = score - precision @ mean
    return Pooled(precision, score, -float(mean @ (2.0 * score + precision @ mean)), covariance).log_evidence()


@dataclass
class Healthy(HealthyLevel):
    """What healthy runs leave: by channel in tolerances, and the logarithm of a run's mean square in those units."""

    scales: dict[str, float] = field(default_factory=dict)
    runs: list[str] = field(default_factory=list)  # empty where the vehicle file alone says it
    usual: dict[str, AsUsual] = field(default_factory=dict)  # by label


def learn(case: Case, runs: list[Run]) -> Healthy:
    """Every healthy run flown by what the vehicle file allows, fitted to the others.

    Where the vehicle was identified from these runs they are held too well: [form] has the gaps of runs left out.
    """
    problem = problem_of(case, runs=runs)
    free = nuisance_parameters(problem)
    scales = dict[str, float]()
    form = case.roughie.form.gaps[ALL] if case.roughie.form is not None else {}
    values = np.zeros(len(free))
    for _ in range(2):  # first in tolerances, then in what the first found
        windows = HeldOutWindows(problem, free, scales)
        found = windows.left_out(values)
        values = found.values
        measured = np.sqrt(found.channels)
        scales = {
            channel.name: max(
                float(one) * scales.get(channel.name, 1.0), form.get(channel.name, 0.0), HEALTHY.least_scale
            )
            for channel, one in zip(windows.channels, measured, strict=True)
        }
    run_of, _ = windows.origins(windows.cuts[0])
    share = np.array([np.mean(run_of == n) for n in range(len(runs))])
    logs = np.log(np.maximum(found.runs / share, 1e-6))
    level, scatter = float(np.log(np.exp(logs).mean())), float(logs.std(ddof=1)) if len(logs) > 1 else HEALTHY.run_scale
    healthy = Healthy(len(runs), level, scatter, scales, [run.name for run in runs])
    places, every = with_labels(problem, free)
    windows = HeldOutWindows(problem, every, scales, healthy.independent * len(runs))
    at = windows.linearised(windows.clipped(np.pad(found.values, (0, len(every) - len(free)))))
    weight = windows.independent(windows.cuts) / max(float(at.value.sum()), 1.0)
    nuisance = np.arange(len(free))
    for label, own in places.items():
        precision, score = at.information(nuisance, own, weight)
        healthy.usual[label] = AsUsual.learned(precision, score)
    return healthy


def with_labels(problem: Problem, nuisance: list[FreeParameter]) -> tuple[dict[str, np.ndarray], list[FreeParameter]]:
    """Places of each label's parameters behind the nuisance parameters, and all parameters."""
    free, places = list(nuisance), dict[str, np.ndarray]()
    for label, own in effect_parameters(problem).items():
        places[label] = np.arange(len(free), len(free) + len(own))
        free += own
    return places, free


def of_form(form: FormTable) -> Healthy:
    """The same as identification wrote it into the vehicle file."""
    scales = {name: max(gap, HEALTHY.least_scale) for name, gap in form.gaps[ALL].items() if name != TOTAL}
    return Healthy(form.runs, 0.0, form.scatter, scales)


def as_the_case_sees(run: Run, case: Case) -> Run:
    """A healthy run with those readings alone that some of the case's runs have: what it leaves is what these show."""
    there: Set[str] = {name for one in case.runs for name in one.columns if recorded(one, name)}
    kept = {name: values for name, values in run.columns.items() if name in there or name not in columns.KNOWN}
    return replace(run, columns=kept)
