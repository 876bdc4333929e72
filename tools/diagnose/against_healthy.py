"""Diagnosis against healthy runs of the same vehicle: what do a case's runs do that the healthy ones do not?

The vehicle file is one that was identified, and misses healthy runs by what its form cannot do. How far, channel by
channel, is learned from healthy runs, each flown by a fit to the others; the case's windows are then weighed in units
of that (docs/explanation/against-healthy.md). Every hypothesis is fitted without each of the case's runs and judged on
that run, so that an effect has to shrink what it has not seen:

- no change: what the vehicle file allows;
- a label's parameters beside that, one label or a few;
- an error of free form at one link of the chain, in a label's place: unknown;
- the same beside the best label, and what runs leave beyond healthy ones: the label's own form, as far as it is small
  beside what the label takes, else unknown.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from glider.tools.data.errors import InputError
from glider.tools.data.runs.case import Case
from glider.tools.diagnose.healthy_decision import weigh
from glider.tools.diagnose.healthy_fits import Comparison, HealthyHypothesis, hypotheses
from glider.tools.diagnose.healthy_runs import AsUsual, Healthy, as_the_case_sees, learn, of_form, with_labels
from glider.tools.diagnose.record import NONE, UNKNOWN
from glider.tools.gap.corrected import submerged
from glider.tools.inference.hyperparameters import DIAGNOSIS
from glider.tools.inference.parameters import nuisance_parameters
from glider.tools.inference.problem import problem_of

CAUSE = "cause"


@dataclass
class AgainstHealthy:
    """What was found of a case."""

    compared: Comparison
    healthy: Healthy
    verdict: str
    probabilities: dict[str, float]
    group: list[str]  # labels that the runs do not tell from the main one, itself first
    selected: list[str]
    nothing: HealthyHypothesis
    best: HealthyHypothesis
    evidence: dict[str, float]  # nat over no change
    left: dict[str, float]  # by hypothesis, the mean square of runs left out over what healthy runs leave
    links: dict[str, float]  # probability of something unknown at a link of the chain

    @property
    def case(self) -> Case:
        return self.compared.problem.case


def diagnose_against_healthy(
    case: Case, reference: Case | None, say: Callable[[str], None] = lambda text: None
) -> AgainstHealthy:
    """What a case's runs do that healthy runs of the same vehicle do not; InputError where nothing is known of those.

    reference: the healthy runs; None: what [form] of the vehicle file says of them.
    """
    case = submerged(case)
    if reference is not None:
        healthy = learn(case, [as_the_case_sees(run, case) for run in submerged(reference).runs])
        say(f"learned from {len(healthy.runs)} healthy runs")
    elif case.roughie.form is not None:
        healthy = of_form(case.roughie.form)
        say(f"{healthy.count} healthy runs, as the vehicle file has them")
    else:
        raise InputError("no healthy runs, and a vehicle without [form]", source=case.folder)
    problem = problem_of(case)
    nuisance = nuisance_parameters(problem)
    places, free = with_labels(problem, nuisance)
    for label, own in places.items():  # where healthy runs are not there, or do not show it
        nothing = np.zeros(len(own))
        healthy.usual.setdefault(label, AsUsual.learned(np.diag(nothing), nothing))
    compared = Comparison(problem, healthy, free, places, np.arange(len(nuisance)))
    listed = hypotheses(compared, say)
    weighed = weigh(compared, listed)
    chances = weighed.probabilities()
    first = max(chances, key=lambda name: chances[name])
    best = weighed.best(first)
    verdict = first if first in (NONE, UNKNOWN) else CAUSE
    singles = {one.labels[0]: compared.nat(one) for one in listed if len(one.labels) == 1 and one.form is None}
    least = singles.get(first, np.inf) - DIAGNOSIS.confounded_evidence
    near = [label for label in sorted(singles, key=lambda n: -singles[n]) if singles[label] > least and label != first]
    selected = weighed.certain(best) if verdict == UNKNOWN else list(best.labels)
    bare = compared.nat(listed[0])
    return AgainstHealthy(
        compared, healthy, verdict, chances, [first, *near] if verdict == CAUSE else [], selected, listed[0], best,
        {label: nat - bare for label, nat in singles.items()},
        {one.name: one.mean_square for one in listed}, weighed.links(),
    )  # fmt: skip
