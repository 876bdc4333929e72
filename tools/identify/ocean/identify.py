"""An ocean glider identified from a mission's dives: volume, drag, lift, compression, expansion, attitude, noise.

Gauss and Newton's steps in everything at once along the observer's innovations, held by what the vehicle file allows
(docs/explanation/ocean.md, Identification). Dives, and their ways and depths, differ by more than their noise says;
the covariance
is that of a sandwich.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from glider.sim_backend.ocean.core import layout as at
from glider.sim_backend.ocean.vehicle import PLACES, UNITS
from glider.tools.data.errors import InputError
from glider.tools.data.intervals import NINETY
from glider.tools.data.runs.case import Case
from glider.tools.data.runs.columns import ATTITUDE, DEPTH
from glider.tools.data.runs.run import Run
from glider.tools.identify.ocean.findings import (
    Calibration,
    far_from_file,
    groups_of,
    one_of_each_group,
    unopened,
)
from glider.tools.identify.ocean.levels import find_levels, some_runs
from glider.tools.identify.ocean.next_run import flown, to_part
from glider.tools.inference.expansion import Expansion, expand
from glider.tools.inference.ocean_inputs import drawn, missing_input, steady_seconds
from glider.tools.inference.parameters import FreeParameter, nuisance_parameters
from glider.tools.inference.problem import Problem, problem_of
from glider.tools.inference.shared_model import fit_shared, inflation_of
from glider.tools.inference.shared_parameters import SharedParameters
from glider.tools.inference.steady import first_values, steady_rows, vertical_water

MOST_RUNS = 24  # of the mission's first: drag creeps after that
# Dives that all of them are worth together: what the form of the model misses (a cell that lags in the thermocline, a
# hull that warms late) is the same in every dive, and no number of them makes it smaller.
EFFECTIVE_DIVES = 3.0
BANDS = 4  # of depth, of each way: the form's error goes with them (a thermocline takes a quarter of a dive)
SHORTEST = 300.0  # s of steady flight, for a run to be learned from
ROUNDS = 2
DENSITY = 1027.0  # kg/m3, at which the net mass is stated
WEAK_DIRECTION = 0.6  # of the prior's width that is left: such a direction the dives do not tell


@dataclass
class IdentifiedParameter:
    """One number of the vehicle, SI."""

    name: str
    mean: float
    sd: float
    unit: str
    prior_sd: float

    @property
    def ci90(self) -> tuple[float, float]:
        return self.mean - NINETY * self.sd, self.mean + NINETY * self.sd


@dataclass
class WeakDirection:
    """Numbers that go together: what one has more of, the others make up for."""

    names: list[str]
    weights: list[float]  # in prior spreads
    left: float  # of the prior's width

    def sentence(self) -> str:
        """For a person."""
        left = f"{100.0 * self.left:.0f} % of what was open is left"
        return f"{', '.join(self.names)} cannot be distinguished by these dives ({left})"


@dataclass
class OceanIdentification:
    """What was found, and from what."""

    case: Case  # with the noise found
    problem: Problem  # of the runs that were learned from
    P: np.ndarray
    places: list[int]  # of the parameters in P
    parameters: list[IdentifiedParameter]
    covariance: np.ndarray  # SI, of the parameters
    allowed: np.ndarray  # SI, the same as wide as other flights may ask for (allowance)
    ridges: list[WeakDirection]
    water: dict[str, float]  # rms of the vertical water by run, m/s
    left_out: list[str]
    groups: list[list[str]]  # of labels that these dives do not part
    findings: list[Calibration]  # far from the file

    @property
    def net_mass(self) -> IdentifiedParameter:
        """Mass less that of the water of DENSITY that the hull displaces (reference temperature), heavy positive."""
        volume = next(one for one in self.parameters if one.name == "volume")
        mass = float(self.P[at.MASS]) - DENSITY * volume.mean
        return IdentifiedParameter("net_mass", mass, DENSITY * volume.sd, "kg", DENSITY * volume.prior_sd)

    @property
    def next_run(self) -> dict[str, str] | None:
        """What to fly to part what these dives cannot, in a pilot's words; None where nothing is left."""
        flagged = to_part(self.groups, flown(self.problem.runs))
        return {"text": flagged} if flagged else None

    @property
    def water_rms(self) -> float:
        return float(np.sqrt(np.mean(np.square(list(self.water.values())))))


def learnable(runs: list[Run]) -> tuple[list[Run], list[str]]:
    """The runs that fly steadily long enough, and why the others are left out."""
    good, out = [], []
    for run in runs:
        missing = missing_input(run)
        steady = 0.0 if missing is not None else steady_seconds(run)
        if missing is not None:
            out.append(f"{run.name}: no {missing}")
        elif steady >= SHORTEST:
            good.append(run)
        else:
            out.append(f"{run.name}: {steady:.0f} s of steady flight, {SHORTEST:.0f} s are needed")
    return good, out


