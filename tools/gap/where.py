"""Where a gap sits: its square shared out over the parts of the model (docs/GAP.md, Words).

A first, linear answer. Every direction (tools/gap/directions) is flown once from the windows' fixed starts; the
difference to the nominal flight is its column. Residuals are weighed by what noise, disturbance and an uncertain start
leave in each channel, and by EFFECTIVE independent samples a window and channel, as flight residuals are coloured.
With normal amplitudes, one where a direction is at work and as small as [uncertainty] and [sensors] say where it is
only allowed for, the evidence of a set of parts has a closed form. Parts are added while that grows by more than
CLAIM and a flight with it bears that out. What a part takes of the gap is what that flight takes; what the allowed
explains of the rest goes to `allowed`.

Limits: columns are secants at one size, so that large effects (a stall, seconds of delay) are shared out coarsely;
parts with nearly the same column (a servo offset, a lateral centre of gravity, a roll trim) cannot be told apart by it,
the first takes all; the starts are the nominal filter's, whatever the sensors did to them; a part whose shape is not
among the directions lands in `unexplained` or in its nearest likeness. It names no cause.
"""

from dataclasses import dataclass

import numpy as np

from firmware.core.estimation.estimator_layout import E_ACT, E_NU
from firmware.core.vehicle.layout import X_ACT, X_NU
from tools.data.runs.case import Case
from tools.gap.cells import Cells, cells_of
from tools.gap.directions import DIRECTIONS, Direction, Scene
from tools.inference.channels import measured
from tools.inference.model import Model
from tools.inference.predict import Flown, Inputs, Variant, fly

EFFECTIVE = 4.0  # independent samples a window and channel: 18 s of residuals that hang together for some 4 s
CLAIM = 5.0  # nat of evidence that a part has to bring
MOST_PARTS = 4
LEAST = 0.005  # a smaller share is not worth a line
CANDIDATES, SCALES = 3, (0.25, 0.5, 1.0, 1.5)  # parts whose likely amplitude is flown, and at what shares of it
ALLOWED_SIGMA = 3.0  # beyond it a parameter or a bias is no longer one that the nominal allows for
DRAWS = 3  # disturbed flights that find the floor
DISTURBANCE_HOLD = 0.1  # s
SURE = np.repeat([0.01, 0.003], 3)  # m/s, rad/s: 1 sigma of a start that the filter found in peace
SEED = 20150723
ALLOWED, UNEXPLAINED = "allowed", "unexplained"


@dataclass(frozen=True)
class Share:
    """A part's share of the squared gap."""

    subsystem: str
    element: str
    share: float


def floor_of(case: Case, scene: Scene, cells: Cells) -> np.ndarray:
    """Mean square in tolerances that noise, disturbance and uncertain starts leave in each channel, (channels,)."""
    flown, rng = scene.flown, np.random.default_rng(SEED)
    recording = flown.recording
    strength = np.repeat([case.disturbance.linear, case.disturbance.angular], 3)
    held = np.diff(recording.t, append=recording.t[-1] + 1.0)
    held = np.where(held > 0.0, held, DISTURBANCE_HOLD)[:, None]
    variants = []
    for _ in range(DRAWS):
        # A row holds its acceleration until the next; shorter rows of the same spectral density are rougher.
        shaken = strength * np.sqrt(DISTURBANCE_HOLD / held) * rng.standard_normal((len(recording.t), 6))
        starts = flown.inputs.starts.copy()
        # A filter that is at odds with the model says so; that is the gap, and not what the nominal allows for.
        spread = np.minimum(flown.estimates.sd[flown.first - 1][:, E_NU:E_ACT], SURE)
        starts[:, X_NU:X_ACT] += spread * rng.standard_normal((len(starts), 6))
        variants.append(Variant(scene.P, Inputs(flown.inputs.modes, flown.inputs.values, starts, shaken)))
    shaken = fly(flown, variants)
    sensors = case.sensors
    noise = [*3 * [sensors.attitude], *3 * [sensors.gyro], sensors.depth, sensors.slider, sensors.ballast]
    variance = np.array([s.noise**2 + s.bias**2 for s in [*noise, *2 * [sensors.mocap_position]]])
    square = variance[cells.columns] / cells.scale**2
    square += np.mean([cells.residual(Y, scene.Y) ** 2 for Y in shaken], axis=0)
    return np.array([square[cells.channel == n].mean() for n in range(len(cells.names))])


def allowed_sigma(direction: Direction, case: Case, model: Model) -> float:
    """What the nominal allows for along a direction, in its sizes."""
    if direction.sensor:
        return getattr(case.sensors, direction.sensor).bias / abs(direction.size)
    if direction.parameter < 0:
        return 0.0
    unit = abs(model.P[direction.parameter]) if direction.relative else 1.0
    return model.sigma[direction.parameter] / (abs(direction.size) * unit) if unit else 0.0


def evidence(G: np.ndarray, b: np.ndarray, variance: np.ndarray) -> tuple[float, np.ndarray]:
    """Log evidence of amplitudes N(0, variance) against none, and their mean; G, b: whitened columns' products."""
    root = np.sqrt(variance)
    A = np.eye(len(b)) + root[:, None] * G * root
    weighed = root * b
    solved = np.linalg.solve(A, weighed)
    return 0.5 * float(weighed @ solved) - 0.5 * float(np.linalg.slogdet(A)[1]), root * solved


