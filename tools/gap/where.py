"""Where a gap sits: its square shared out over the parts of the model (docs/reference/gap.md, Words).

A first, linear answer. Every parameter of the catalogue's effects is a direction: a model that differs by its typical
size is flown, from starts of its own by the observer's kept gains, and the difference to the nominal flight is its
column; so are the parameters and biases that the nominal model allows for. Residuals are weighed by what noise,
disturbance and the search for starts leave in each channel, and by `independent_samples` a window and channel, as
flight residuals are coloured.
With normal amplitudes of those sizes the evidence of a set of parts has a closed form. Parts are added while that grows
by more than `part_evidence` and a flight with it bears that out. What a part takes of the gap is what that flight
takes; what the allowed explains of the rest goes to `allowed`.

Limits: columns are secants at one size, so that large effects (a stall, seconds of delay) are shared out coarsely;
parts with nearly the same column (a servo offset, a lateral centre of gravity, a roll trim) cannot be distinguished by
it, the first takes all; a part whose shape is not among the effects' lands in `unexplained` or in its nearest
likeness. It names no cause.
"""

from dataclasses import dataclass, replace

import numpy as np

from glider.tools.gap.cells import Cells, cells_of
from glider.tools.inference.hyperparameters import GAP
from glider.tools.inference.parameters import NUISANCE, effect_parameters, model_at, nuisance_parameters
from glider.tools.inference.predict import fly, fly_near, observe
from glider.tools.inference.prediction_error import MAX_COUNTED_TOLERANCES
from glider.tools.inference.problem import Problem, cut

MOST_PARTS = 4
LEAST_SHARE = 0.005  # a smaller share is not worth a line
CANDIDATES, SCALES = 8, (0.1, 0.25, 0.5, 1.0, 1.5)  # parts whose likely amplitude is flown, and at what shares of it
DRAWS = 3  # simulated recordings that find the floor
SEED = 20150723
ALLOWED, UNEXPLAINED = "allowed", "unexplained"
Part = tuple[str, str]


@dataclass(frozen=True)
class Share:
    """A part's share of the squared gap."""

    subsystem: str
    element: str
    share: float


def floor_of(problem: Problem, cells: Cells) -> np.ndarray:
    """Mean square in tolerances that noise, disturbance and the search for starts leave in each channel, (channels,).

    The model's own simulated recordings, predicted by itself.
    """
    P, F = model_at(problem, [], np.zeros(0))
    starts = observe(problem, P, F).X[problem.recording.bounds[:-1]]
    rng, square = np.random.default_rng(SEED), np.zeros(len(cells.rows))
    for _ in range(DRAWS):
        Z = problem.simulated(P, F, starts, rng)
        Y = fly(replace(problem, z=Z), P, F)
        for onboard, mocap in problem.kind.doubled:  # a channel is motion capture's where nothing is onboard
            Z[:, onboard] = np.where(np.isnan(Z[:, onboard]), Z[:, mocap], Z[:, onboard])
        error = cells.residual(Z, Y)
        square += error**2 / DRAWS
    return np.array([np.nanmean(square[cells.channel == n]) for n in range(len(cells.names))])


def evidence(G: np.ndarray, b: np.ndarray, variance: np.ndarray) -> tuple[float, np.ndarray]:
    """Log evidence of amplitudes N(0, variance) against none, and their mean; G, b: whitened columns' products."""
    root = np.sqrt(variance)
    A = np.eye(len(b)) + root[:, None] * G * root
    weighed = root * b
    solved = np.linalg.solve(A, weighed)
    return 0.5 * float(weighed @ solved) - 0.5 * float(np.linalg.slogdet(A)[1]), root * solved