def identify_ocean(case: Case, say: Callable[[str], None] = lambda text: None) -> OceanIdentification:
    """The vehicle of a case, from its first dives; InputError where none can be learned from."""
    runs, left_out = learnable(case.runs)
    left_out = [*map(str, case.left_out), *left_out]
    if not runs:
        raise InputError(f"no run flies steadily for {SHORTEST:.0f} s: {left_out[0]}", source=case.folder)
    runs = runs[:MOST_RUNS]
    problem = problem_of(case, runs=runs)
    free = nuisance_parameters(problem)
    x = first_values(problem, free)
    say(f"{len(runs)} runs, {len(problem.z)} rows; a first guess of volume and drag")
    shared, inflation = SharedParameters(free, {}, {}, 1.0), inflation_for(len(runs))
    for _ in range(ROUNDS):
        parts = [problem.part(k) for k in range(len(runs))]
        x = fit_shared(parts, shared, x, inflation)
        P, F = shared.model(problem, x)
        case = find_levels(case, problem_of(case, runs=some_runs(runs)), P, F)
        problem = problem_of(case, runs=runs)
        say(f"vertical water {100.0 * case.disturbance.water:.2f} cm/s over {case.disturbance.water_time:.0f} s")
    x, found = fitted([problem.part(k) for k in range(len(runs))], shared, x)
    C, wide = covariance(found, shared, inflation), allowance(found, shared, inflation)
    P, F = shared.model(problem, x)
    places = [k for k, f in enumerate(free) if f.vector == "P" and f.entry in PLACES.values()]
    left = ridges(free, C)
    groups = groups_of([one.names for one in left], problem.one_group)
    return OceanIdentification(
        case, problem, P, [free[k].entry for k in places], parameters(free, places, P, C),
        _in_units(C, free, places), _in_units(wide, free, places), left,
        water_by_run(problem, P, F), left_out, groups,
        findings(problem, shared, x, found, C, inflation, groups),
    )  # fmt: skip


def findings(
    problem: Problem, shared: SharedParameters, x: np.ndarray, found: list[Expansion], C: np.ndarray, inflation: float,
    groups: list[list[str]],
) -> list[Calibration]:  # fmt: skip
    """Calibrations that are far from the file, also of those that it has no uncertainty of: each by itself."""
    P, count = problem.model.P, len(x)
    normal, slope = precision_of(found, shared, x, inflation)
    wider = np.maximum(np.diag(C) / np.diag(np.linalg.inv(normal)), 1.0)
    flagged = far_from_file(shared.free, x, normal, slope, P, groups, wider)
    more = unopened(problem.model.sigma)
    if more:
        whole = SharedParameters([*shared.free, *more], {}, {}, 1.0, effects=1.0)
        x = np.concatenate([x, np.zeros(len(more))])
        about = [expand(problem.part(n), whole, x) for n in range(len(problem.runs))]
        normal, slope = precision_of(about, whole, x, inflation)
        for k in range(count, count + len(more)):
            own = [*range(count), k]
            free = [whole.free[n] for n in own]
            each = far_from_file(free, x[own], normal[np.ix_(own, own)], slope[own], P, groups, wider.max())
            flagged += [one for one in each if not one.name]
    return one_of_each_group(flagged)


def precision_of(
    found: list[Expansion], shared: SharedParameters, x: np.ndarray, inflation: float
) -> tuple[np.ndarray, np.ndarray]:
    """Curvature (count, count) and slope (count,) at x of the misfit over the variance inflation, with the prior's."""
    weight = shared.prior**-2.0
    normal = sum(one.curvature for one in found) / inflation + np.diag(weight)
    return np.asarray(normal), np.asarray(sum(one.slope for one in found) / inflation + weight * x)


def inflation_for(runs: int) -> float:
    """By how much the evidence of so many runs counts for less."""
    return max(1.0, runs / EFFECTIVE_DIVES)


def fitted(
    parts: list[Problem], shared: SharedParameters, start: np.ndarray
) -> tuple[np.ndarray, list[Expansion]]:  # fmt: skip
    """The most probable values (count,) of runs, each a problem of its own, in spreads, and the runs about them."""
    x = fit_shared(parts, shared, start, inflation_for(len(parts)))
    return x, [expand(part, shared, x, strata=strata(part.runs[0])) for part in parts]


def allowance(found: list[Expansion], shared: SharedParameters, inflation: float) -> np.ndarray:
    """By how much other flights may ask for other values, (count, count) in spreads: all runs weigh as
    EFFECTIVE_DIVES, or as they differ.

    Flown otherwise, or with an effect beside them, they are met by another error of the form than these runs were.
    """
    inflation, prior = max(inflation, inflation_of(found)), np.diag(shared.prior**-2.0)
    precision = np.sum([one.curvature for one in found], axis=0) / inflation + prior
    inverse = np.linalg.inv(precision)
    return np.asarray(inverse @ larger(precision, prior + scatter(run_pulls(found)) / inflation**2) @ inverse)


def _in_units(C: np.ndarray, free: list[FreeParameter], places: list[int]) -> np.ndarray:
    """The part of a covariance (count, count) in spreads that is of `places`, SI."""
    spreads = np.array([free[k].spread for k in places])
    return np.asarray(C[np.ix_(places, places)] * np.outer(spreads, spreads))