class Search:
    """The parts found so far, and how far along each direction the flight was moved for them."""

    def __init__(self, scene: Scene, cells: Cells, table: np.ndarray, weight: np.ndarray):
        self.scene, self.cells, self.table, self.weight = scene, cells, table, weight
        self.base = Variant(scene.P, scene.flown.inputs)
        flights = [d for d in DIRECTIONS if d.change is not None]
        senses = [d for d in DIRECTIONS if d.sense is not None]
        self.directions = flights + senses
        self.parts = [(d.subsystem, d.element) for d in self.directions]
        flown = fly(scene.flown, [d.changed(scene, self.base, 1.0) for d in flights])
        columns = [cells.residual(Y, scene.Y) for Y in flown]
        self.sensed = [d.sensed(scene) for d in self.directions]
        columns += [effect[cells.rows, cells.columns] / cells.scale for effect in self.sensed[len(flights) :]]
        self.columns = np.array(columns)
        self.J = self.columns * weight
        self.G = self.J @ self.J.T

    def on(self, chosen: list[tuple[str, str]]) -> np.ndarray:
        """Which directions belong to the parts, bool of shape (directions,)."""
        return np.array([part in chosen for part in self.parts])

    def residuals(self, amplitudes: list[np.ndarray]) -> np.ndarray:
        """What is left at the scored samples once directions are flown by these amplitudes, (amplitudes, samples)."""
        variants, offsets = [], []
        for amplitude in amplitudes:
            variant, offset = self.base, np.zeros_like(self.scene.Y)
            for n in np.flatnonzero(amplitude).tolist():
                variant = self.directions[n].changed(self.scene, variant, amplitude[n])
                offset = offset + amplitude[n] * self.sensed[n]
            variants.append(variant)
            offsets.append(offset)
        flown = fly(self.scene.flown, variants)
        return np.array([self.cells.residual(self.table, Y + o) for Y, o in zip(flown, offsets, strict=True)])

    def run(self, allowed: np.ndarray) -> tuple[list[tuple[str, str]], list[np.ndarray]]:
        """Parts one after the other, and the residual before the first and after each."""
        amplitude = np.zeros(len(self.parts))
        chosen: list[tuple[str, str]] = []
        left = [self.residuals([amplitude])[0]]
        while len(chosen) < MOST_PARTS:
            b = self.J @ (left[-1] * self.weight)
            before, _ = evidence(self.G, b, allowed + self.on(chosen))
            tried = []
            for part in dict.fromkeys(self.parts):
                if part not in chosen:
                    on = self.on([*chosen, part]).astype(float)
                    found, _ = evidence(self.G, b, allowed + on)
                    tried.append((found, part, evidence(self.G, b, on)[1]))
            tried = sorted((t for t in tried if t[0] > before + CLAIM), key=lambda t: -t[0])[:CANDIDATES]
            steps = [(part, amplitude + scale * step) for _, part, step in tried for scale in SCALES]
            if not steps:
                break
            rests = self.residuals([moved for _, moved in steps])
            misfit = ((rests * self.weight) ** 2).sum(axis=1)
            best = int(np.argmin(misfit))
            if misfit[best] > ((left[-1] * self.weight) ** 2).sum() - 2.0 * CLAIM:
                break
            part, amplitude = steps[best]
            chosen.append(part)
            left.append(rests[best])
        return chosen, left


def where(case: Case, model: Model, flown: Flown, Y: np.ndarray) -> list[Share]:
    """Shares of the case's squared gap, the largest first; `allowed` and `unexplained` last. They sum to 1."""
    slider, ballast = case.sensors.slider, case.sensors.ballast
    doubt = (2.0 * (slider.noise + slider.bias), 2.0 * (ballast.noise + ballast.bias))
    scene = Scene(case.runs, flown, model.P, Y, doubt)
    table = np.concatenate([measured(run) for run in case.runs])
    cells = cells_of(case.runs, flown, table)
    floor = floor_of(case, scene, cells)
    search = Search(scene, cells, table, np.sqrt(EFFECTIVE / cells.cell_sizes() / floor[cells.channel]))
    allowed = np.array([allowed_sigma(d, case, model) for d in search.directions]) ** 2
    chosen, left = search.run(allowed)

    squares = np.minimum.accumulate([cells.squared_gap(residual) for residual in left])
    whole, remaining = squares[0], squares[-1]
    shares = [Share(*part, (squares[n] - squares[n + 1]) / whole) for n, part in enumerate(chosen)]
    # What the allowed takes of the rest: parameters and biases by their columns, then the floor.
    _, mean = evidence(search.G, search.J @ (left[-1] * search.weight), allowed)
    mean = np.clip(mean, -ALLOWED_SIGMA * np.sqrt(allowed), ALLOWED_SIGMA * np.sqrt(allowed))
    by_columns = remaining - cells.squared_gap(left[-1] - search.columns.T @ mean)
    by_allowed = min(remaining, max(0.0, by_columns) + cells.squared_gap(np.sqrt(floor[cells.channel]))) / whole
    shares = sorted((share for share in shares if share.share >= LEAST), key=lambda share: -share.share)
    unexplained = max(0.0, 1.0 - by_allowed - sum(share.share for share in shares))
    return [*shares, Share(ALLOWED, ALLOWED, by_allowed), Share(UNEXPLAINED, UNEXPLAINED, unexplained)]