class PartSearch:
    """The parts found so far, and how far along each direction the model was moved for them."""

    def __init__(self, problem: Problem, cells: Cells, table: np.ndarray, Y: np.ndarray, weight: np.ndarray):
        """table and Y (rows, N_Y): measured, and as the model predicts it; weight (samples,) of the scored ones."""
        self.problem, self.cells, self.table, self.weight = problem, cells, table, weight
        effects = problem.kind.catalogue()
        by_label = effect_parameters(problem)
        self.free = [*(p for own in by_label.values() for p in own), *nuisance_parameters(problem)]
        self.parts: list[Part | None] = [
            None if p.label == NUISANCE else (effects[p.label].subsystem, effects[p.label].element) for p in self.free
        ]
        self.allowed = np.array([float(p.label == NUISANCE) for p in self.free])  # their variance
        self.low = np.array([p.low for p in self.free])
        self.high = np.array([p.high for p in self.free])
        size = np.where(self.high >= 1.0, 1.0, np.maximum(self.low, -1.0))
        self.nominal = cells.residual(table, Y)
        moved = self.residuals([row * size for row in np.eye(len(size))])
        self.columns = (self.nominal - moved) / size[:, None]
        self.J = self.columns * weight
        self.G = self.J @ self.J.T

    def on(self, chosen: list[Part]) -> np.ndarray:
        """Which directions belong to the parts, bool of shape (directions,)."""
        return np.array([part in chosen for part in self.parts])

    def residuals(self, amplitudes: list[np.ndarray]) -> np.ndarray:
        """What is left at the scored samples of models moved by these amplitudes, (amplitudes, samples), tolerances.

        A flight that is lost is lost: no sample is off by more than MAX_COUNTED_TOLERANCES, or what the nominal one is.
        """
        flown = fly_near(self.problem, [model_at(self.problem, self.free, amplitude) for amplitude in amplitudes])
        left = np.array([self.cells.residual(self.table, Y) for Y in flown])
        lost = max(MAX_COUNTED_TOLERANCES, float(np.abs(self.nominal).max(initial=0.0)))
        return np.clip(np.nan_to_num(left, nan=lost, posinf=lost, neginf=-lost), -lost, lost)

    def run(self) -> tuple[list[Part], list[np.ndarray]]:
        """Parts one after the other, and the residual before the first and after each."""
        amplitude = np.zeros(len(self.parts))
        chosen: list[Part] = []
        left = [self.nominal]
        while len(chosen) < MOST_PARTS:
            b = self.J @ (left[-1] * self.weight)
            before, _ = evidence(self.G, b, self.allowed + self.on(chosen))
            tried = []
            for part in dict.fromkeys(self.parts):
                if part is not None and part not in chosen:
                    on = self.on([*chosen, part]).astype(float)
                    found, _ = evidence(self.G, b, self.allowed + on)
                    tried.append((found, part, evidence(self.G, b, on)[1]))
            tried = sorted((t for t in tried if t[0] > before + GAP.part_evidence), key=lambda t: -t[0])[:CANDIDATES]
            steps = [
                (part, np.clip(amplitude + scale * step, self.low, self.high))
                for _, part, step in tried
                for scale in SCALES
            ]
            if not steps:
                break
            rests = self.residuals([moved for _, moved in steps])
            misfit = ((rests * self.weight) ** 2).sum(axis=1)
            best = int(np.argmin(misfit))
            if misfit[best] > ((left[-1] * self.weight) ** 2).sum() - 2.0 * GAP.part_evidence:
                break
            part, amplitude = steps[best]
            chosen.append(part)
            left.append(rests[best])
        return chosen, left


def where(problem: Problem, Y: np.ndarray) -> list[Share]:
    """Shares of the squared gap of a problem predicted as Y, the largest first; `allowed` and `unexplained` last.

    They sum to 1.
    """
    measures = problem.kind.measures
    table = np.concatenate([measures.measured(run) for run in problem.runs])
    cells = cells_of(measures, problem.runs, problem.recording.bounds, cut(problem).listed, table)
    floor = floor_of(problem, cells)
    search = PartSearch(
        problem, cells, table, Y, np.sqrt(GAP.independent_samples / cells.cell_sizes() / floor[cells.channel])
    )
    chosen, left = search.run()

    squares = np.minimum.accumulate([cells.squared_gap(residual) for residual in left])
    whole, remaining = squares[0], squares[-1]
    shares = [Share(*part, (squares[n] - squares[n + 1]) / whole) for n, part in enumerate(chosen)]
    # What the allowed takes of the rest: parameters and biases by their columns, then the floor.
    _, mean = evidence(search.G, search.J @ (left[-1] * search.weight), search.allowed)
    mean = np.clip(mean, -GAP.allowed_sigma, GAP.allowed_sigma)
    by_columns = remaining - cells.squared_gap(left[-1] - search.columns.T @ mean)
    by_allowed = min(remaining, max(0.0, by_columns) + cells.squared_gap(np.sqrt(floor[cells.channel]))) / whole
    shares = sorted((share for share in shares if share.share >= LEAST_SHARE), key=lambda share: -share.share)
    unexplained = max(0.0, 1.0 - by_allowed - sum(share.share for share in shares))
    return [*shares, Share(ALLOWED, ALLOWED, by_allowed), Share(UNEXPLAINED, UNEXPLAINED, unexplained)]
