"""Events over runs: every label, from every run to every run, constant or growing, against no change.

All runs' parabolas are added up, with the shared values and the events found so far free; another event is one more
block of unknowns, and its evidence follows without any further flight.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glider.tools.inference.expansion import Expansion
from glider.tools.inference.fit import bounded_step
from glider.tools.inference.hyperparameters import WATCH
from glider.tools.inference.shared_parameters import SharedParameters

STEP, GROWING = "step", "growing"
TOGETHER = 512  # spans that are asked about at once


@dataclass(frozen=True)
class Span:
    """Runs first .. last - 1 of the watched ones, and by which course a change goes through them."""

    first: int
    end: int
    course: str

    def weights(self, runs: int) -> np.ndarray:
        """Share of the full size in each of the runs, (runs,)."""
        found = np.zeros(runs)
        count = self.end - self.first
        found[self.first : self.end] = np.arange(1, count + 1) / count if self.course == GROWING else 1.0
        return found


def spans(judged: Sequence[bool], begins: int) -> list[Span]:
    """Every span whose first and last run were judged; no event begins before run `begins`."""
    runs, found = len(judged), []
    for first in range(begins, runs):
        for end in range(first + 1, runs + 1):
            if judged[first] and judged[end - 1]:
                found.append(Span(first, end, STEP))
                if end == runs and sum(judged[first:end]) >= WATCH.growth_runs:
                    found.append(Span(first, end, GROWING))
    return found


@dataclass(frozen=True)
class Change:
    """A label over a span, with its most probable size and log evidence over no such change."""

    label: str
    span: Span
    size: np.ndarray  # of its parameters, spreads, at the full size
    precision: np.ndarray  # of the size, everything else integrated out
    evidence: float  # nat
    gain: float  # nat by which the misfit falls


@dataclass
class Joint:
    """Runs in their order, each marginalised; the shared values, and events taken as there, are the unknowns."""

    shared: SharedParameters
    runs: list[Expansion]
    taken: list[tuple[str, np.ndarray]]  # labels with their weights (runs,)

    def __post_init__(self) -> None:
        count = self.shared.count
        self.places = [(self.shared.labels[label], weights) for label, weights in self.taken]
        size = count + sum(len(columns) for columns, _ in self.places)
        H = np.eye(size)
        H[:count, :count] = np.diag(self.shared.prior**-2.0)
        r, constant = np.zeros(size), 0.0
        for n, run in enumerate(self.runs):
            H += self.taken_both(n, run.curvature)
            r += self.taken_in(n, run.offset)
            constant += run.constant
        self.H, self.r = H, r
        self.inverse = np.linalg.inv(H)
        self.u = -self.inverse @ r
        self.log_evidence = -0.5 * (constant - float(r @ self.inverse @ r) + float(np.linalg.slogdet(H)[1]))

    def taken_in(self, n: int, table: np.ndarray) -> np.ndarray:
        """What a run's values (count, ...) are in the unknowns: (unknowns, ...)."""
        return np.concatenate([table, *(weights[n] * table[columns] for columns, weights in self.places)])

    def taken_both(self, n: int, A: np.ndarray) -> np.ndarray:
        """A matrix (count, count) of a run's values in the unknowns, (unknowns, unknowns)."""
        return self.taken_in(n, self.taken_in(n, A).T)

    @property
    def values(self) -> np.ndarray:
        """The shared values, (count,)."""
        return self.u[: self.shared.count]

    def run_values(self, n: int, shared: np.ndarray | None = None) -> np.ndarray:
        """The values of a run with its events, (count,); about other shared values, where they are given."""
        x, at = (self.values if shared is None else shared).copy(), self.shared.count
        for columns, weights in self.places:
            x[columns] += weights[n] * self.u[at : at + len(columns)]
            at += len(columns)
        return x

    def size_of(self, event: int) -> tuple[np.ndarray, np.ndarray]:
        """Size of an event taken, spreads, and its covariance."""
        at = self.shared.count + sum(len(columns) for columns, _ in self.places[:event])
        own = slice(at, at + len(self.places[event][0]))
        return self.u[own], self.inverse[own, own]

    def changes(self, listed: Sequence[Span], only: Sequence[str] | None = None) -> list[Change]:
        """Every label over every span."""
        cross, slopes = [], []
        for n, run in enumerate(self.runs):
            cross.append(self.taken_in(n, run.curvature))
            slopes.append(run.slope + run.curvature @ (self.run_values(n) - run.at))
        tables = [np.array([run.curvature for run in self.runs]), np.array(cross), np.array(slopes)]
        upto = [np.concatenate([np.zeros_like(one[:1]), np.cumsum(one, axis=0)]) for one in tables]
        labels = list(self.shared.labels if only is None else only)
        single = [label for label in labels if len(self.shared.labels[label]) == 1]
        wide = [label for label in labels if label not in single]
        found: list[list[Change]] = []
        for first in range(0, len(listed), TOGETHER):
            chosen = listed[first : first + TOGETHER]
            sums = [self._sums(span, tables, upto) for span in chosen]
            by_label = {label: self._of_one(label, chosen, sums) for label in single}
            solved = [self.inverse @ one[1] for one in sums] if wide else []
            for label in wide:
                by_label[label] = [self._change(label, *one) for one in zip(chosen, sums, solved, strict=True)]
            found.append([by_label[label][k] for k in range(len(chosen)) for label in labels])
        return [one for part in found for one in part]

    def _sums(self, span: Span, tables: list[np.ndarray], upto: list[np.ndarray]) -> list[np.ndarray]:
        """Curvature (count, count), that with the unknowns (unknowns, count) and slope (count,) of a span's runs."""
        if span.course == STEP:
            return [one[span.end] - one[span.first] for one in upto]
        w = span.weights(len(self.runs))
        return [np.tensordot(share, one, 1) for share, one in zip((w**2, w, w), tables, strict=True)]

    def _of_one(self, label: str, among: Sequence[Span], sums: Sequence[Sequence[np.ndarray]]) -> list[Change]:
        """A label of one parameter over spans."""
        k = self.shared.labels[label][0]
        C = np.array([one[1][:, k] for one in sums])
        precision = np.array([one[0][k, k] for one in sums]) + 1.0 - np.einsum("si,si->s", C @ self.inverse, C)
        slope = np.array([one[2][k] for one in sums])
        low, high = self.shared.limits(label, self.values)
        size = np.clip(-slope / precision, low, high)
        gain = -(slope * size + 0.5 * size * precision * size)
        halved = np.log(2.0) * float(((low == 0.0) | (high == 0.0)).sum())
        evidence = gain - 0.5 * np.log(np.abs(precision)) + halved + self.shared.odds.get(label, 0.0)
        return [
            Change(label, span, size[n : n + 1], precision[n : n + 1, None], float(evidence[n]), float(gain[n]))
            for n, span in enumerate(among)
        ]

    def _change(self, label: str, span: Span, sums: Sequence[np.ndarray], solved: np.ndarray) -> Change:
        """One label over one span."""
        D, C, s = sums
        columns = self.shared.labels[label]
        own = np.ix_(columns, columns)
        precision = D[own] + np.eye(len(columns)) - C[:, columns].T @ solved[:, columns]
        precision = 0.5 * (precision + precision.T)
        slope = s[columns]
        low, high = self.shared.limits(label, self.values)
        try:
            size = bounded_step(precision, slope, low, high)
        except np.linalg.LinAlgError:
            size = np.zeros(len(columns))
        gain = -float(slope @ size + 0.5 * size @ precision @ size)
        halved = np.log(2.0) * sum((low == 0.0) | (high == 0.0))
        prior = float(halved) + self.shared.odds.get(label, 0.0)
        evidence = gain - 0.5 * float(np.linalg.slogdet(precision)[1]) + prior
        return Change(label, span, size, precision, evidence, gain)
