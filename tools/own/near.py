"""Models near one along a run, at once: errors of windows about its own, by the run's derivatives (`advance_near`).

Of models that give a derivative. Of those that give a step, or fly whole windows, every one is flown by itself.
"""

import contextlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from glider.tools.own import kernels as names
from glider.tools.own.compiled import RaisedError
from glider.tools.own.driven import driven_inputs, forces, held_inputs
from glider.tools.own.effects import ModelPoint
from glider.tools.own.observer import Filtered, Observer

MOST_ROWS = 400_000  # of models flown at once: memory


def errors_near(observer: Observer, n: int, points: Sequence[ModelPoint], by: Filtered, horizon: float) -> np.ndarray:
    """Errors of models in tolerances, as `Observer.residuals` has them, of which the others are near the first.

    by: the first one's filter, with its `linear`.
    """
    if not observer.gives_rates:
        return observer.residuals(n, points, by, horizon)
    starts, _ = observer.windows(n, horizon)
    driven = _Driven(observer, n, points)
    until = int(starts[-1]) + 1
    X0 = np.array([observer.start(n, point)[0] for point in points])

    def flown(of: np.ndarray) -> np.ndarray:
        states = np.full((len(of), until, by.states.shape[1]), np.nan)
        with contextlib.suppress(RaisedError):
            observer.vehicle.kernels.follow_near(
                driven.t[:until], driven.U[:, :until], driven.Y[:until], X0[of], driven.theta[of], points[0].own,
                driven.reading[of], driven.push[:, :until], driven.which[of], points[0].ports, observer.kinds,
                observer.scales, points[0].density, observer.angles, observer.parts, by.gains[:until],
                by.linear[:until], states,
            )  # fmt: skip
        return driven.errors(of, states[:, starts], horizon)

    return _in_parts(observer, n, len(points), flown)


def errors_pushed(observer: Observer, n: int, pushes: np.ndarray, horizon: float) -> np.ndarray:
    """Errors of the observer's own model, as `Observer.residuals`: as it is, and under each of some forces (patterns,
    rows, noises) beside its own."""
    states, pushes = observer.filter(n, observer.point).states, np.concatenate([np.zeros_like(pushes[:1]), pushes])
    if not observer.gives_rates:
        return _each(observer, n, horizon, [(states, one) for one in pushes])
    driven, starts = _Driven(observer, n, [observer.point], pushes), observer.windows(n, horizon)[0]
    begun = np.repeat(states[starts][None], len(pushes), axis=0)
    return _in_parts(observer, n, len(pushes), lambda of: driven.errors(of, begun[of], horizon))


def errors_unsettled(observer: Observer, n: int, horizon: float) -> np.ndarray:
    """Errors of the observer's own model, as `Observer.residuals`: as it is, and begun 1 sigma of the filter off in
    each of (errors,) directions, in every window its own, that are independent."""
    by = observer.filter(n, observer.point, covariances=True)
    starts, _ = observer.windows(n, horizon)
    m, n_o, states = len(observer.scales), observer.point.own.shape[1], len(observer.kinds)
    full = by.covariances.shape[1]
    known = np.append(np.arange(m), np.arange(full - n_o, full))
    begun = np.repeat(by.states[None], 1 + len(known), axis=0)
    for row in starts:
        sizes, axes = np.linalg.eigh(by.covariances[row][np.ix_(known, known)])
        root = axes * np.sqrt(np.maximum(sizes, 0.0))
        for k in range(len(known)):
            x = by.states[row, :states]
            begun[1 + k, row, :states] = names.normalised(names.plus(x, root[:m, k], observer.kinds), observer.kinds)
            begun[1 + k, row, states:] += root[m:, k]
    if not observer.gives_rates:
        return _each(observer, n, horizon, [(one, 0.0) for one in begun])
    driven = _Driven(observer, n, len(begun) * [observer.point])
    return _in_parts(observer, n, len(begun), lambda of: driven.errors(of, begun[of][:, starts], horizon))


class _Driven:
    """What models are driven and pushed by along a run, of those that differ, and their numbers."""

    def __init__(self, observer: Observer, n: int, points: Sequence[ModelPoint], beside: np.ndarray | None = None):
        """beside (patterns, rows, noises): the only point, under forces beside its own."""
        run, declared = observer.runs[n], observer.declared
        self.observer, self.n, self.point = observer, n, points[0]
        self.t, self.Y = run.t, run.outputs
        inputs, pushes, which = list[np.ndarray](), list[np.ndarray](), list[tuple[int, int]]()
        for point in points:
            moved, pushed = point.driven != points[0].driven, _forces(point) != _forces(points[0])
            if moved or not inputs:
                inputs.append(driven_inputs(run, declared, point))
            if moved or pushed or not pushes:
                pushes.append(forces(declared, point, run.t, inputs[-1 if moved else 0]))
            which.append((len(inputs) - 1 if moved else 0, len(pushes) - 1 if moved or pushed else 0))
        if beside is not None:
            which, pushes, points = [(0, k) for k in range(len(beside))], pushes[0] + beside, len(beside) * list(points)
        self.U = np.array([held_inputs(declared, one) for one in inputs])
        self.push, self.which = np.asarray(pushes), np.array(which)
        self.theta, self.reading = np.array([one.theta for one in points]), np.array([one.reading for one in points])

    def errors(self, of: np.ndarray, states: np.ndarray, horizon: float) -> np.ndarray:
        """Errors (models, scored rows, outputs) of some models, their windows flown from states (models, windows,
        n + o); turns counted, 0 where nothing was measured."""
        observer = self.observer
        starts, ends = observer.windows(self.n, horizon)
        found = np.isfinite(states[0]).all(axis=1)
        out = np.full((len(of), *self.Y.shape), np.nan)
        with contextlib.suppress(RaisedError):
            observer.vehicle.kernels.fly_near(
                self.t, self.U, starts[found], ends[found], np.ascontiguousarray(states[:, found]), self.theta[of],
                self.point.own, self.reading[of], self.push, self.which[of], observer.kinds, observer.scales,
                self.point.density, observer.angles, observer.parts, out,
            )  # fmt: skip
        return observer.smooth_errors(self.n, out, horizon)


def _each(observer: Observer, n: int, horizon: float, begun: Sequence[tuple[np.ndarray, Any]]) -> np.ndarray:
    """Errors of the observer's own model from states, with forces beside it, one after the other."""

    def flown(one: tuple[np.ndarray, Any]) -> np.ndarray:
        return observer.smooth_errors(n, observer.predict(n, observer.point, horizon, *one), horizon)

    return np.array(observer.each(flown, begun))


def _forces(point: ModelPoint) -> list[bytes]:
    return [one.tobytes() for one in (point.push, point.growth, point.form, point.operating)]


def _in_parts(observer: Observer, n: int, models: int, flown: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """What `flown` makes of models, as many at once as memory has room for, the first among them."""
    others = np.array_split(np.arange(1, models), -(-models * len(observer.runs[n].t) // MOST_ROWS))
    found = [flown(np.append(0, of)) for of in others]
    return np.concatenate([found[0][:1], *(one[1:] for one in found)])