def strata(run: Run) -> np.ndarray:
    """Of each row its way and depth, (rows,): 0 to BANDS - 1 down, BANDS to 2 BANDS - 1 up, the shallowest first."""
    depth, pitch = (drawn(run.t, run.columns[name])[0] for name in (DEPTH, ATTITUDE[1]))
    band = np.clip((BANDS * depth / max(float(depth.max()), 1.0)).astype(int), 0, BANDS - 1)
    return np.asarray(np.where(pitch > 0.0, BANDS + band, band))


def covariance(found: list[Expansion], shared: SharedParameters, least_inflation: float = 1.0) -> np.ndarray:
    """Of the most probable values about the true ones, (count, count) in spreads: N^-1 (prior + J) N^-1, a sandwich.

    N: the precision that the values were found by, evidence over the variance inflation and prior. J: by how much the
    runs' pulls vary from chance, over the squared variance inflation; in each direction the largest of three:
    - what the noise levels say;
    - how the pulls of whole runs differ, from run to run;
    - how those of all runs together differ from stratum to stratum of way and depth, as the form of the model makes
      them where it is wrong alike in every run: no number of runs makes that smaller.
    The variance inflation keeps the values of real vehicles within what is physical, and is no measure of how wrong
    they are: on twin missions, whose form is nearly right, it is half again too large.
    """
    noise = inflation_of(found)
    inflation, prior = max(least_inflation, noise), np.diag(shared.prior**-2.0)
    total = np.sum([one.curvature for one in found], axis=0)
    inverse = np.linalg.inv(total / inflation + prior)
    meat = prior + total * noise / inflation**2
    for pulls in (run_pulls(found), stratum_pulls(found, total)):
        meat = larger(meat, prior + scatter(pulls) / inflation**2)
    return np.asarray(inverse @ meat @ inverse)


def scatter(pulls: np.ndarray) -> np.ndarray:
    """What pulls (n, count) say of how their sum varies, (count, count)."""
    count = len(pulls)
    return np.asarray(pulls.T @ pulls * count / max(count - 1.0, 1.0))


def run_pulls(found: list[Expansion]) -> np.ndarray:
    """Pulls of every run less their mean, (runs, count); 0 of fewer than three: they do not say how runs differ."""
    slopes = np.array([one.slope for one in found])
    return slopes - slopes.mean(axis=0) if len(found) > 2 else 0.0 * slopes


def stratum_pulls(found: list[Expansion], total: np.ndarray) -> np.ndarray:
    """Pulls of every stratum over all runs, (strata, count), less their share of what pulls all strata alike.

    total: curvature of everything (count, count). Shares go with each stratum's own curvature. 0 of fewer than three
    runs.
    """
    slopes = np.sum([[part.slope for part in one.parts] for one in found], axis=0)
    curvatures = np.sum([[part.curvature for part in one.parts] for one in found], axis=0)
    common = np.linalg.pinv(total, hermitian=True) @ slopes.sum(axis=0)
    return np.asarray(slopes - curvatures @ common) * float(len(found) > 2)


def larger(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Of two covariances (n, n), A positive, the larger in each of the directions in which both are diagonal."""
    root = np.linalg.cholesky(A)
    inner = np.linalg.solve(root, np.linalg.solve(root, B).T)
    values, vectors = np.linalg.eigh(0.5 * (inner + inner.T))
    back = root @ vectors
    return np.asarray((back * np.maximum(values, 1.0)) @ back.T)


def parameters(free: list[FreeParameter], places: list[int], P: np.ndarray, C: np.ndarray) -> list[IdentifiedParameter]:
    """The vehicle's numbers by name."""
    names = {place: name for name, place in PLACES.items()}
    return [
        IdentifiedParameter(names[free[k].entry], float(P[free[k].entry]), float(np.sqrt(C[k, k]) * free[k].spread),
                  UNITS[names[free[k].entry]], free[k].spread)
        for k in places
    ]  # fmt: skip


def ridges(free: list[FreeParameter], C: np.ndarray) -> list[WeakDirection]:
    """Directions in which next to nothing was learned: more than WEAK_DIRECTION of the prior's width is left."""
    names = {place: name for name, place in PLACES.items()}
    values, vectors = np.linalg.eigh(C)
    found = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        if np.sqrt(value) < WEAK_DIRECTION:
            break
        chosen = [k for k in np.argsort(-np.abs(vector)) if abs(vector[k]) > 0.25 and free[k].vector == "P"]
        if chosen:
            listed = [names[free[k].entry] for k in chosen]
            found.append(WeakDirection(listed, [float(vector[k]) for k in chosen], float(np.sqrt(value))))
    return found


def water_by_run(problem: Problem, P: np.ndarray, F: np.ndarray) -> dict[str, float]:
    """Root mean square of the vertical water by run, m/s."""
    steady = steady_rows(problem)
    water = vertical_water(problem, P, F, steady)
    return {
        run.name: float(np.sqrt(np.mean(water[steady.run == n] ** 2)))
        for n, run in enumerate(problem.runs) if (steady.run == n).any()
    }  # fmt: skip
