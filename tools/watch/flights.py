"""The runs of a watch as its parts see them: each a problem of its own, the reference first."""

from dataclasses import dataclass, field

import numpy as np

from glider.tools.inference.expansion import Expansion, expand
from glider.tools.inference.fit import bounded_step
from glider.tools.inference.hyperparameters import WATCH
from glider.tools.inference.pooled import Scatter, marginalised
from glider.tools.inference.problem import Problem
from glider.tools.inference.shared_model import fit_shared, inflation_of
from glider.tools.inference.shared_parameters import SharedParameters
from glider.tools.watch.scatter import learn_scatter

LEAST_SIZE = 1e-6  # spreads by which runs may differ


@dataclass
class RunEnsemble:
    """Every run with the model that it is thought to fly by, and its parabola about that."""

    parts: list[Problem]
    shared: SharedParameters
    reference: np.ndarray  # (runs,) bool: before anything changed
    inflation: float = 1.0  # of the reference
    run_inflation: np.ndarray = field(default_factory=lambda: np.zeros(0))  # (runs,) times that: a form leaves more
    sizes: np.ndarray = field(default_factory=lambda: np.zeros(0))  # (count,) 1 sigma of what runs differ by
    form: dict[int, np.ndarray] = field(default_factory=dict)  # by run, (count,) 1 sigma: the form of its changes
    known: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))  # precision of the shared values
    certainty: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))  # inverse covariance of a run's own values
    values: np.ndarray = field(default_factory=lambda: np.zeros(0))  # (count,) shared
    raw: list[Expansion] = field(default_factory=list)  # not tempered, at `values`
    runs: list[Expansion] = field(default_factory=list)  # tempered, deviations integrated out, at what each flies by
    usual_course: tuple[np.ndarray, np.ndarray] | None = None  # of the reference (tools/watch/lasting.py), once asked
    # with what they were found of: a run's deviation, and its mean squared innovation there
    deviations: dict[int, tuple[Expansion, np.ndarray, float]] = field(default_factory=dict)

    @property
    def count(self) -> int:
        return len(self.parts)

    def learn(self, start: np.ndarray | None = None) -> None:
        """The shared model, the variance inflation and the scatter, from the reference."""
        own = numbers(self.reference)
        self.values = fit_shared([self.parts[n] for n in own], self.shared, start)
        self.raw = [expand(part, self.shared, self.values) for part in self.parts]
        found = [self.raw[n] for n in own]
        self.inflation, self.run_inflation = inflation_of(found), np.ones(self.count)
        self.sizes = learn_scatter([one.tempered(self.inflation) for one in found], self.shared)
        self.runs = [self.made(n, one) for n, one in enumerate(self.raw)]
        self.known = np.diag(self.shared.prior**-2.0) + sum(self.runs[n].curvature for n in own)
        self.certainty = np.linalg.inv(np.linalg.inv(self.known) + np.diag(np.maximum(self.sizes, LEAST_SIZE) ** 2))

    def inflation_in_run(self, n: int) -> float:
        """The variance inflation of a run."""
        return self.inflation * float(self.run_inflation[n])

    def made(self, n: int, one: Expansion) -> Expansion:
        """A parabola of a run as events are judged by it."""
        sizes = np.hypot(self.sizes, self.form[n]) if n in self.form else self.sizes
        return marginalised(one.tempered(self.inflation_in_run(n)), Scatter(sizes))

    def expanded(self, n: int, x: np.ndarray) -> Expansion:
        """A run's parabola about other values."""
        return expand(self.parts[n], self.shared, x)

    def put(self, n: int, one: Expansion) -> None:
        """A run flies by another model from now on: the one that its parabola is about."""
        self.raw[n], self.runs[n] = one, self.made(n, one)

    def inflate_run(self, n: int) -> None:
        """A run that the model of its change leaves noisier than the reference is, says the less of what all share."""
        self.run_inflation[n] = max(1.0, self.nis(n) / float(self.usual_nis.mean()))
        self.runs[n] = self.made(n, self.raw[n])

    def loosen(self, n: int, change: np.ndarray) -> None:
        """A run whose change (count,), spreads, may have another form than its label says the less of what all share.

        Each of its values may be off by `form` of what the change would look like, were it taken for that value alone.
        """
        A, form = self.raw[n].curvature, self.parts[n].kind.form
        own = form * np.abs(A @ change) / np.maximum(np.diag(A), 1.0)
        self.form[n] = np.hypot(self.form.get(n, 0.0), own)
        self.runs[n] = self.made(n, self.raw[n])

    def let_go(self, n: int) -> None:
        """A run that flies by a model that nobody knows says nothing of what the others share."""
        wide = np.maximum(self.sizes, self.shared.prior)
        self.runs[n] = marginalised(self.raw[n].tempered(self.inflation), Scatter(wide))

    def deviation(self, n: int) -> np.ndarray:
        """A run's own most probable deviation from the model that it flies by, (count,) spreads, within limits.

        Of what the reference leaves unknown of the shared values, and of what runs differ by.
        """
        return self._own(n)[1]

    def _own(self, n: int) -> tuple[Expansion, np.ndarray, float]:
        """A run's parabola, its deviation, and its mean squared innovation there; found once for a parabola."""
        one, known = self.raw[n], self.deviations.get(n)
        if known is None or known[0] is not one:
            shift = self.deviation_of(one)
            nis = one.nis + float(2.0 * one.slope @ shift + shift @ one.curvature @ shift) / one.samples
            self.deviations[n] = known = one, shift, nis
        return known

    def deviation_of(self, one: Expansion) -> np.ndarray:
        """The same of any parabola."""
        tempered = one.tempered(self.inflation)
        low, high = np.minimum(self.shared.low - one.at, 0.0), np.maximum(self.shared.high - one.at, 0.0)
        return bounded_step(tempered.curvature + self.certainty, tempered.slope, low, high)

    def own_cost(self, part: Problem, x: np.ndarray) -> float:
        """-2 log likelihood over the variance inflation of a run, as `part` knows it, at its most probable values
        about x.
        """
        one = expand(part, self.shared, x)
        own = one.at + self.deviation_of(one)
        return float(part.filter(*self.shared.model(part, own), begin=True).misfit[0]) / self.inflation

    def own_values(self, n: int) -> np.ndarray:
        """The values of a run with its own deviation, (count,)."""
        return self.raw[n].at + self.deviation(n)

    def nis(self, n: int) -> float:
        """Mean squared innovation of a run at its own values, by its parabola."""
        return self._own(n)[2]

    @property
    def usual_nis(self) -> np.ndarray:
        """The same of every run of the reference."""
        return np.array([self.nis(n) for n in numbers(self.reference)])

    def excess(self, n: int) -> float:
        """Squared innovations of a run beyond what the reference has of them, over the variance inflation."""
        return float((self.nis(n) - self.usual_nis.mean()) * self.raw[n].samples / self.inflation)


def excess_nis_sigma(flights: RunEnsemble, n: int) -> float:
    """How far a run's mean squared innovation lies above the reference's, by the model it flies by, in sigma."""
    values = flights.usual_nis
    chance = 2.0 / flights.runs[n].samples
    spread = float(values.var(ddof=1)) if len(values) > 2 else WATCH.scatter_nis**2
    return float((flights.nis(n) - values.mean()) / np.sqrt(chance + spread))


def numbers(state: np.ndarray) -> list[int]:
    """The runs where a state (runs,) holds."""
    return [int(n) for n in np.flatnonzero(state)]
