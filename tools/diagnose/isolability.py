"""Which effects planned flights could show and distinguish, from sensitivities alone: no flight is needed.

The nominal vehicle is simulated through a few manoeuvres and seen by the columns of a planned log. With the sensitivity
C of the whitened innovations to an effect's parameters, in units of their priors, and the projector Q onto what the
nuisance parameters (with their priors) leave, the information about the effect is S = C Q C'. An effect of the size of
its prior is expected to gain

    (trace S - ln det(1 + S)) / 2   nat of log evidence over none.

It grows with the square of the size, so that the smallest visible size follows. Against another effect, whose
parameters are free as well, the information is what the other leaves of S:

    S - B (1 + S_other)^-1 B',   B = C Q C_other'.

Two effects are confused where this leaves less evidence than distinguishes two hypotheses, for an effect of the size of
its prior or of CLEAR_NAT, whichever is smaller.

See docs/reference/causes.md.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from glider.firmware.core.vehicle.layout import X_DOWN, X_NU, X_QUAT
from glider.firmware.model.vehicle import Vehicle
from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.data.errors import InputError
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import Case
from glider.tools.data.runs.run import Run
from glider.tools.data.spelling import did_you_mean
from glider.tools.diagnose.next_run import MANOEUVRES, RATE, SECONDS, Manoeuvre, commands
from glider.tools.diagnose.search import THRESHOLD_STEP
from glider.tools.inference.fit import Fitter
from glider.tools.inference.hyperparameters import DIAGNOSIS
from glider.tools.inference.parameters import effect_parameters, nuisance_parameters
from glider.tools.inference.problem import Problem, problem_of

ONBOARD = (*names.COMMANDS, *names.DRAW_WIRES, *names.ATTITUDE, *names.RATES, names.DEPTH)
POSSIBLE = (*ONBOARD, *names.MOCAP)  # columns that a planned log may have
MEASURED = (*names.ATTITUDE, *names.RATES, names.DEPTH, *names.DRAW_WIRES, *names.MOCAP_POSITION, *names.MOCAP_ATTITUDE)
CLEAR_NAT = 100.0  # nat over none, of an effect that is clearly there
START_DEPTH, START_SPEED = 1.0, 0.1  # m, m/s


@dataclass(frozen=True)
class Isolability:
    """What planned flights would say of an effect of the size of its prior."""

    label: str
    evidence: float  # nat over none
    smallest: float  # size of the least visible one, in units of its prior; infinite where none is
    confused_with: tuple[str, ...]

    @property
    def visible(self) -> bool:
        """Whether the effect is expected to earn its place."""
        return self.evidence >= DIAGNOSIS.evidence_needed


def check_columns(wanted: Iterable[str]) -> None:
    """Raise InputError for a column that a planned log cannot have."""
    for name in wanted:
        if name not in POSSIBLE:
            raise InputError(f"no column '{name}'{did_you_mean(name, POSSIBLE)}", source="--columns")


def planned(vehicle: Vehicle, wanted: Sequence[str], manoeuvres: Sequence[Manoeuvre] = MANOEUVRES) -> Problem:
    """The problem of simulated flights of the nominal vehicle, one a manoeuvre, seen in some columns."""
    check_columns(wanted)
    t = np.arange(int(SECONDS * RATE)) / RATE
    blank = []
    for manoeuvre in manoeuvres:
        table = commands(vehicle, manoeuvre, t)
        columns = {names.TIME: t} | {name: table[:, n] for n, name in enumerate(names.COMMANDS)}
        blank.append(Run(manoeuvre.name, None, columns | {name: np.zeros(len(t)) for name in MEASURED}))
    case = Case(
        Path("planned"),
        vehicle,
        vehicle.name,
        "planned",
        RATE,
        998.0,
        True,
        blank,
        vehicle.sensors,
        vehicle.disturbance,
    )
    whole, rng = problem_of(case), np.random.default_rng(0)
    starts = np.zeros_like(whole.starts)
    starts[:, X_DOWN], starts[:, X_QUAT], starts[:, X_NU] = START_DEPTH, 1.0, START_SPEED
    Z, bounds = whole.simulated(whole.model.P, np.zeros(ef.N_F), starts, rng), whole.recording.bounds
    runs = []
    for n, run in enumerate(blank):
        seen = dict(zip(MEASURED, Z[bounds[n] : bounds[n + 1]].T, strict=True)) | {
            name: run.columns[name] for name in names.COMMANDS
        }
        kept = {name: values for name, values in seen.items() if name in wanted}
        runs.append(Run(run.name, None, {names.TIME: t} | kept))
    return problem_of(case, runs=runs)


def isolability(problem: Problem, labels: Sequence[str] | None = None) -> list[Isolability]:
    """What flights like those of a problem would say of every effect (or of some), the most evident first."""
    model = problem.model
    gains = problem.filter(model.P, np.zeros(ef.N_F), begin=True)
    fitter = Fitter(problem, gains, nuisance_parameters(problem))
    parameters = effect_parameters(problem)
    hypotheses = [fitter.hypothesis((label,), free) for label, free in parameters.items()]
    fitter.linearise(hypotheses, coarse=True)
    for one in hypotheses:
        one.shorter, one.bound_step = (0.1, 1.0) if one.runs_away(0) else (1.0, THRESHOLD_STEP)
    fitter.linearise(hypotheses, coarse=True)
    columns = {one.labels[0]: one.columns for one in hypotheses}
    left = {label: C - (C @ fitter.J.T) @ fitter.solve(fitter.J) for label, C in columns.items()}
    found = []
    for label, C in columns.items():
        if labels is not None and label not in labels:
            continue
        S = left[label] @ C.T
        half = 0.5 * float(np.trace(S))
        evidence = half - 0.5 * float(np.linalg.slogdet(np.eye(len(S)) + S)[1])
        smallest = float(np.sqrt(DIAGNOSIS.evidence_needed / half)) if half > 1e-6 else np.inf
        clear = min(1.0, CLEAR_NAT / max(half, 1e-6))
        rest = {other: _remaining(S, left[label] @ D.T, left[other] @ D.T) for other, D in columns.items()}
        near = sorted(
            (nat, other)
            for other, nat in rest.items()
            if other != label and clear * nat < DIAGNOSIS.confounded_evidence
        )
        found.append(Isolability(label, evidence, smallest, tuple(other for _, other in near)))
    return sorted(found, key=lambda one: -one.evidence)


def _remaining(S: np.ndarray, B: np.ndarray, other: np.ndarray) -> float:
    """Nat that half the trace of S keeps where another effect's parameters are free."""
    return 0.5 * float(np.trace(S - B @ np.linalg.solve(np.eye(len(other)) + other, B.T)))


def isolability_of(
    vehicle: Vehicle,
    wanted: Sequence[str],
    manoeuvres: Sequence[Manoeuvre] = MANOEUVRES,
    labels: Sequence[str] | None = None,
    advance: Callable[[int], None] = lambda n: None,
) -> list[Isolability]:
    """What planned flights of a vehicle would say of effects."""
    problem = planned(vehicle, wanted, manoeuvres)
    advance(1)
    found = isolability(problem, labels)
    advance(1)
    return found
