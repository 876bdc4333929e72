"""A force that lasts against water in disorder, of ocean gliders (docs/explanation/ocean.md).

Water has no lasting direction in the vehicle's axes: from dive to dive it moves them this way and that. What lasts
moves the depth rate, and a speed that is measured, alike in every dive, by its way and depth. That is a model of
its own, with a size for each way and depth, whatever brings it about.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glider.sim_backend.ocean.core import layout as at
from glider.tools.diagnose.noise_probes import NoiseProbe
from glider.tools.identify.ocean.identify import BANDS, strata
from glider.tools.inference.channels import Measures
from glider.tools.inference.expansion import linear
from glider.tools.inference.hyperparameters import WATCH
from glider.tools.inference.problem import Gains, Problem
from glider.tools.inference.shared_parameters import SharedParameters
from glider.tools.watch.flights import RunEnsemble, numbers

DIFFERENCE = 1e-3  # m/s, of a derivative
AXES = (("hydrodynamics", "surge"), ("mass", "net"))  # what turns with the way, what does not
Model = tuple[np.ndarray, np.ndarray]


@dataclass
class Pull:
    """What a run's readings say of a lasting course (courses,), in `lasting_speed`, and of shared values (count,).

    Both behind each other: precision of the parabola, and slope of the misfit.
    """

    precision: np.ndarray
    slope: np.ndarray

    def beside(self, scatter: np.ndarray) -> "Pull":
        """The same with a variance of its own of each, (courses + count,), integrated out."""
        inner = np.linalg.inv(np.eye(len(scatter)) + self.precision * scatter)
        return Pull(inner @ self.precision, inner @ self.slope)

    def less(self, usual: np.ndarray) -> "Pull":
        """The same of what is beside a course (courses,) that is usual."""
        return Pull(self.precision, self.slope + self.precision[:, : len(usual)] @ usual)


@dataclass
class Lasting:
    """A course that lasts, and how evident it is."""

    evidence: float  # nat over no such course, or over what the form of a label leaves
    size: np.ndarray  # (courses,) m/s
    confounded: bool = True  # whether the label beside it moves depth or speed at all

    def chance(self, odds: float) -> float:
        """Probability that there is such a course, by its log odds (nat) before any run was seen."""
        return float(1.0 / (1.0 + np.exp(-np.clip(odds + self.evidence, -50.0, 50.0))))

    def moves(self, measures: Measures) -> float:
        """Tolerances by which it moves the depth of a window or a speed, at most."""
        by_name = {one.name: one.tolerance for one in measures.channels}
        depth = measures.window / np.sqrt(3.0) / by_name["depth"]  # rms of a depth that runs away
        scales = np.array([depth] * (2 * BANDS) + [1.0 / by_name["speed"]] * (2 * BANDS))
        return float(np.abs(self.size * scales[: len(self.size)]).max())

    @property
    def place(self) -> NoiseProbe:
        """Where it is: what pulls along the path turns with the way, what weighs does not."""
        down, up = self.size[:BANDS], self.size[BANDS : 2 * BANDS]
        subsystem, element = AXES[int(np.abs(down + up).sum() > np.abs(down - up).sum())]
        return NoiseProbe("a force that lasts", "force", subsystem, element)


def columns(part: Problem, model: Model, gains: Gains, e: np.ndarray) -> np.ndarray:
    """Derivatives of innovations e (samples,) by a lasting course, (courses, samples), in `lasting_speed`.

    By depth rate, down positive, and where a speed is measured by that, in every way and depth.
    """
    number, t, yaw = strata(part.runs[0]), part.recording.t, part.recording.inputs[:, at.U_YAW]
    found = []
    for reads in (at.Y_DEPTH, at.Y_SPEED):
        read = part.seen[at.Y_DEPTH] if reads == at.Y_DEPTH else part.seen[at.Y_SPEED] or part.seen[at.Y_NORTH]
        for k in range(2 * BANDS if read else 0):
            inside, moved = (number == k).astype(float), np.zeros_like(part.z)
            if reads == at.Y_DEPTH:
                moved[:, at.Y_DEPTH] = np.cumsum(inside * np.diff(t, prepend=t[:1]))
            else:
                moved[:, at.Y_SPEED] = inside
                moved[:, at.Y_NORTH], moved[:, at.Y_EAST] = inside * np.cos(yaw), inside * np.sin(yaw)
            found.append(part.reading(part.z - DIFFERENCE * moved).follow([model], gains)[0])
    return np.asarray((np.array(found) - e) * (WATCH.lasting_speed / DIFFERENCE))


def pull_of(part: Problem, shared: SharedParameters, x: np.ndarray, inflation: float) -> Pull:
    """Of a run about the model at x (count,)."""
    gains, e, J = linear(part, shared, x)
    both = np.concatenate([columns(part, shared.model(part, x), gains, e), J])
    return Pull(both @ both.T / inflation, both @ e / inflation)


def course_of(pulls: Sequence[Pull], weights: Sequence[float], known: np.ndarray) -> Pull:
    """What runs say of the course that they share, each with its share of it.

    Beside values that they share all the same, of precision `known` (count, count), integrated out.
    """
    count, courses = len(known), len(pulls[0].slope) - len(known)
    A, g = np.zeros((courses + count,) * 2), np.zeros(courses + count)
    A[courses:, courses:] = known
    for weight, one in zip(weights, pulls, strict=True):
        w = np.concatenate([np.full(courses, weight), np.ones(count)])
        A, g = A + np.outer(w, w) * one.precision, g + w * one.slope
    inner = np.linalg.solve(A[courses:, courses:], np.column_stack([A[courses:, :courses], g[courses:]]))
    across = A[:courses, courses:]
    precision = A[:courses, :courses] - across @ inner[:, :-1]
    return Pull(0.5 * (precision + precision.T), g[:courses] - across @ inner[:, -1])


def evidence_of(pull: Pull, variance: np.ndarray) -> tuple[float, np.ndarray]:
    """Nat of a course of a variance (courses,) over none, and the course, in `lasting_speed`."""
    root = np.sqrt(variance)
    inner = np.eye(len(root)) + root[:, None] * pull.precision * root[None, :]
    c = -np.linalg.solve(inner, root * pull.slope)
    return float(-0.5 * (root * pull.slope) @ c - 0.5 * np.linalg.slogdet(inner)[1]), root * c


def of_flight(flights: RunEnsemble, n: int) -> Pull:
    """Of a watched run about the model that it flies by."""
    return pull_of(flights.parts[n], flights.shared, flights.raw[n].at, flights.inflation)


def usual(flights: RunEnsemble) -> tuple[np.ndarray, np.ndarray]:
    """The course that the runs learned from have all the same, in `lasting_speed`, and its variance from run to run."""
    pulls = [of_flight(flights, n) for n in numbers(flights.reference)]
    courses = len(pulls[0].slope) - flights.shared.count
    own = np.concatenate([np.zeros(courses), flights.sizes**2])
    pulls = [one.beside(own) for one in pulls]
    shared = course_of(pulls, [1.0] * len(pulls), np.diag(flights.shared.prior**-2.0))
    _, c = evidence_of(shared, np.ones(courses))
    beside = [one.less(c) for one in pulls]
    scores = np.array([one.slope[:courses] ** 2 for one in beside])  # their mean is the precision, where runs are alike
    sure = np.array([np.diag(one.precision)[:courses] for one in beside])
    return c, np.maximum((scores - sure).sum(axis=0) / np.maximum((sure**2).sum(axis=0), 1e-12), 0.0)


def beside_all(parts: Sequence[Problem], shared: SharedParameters, x: np.ndarray, inflation: float) -> Lasting:
    """What lasts in all runs of a case beside the model that they share, all that it allows free."""
    each = [pull_of(part, shared, x, inflation) for part in parts]
    pull = course_of(each, [1.0] * len(parts), np.diag(shared.prior**-2.0))
    evidence, c = evidence_of(pull, np.ones(len(pull.slope)))
    return Lasting(evidence, WATCH.lasting_speed * c)


def lasting(
    flights: RunEnsemble, runs: Sequence[int], weights: np.ndarray, label: str = "", size: np.ndarray | None = None
) -> Lasting:
    """What lasts in runs beside the models that they fly by, beyond what the runs learned from have.

    Beside a label that they have, of a size in spreads, the size is free, and the label's form is off by the share of
    its own course that its kind says, in each way and depth by itself: the evidence is that over such a form.
    """
    if flights.usual_course is None:
        flights.usual_course = usual(flights)
    mean, scatter = flights.usual_course
    courses = len(mean)
    known, free = flights.known.copy(), flights.shared.labels.get(label, [])
    known[free, :] = known[:, free] = 0.0
    known[free, free] = 1.0
    own = np.concatenate([scatter, flights.sizes**2])
    each = [of_flight(flights, n) for n in runs]
    shares = [float(weights[n]) for n in runs]
    pull = course_of([one.less(mean).beside(own) for one in each], shares, known)
    evidence, c = evidence_of(pull, np.ones(courses))
    if size is None:
        return Lasting(evidence, WATCH.lasting_speed * c)
    A = np.sum([w**2 * one.precision for w, one in zip(shares, each, strict=True)], axis=0)
    like = np.linalg.solve(A[:courses, :courses] + np.eye(courses), A[:courses][:, [courses + k for k in free]] @ size)
    of_form, _ = evidence_of(pull, (flights.parts[0].kind.form * like) ** 2)
    return Lasting(evidence - of_form, WATCH.lasting_speed * c, bool(np.abs(like).max() > WATCH.lasting_motion))
