"""The observer of a user's vehicle over runs: filters, innovations by kept gains, and windows flown open loop."""

import contextlib
import copy
import itertools
import math
import threading
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numba
import numpy as np

from glider.tools.data.errors import InputError
from glider.tools.data.runs.columns import TIME
from glider.tools.data.runs.gate import SLOWEST_ROWS
from glider.tools.own import kernels as names
from glider.tools.own.compiled import RaisedError
from glider.tools.own.declare import ANGLE, QUATERNION, USUAL_START, USUAL_TOLERANCE, Declaration
from glider.tools.own.driven import driven_inputs, forces, held_inputs
from glider.tools.own.effects import ModelPoint, nominal_point, with_run_numbers
from glider.tools.own.load import LoadedVehicle, called, user_error
from glider.tools.own.runs import OwnRun
from glider.tools.own.steps import HORIZON, TIME_CONSTANTS, choose_parts, time_constant

FIRST_SECONDS, FIRST_READINGS = 1.0, 3  # over which the rate of an output at a run's start is taken, at least
WARM_UP, WARM_UP_SHARE = 2.0, 0.1  # s of a window that find its start, at most; of the horizon
NOTHING, NO_LINEAR = np.zeros(0), np.zeros((0, 0, 0, 0))
NO_POINT = ModelPoint(
    NOTHING, NOTHING, NOTHING, NOTHING, NOTHING, NOTHING, NOTHING, NOTHING, NOTHING, NOTHING
)  # the vehicle file's own is taken
LOST = 100.0  # tolerances: error of a flight that is lost, and of none more
QUATERNION_FIRST, QUATERNION_REST, USUAL_ATTITUDE = 2, 3, 0.1  # kinds of states; rad at the start
MOST_KEPT, MOST_LINEAR = 10_000, 4_000_000  # states that runs begin in; numbers of a run's linear parts
NOISE_SHARE = 0.25  # of an output's tolerance: noise where the file gives none


@dataclass
class Filtered:
    """What the filter of one model says of one run."""

    value: float  # -2 log likelihood
    squares: float
    samples: int
    gains: np.ndarray
    states: np.ndarray  # (rows, n + o) after each row
    covariances: np.ndarray  # (rows, errors, errors) of what the filter estimates, where they are asked for
    linear: np.ndarray  # (rows, parts, n, n + noises + o + 3) `kernels.linear_part` of each, where it is asked for


@dataclass
class Observer:
    """A vehicle's model along the runs of a case."""

    vehicle: LoadedVehicle
    runs: list[OwnRun]
    point: ModelPoint = field(default_factory=lambda: NO_POINT)
    parts: int = 1
    starts: list[int] = field(default_factory=list)  # which of several initial states each run has
    notes: list[str] = field(default_factory=list)
    _begun: dict[tuple[int, int, bytes, bytes], tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    _windows: dict[tuple[int, float], tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    _time_constant: float | None = None  # s, once it is asked for
    _first: dict[int, list[tuple[float, float]]] = field(default_factory=dict)  # first value and rate as they are read

    def __post_init__(self) -> None:
        declared = self.vehicle.declared
        self.declared = declared
        kinds, scales = state_kinds(declared), list[float]()
        for one, kind in zip(declared.states, kinds, strict=True):
            if kind != QUATERNION_REST:
                usual = USUAL_ATTITUDE if kind == QUATERNION_FIRST else USUAL_START.get(one.unit, 1.0)
                scales += (3 if kind == QUATERNION_FIRST else 1) * [one.start_uncertainty or usual]
        self.kinds, self.scales = np.array(kinds), np.array(scales)
        self.angles = np.array([one.angle for one in declared.outputs])
        self.tolerances = np.array(
            [one.tolerance or USUAL_TOLERANCE.get(one.unit, _range_share(self.runs, n))
             for n, one in enumerate(declared.outputs)]
        )  # fmt: skip
        if self.point is NO_POINT:
            self.point = nominal_point(declared)
            unknown = self.point.variance == 0.0
            self.point.variance[unknown] = (NOISE_SHARE * self.tolerances[unknown]) ** 2
        self.starts = self.starts or [0] * len(self.runs)
        self.notes += [f"{one.name} jumps by more than half a turn: an angle that wraps is declared with `angle`"
                       for n, one in enumerate(declared.outputs) if self._wraps(n)]  # fmt: skip
        self._choose_parts()
        self._choose_starts()

    def _wraps(self, k: int) -> bool:
        """Whether readings of an output in rad that is no angle jump by more than half a turn."""
        if self.angles[k] or self.declared.outputs[k].unit != "rad":
            return False
        read = [run.outputs[np.isfinite(run.outputs[:, k]), k] for run in self.runs]
        return any((np.abs(np.diff(values)) > np.pi).any() for values in read)

    def about(self, point: ModelPoint) -> "Observer":
        """The same observer with another model as its own."""
        other = copy.copy(self)
        other.point = point
        return other

    # how a run begins

    def first_readings(self, n: int, point: ModelPoint) -> dict[str, float]:
        """First value and rate of every output of run n, as the sensors' errors have it; NaN: none."""
        if n not in self._first:
            self._first[n] = [self._first_read(n, k) for k in range(len(self.declared.outputs))]
        found: dict[str, float] = {}
        for one, gain, bias, (value, rate) in zip(
            self.declared.outputs, point.reading[0], point.reading[1], self._first[n], strict=True
        ):
            times, known = gain or 1.0, self.declared.start.get(one.name)  # a dead sensor is of no use: as it reads
            found[one.name] = known[0] if known else float((value - bias) / times)
            found[f"{one.name}_rate"] = float(rate / times)
        return found

    def _first_read(self, n: int, k: int) -> tuple[float, float]:
        """First value and rate that output k of run n is read with."""
        run = self.runs[n]
        early = int(np.searchsorted(run.t, run.t[0] + FIRST_SECONDS, side="right"))
        read = np.flatnonzero(np.isfinite(run.outputs[:, k]))
        seen = read[: max(FIRST_READINGS, int(np.searchsorted(read, early)))]
        values, when = run.outputs[seen, k], run.t[seen] - run.t[0]
        if self.declared.outputs[k].angle:
            values = np.unwrap(values)
        sloped = len(seen) >= FIRST_READINGS and np.ptp(when) > 0.0
        return (float(values[0]) if len(seen) else np.nan, float(np.polyfit(when, values, 1)[0]) if sloped else np.nan)

    def start(self, n: int, point: ModelPoint) -> tuple[np.ndarray, np.ndarray]:
        """Initial state (states,) and its covariance (errors, errors) of a run."""
        # the model's numbers are asked for where [start] says what outputs are
        numbers = point.theta.tobytes() if self.declared.start else b""
        key = (n, self.starts[n], numbers, point.reading[:2].tobytes())
        found = self._begun.get(key)
        if found is None:
            if len(self._begun) >= MOST_KEPT:
                self._begun.clear()
            found = self._begun[key] = self._start(n, point)
        return found[0].copy(), found[1].copy()

    def _start(self, n: int, point: ModelPoint) -> tuple[np.ndarray, np.ndarray]:
        run, declared = self.runs[n], self.declared
        readings = self.first_readings(n, point)
        x = np.array([one.start for one in declared.states], dtype=np.float64)
        sd = self.scales.copy()
        if hasattr(self.vehicle.model, "initial"):
            given = called(self.vehicle, "initial", readings)
            if isinstance(given, list):
                given = given[self.starts[n] % len(given)]
            x, own = given if isinstance(given, tuple) else (given, None)
            x = np.array(x, dtype=np.float64)
            sd = sd if own is None else np.array(own, dtype=np.float64)
        else:
            for k, one in enumerate(declared.states):
                value = readings.get(one.name, np.nan)
                x[k] = value if np.isfinite(value) and one.kind != QUATERNION else x[k]
        if x.shape != (len(declared.states),) or sd.shape != self.scales.shape or not np.isfinite(x).all():
            blind = [one.column for one in declared.outputs if not np.isfinite(readings[one.name])]
            raise InputError(
                f"initial: expected {len(declared.states)} finite states (and {len(self.scales)} sigmas), got shape "
                f"{x.shape}: {np.array2string(x, precision=3, threshold=12)}, of {run.name}"
                + (f", which has no {', '.join(blind)}{_unread(run, declared)}" if blind else ""),
                source=self.vehicle.source,
            )
        for name, known in declared.start_states.items():
            k = declared.index("states", name)
            x[k], sd[k - np.count_nonzero(self.kinds[:k] == QUATERNION_FIRST)] = known
        return self._known(x, np.diag(sd**2), run, point)

    def _known(self, x: np.ndarray, P: np.ndarray, run: OwnRun, point: ModelPoint) -> tuple[np.ndarray, np.ndarray]:
        """The same with what [start] says of outputs: measurements without a sensor."""
        kernels = self.vehicle.kernels
        for name, (value, sigma) in self.declared.start.items():
            j = self.declared.index("outputs", name)
            h = kernels.measure(x, run.inputs[0], point.theta)[j]
            line = np.zeros(len(P))
            for k in range(len(P)):
                d = np.zeros(len(P))
                d[k] = names.DIFFERENCE_STEP * self.scales[k]
                line[k] = (kernels.measure(names.plus(x, d, self.kinds), run.inputs[0], point.theta)[j] - h) / d[k]
            across = P @ line
            total = line @ across + sigma**2
            x = names.plus(x, across * (value - h) / total, self.kinds)
            P = P - np.outer(across, across) / total
        return x, 0.5 * (P + P.T)

    def _choose_parts(self) -> None:
        choose_parts(self)

    def _choose_starts(self) -> None:
        """Of models with several initial states, that which explains a run best."""
        if not hasattr(self.vehicle.model, "initial"):
            return
        given = called(self.vehicle, "initial", self.first_readings(0, self.point))
        if not isinstance(given, list) or len(given) < 2:
            return
        for n in range(len(self.runs)):
            values = []
            for k in range(len(given)):
                self.starts[n] = k
                values.append(self.filter(n, self.point).value)
            self.starts[n] = int(np.argmin(values))

    # likelihood

    def filter(self, n: int, point: ModelPoint, covariances: bool = False, linear: bool = False) -> Filtered:
        """The filter of a model along run n; covariances, linear: kept too, the latter where there is room."""
        run, declared, kernels = self.runs[n], self.declared, self.vehicle.kernels
        rows, n_y = run.outputs.shape
        m, n_o = len(self.scales) + 2 * len(point.ports), point.own.shape[1]
        x, P = self.start(n, point)
        full, n_x = m + n_o, len(declared.states)
        of_row = self.parts, n_x, n_x + len(declared.noises) + n_o + 3
        room = linear and self.gives_rates and rows * math.prod(of_row) <= MOST_LINEAR
        keep = (np.zeros((rows, full, n_y)), np.full((rows, n_x + n_o), np.nan),
                np.zeros((rows if covariances else 0, full, full)),
                np.full((rows if room else 0, *of_row), np.nan))  # fmt: skip
        try:
            driven = driven_inputs(run, declared, point)
            with np.errstate(all="ignore"):
                value, squares, samples = kernels.filter_run(
                    run.t, held_inputs(declared, driven), run.outputs, x, P, point.theta, point.own, point.reading,
                    forces(declared, point, run.t, driven), point.density, point.variance, point.ports, self.kinds,
                    self.scales, self.angles, self.parts, keep,
                )  # fmt: skip
        except np.linalg.LinAlgError:
            value, squares, samples = np.inf, np.inf, 1
        except RaisedError as raised:
            if not isinstance(raised.error, np.linalg.LinAlgError):
                apart = float(np.median(np.diff(run.t)))
                hint = f" (rows {apart:.4g} s apart: is the time's unit right?)" if apart > SLOWEST_ROWS else ""
                raise user_error(raised.error, self.vehicle.source, run.name + hint) from None
            value, squares, samples = np.inf, np.inf, 1
        along = keep[3] if np.isfinite(value) else NO_LINEAR  # where the filter is lost models near one go on
        return Filtered(float(value), float(squares), int(samples), *keep[:3], along)

    def follow(self, n: int, point: ModelPoint, by: Filtered, rows: int | None = None) -> np.ndarray:
        """States (rows, n + o) of a model along run n by kept gains; NaN where it is lost, and behind the first rows,
        where it is asked for these."""
        run, kernels = self.runs[n], self.vehicle.kernels
        states, first = np.full(by.states.shape, np.nan), slice(rows)
        x, _ = self.start(n, point)
        driven = driven_inputs(run, self.declared, point)
        beside, driven = forces(self.declared, point, run.t, driven)[first], driven[first]
        with contextlib.suppress(RaisedError, np.linalg.LinAlgError):
            kernels.follow_run(
                run.t[first], held_inputs(self.declared, driven), run.outputs[first], x, point.theta, point.own,
                point.reading, beside, point.ports, self.kinds, self.angles, self.parts,
                len(self.scales), by.gains[first], states[first],
            )  # fmt: skip
        return states

    # windows

    def windows(self, n: int, horizon: float) -> tuple[np.ndarray, np.ndarray]:
        """First row flown open loop and row behind the last, of every window of run n.

        A run shorter than a window is one; what is left behind the last is not scored. Where [start] says how a run
        begins, its first window is flown from there: a warm-up would follow a sensor's offset.
        """
        if (n, horizon) in self._windows:
            return self._windows[n, horizon]
        t = self.runs[n].t - self.runs[n].t[0]
        warm = min(WARM_UP, WARM_UP_SHARE * horizon)
        count = int((t[-1] + 1e-6) // horizon)
        begins, ends = np.zeros(1, dtype=int), np.array([len(t)])
        if count >= 1:
            begins = np.searchsorted(t, horizon * np.arange(count) - 1e-6)
            ends = np.append(begins[1:], np.searchsorted(t, horizon * count + 1e-6))
        starts = np.minimum(np.searchsorted(t, t[begins] + warm - 1e-6), ends - 2)
        if self.declared.start or self.declared.start_states:
            starts[0] = 0
        self._windows[n, horizon] = starts, ends
        return starts, ends

    def _scored(self, n: int, horizon: float) -> tuple[np.ndarray, np.ndarray]:
        """Rows of run n that windows are scored by, and where among them each window begins (windows + 1,)."""
        starts, ends = self.windows(n, horizon)
        rows = np.concatenate([np.arange(a + 1, b) for a, b in zip(starts, ends, strict=True)])
        return rows, np.append(0, np.cumsum(ends - starts - 1))

    def predict(self, n: int, point: ModelPoint, horizon: float, states: np.ndarray, beside=0.0) -> np.ndarray:
        """Outputs (rows, outputs) of run n, window by window open loop from the state behind each warm-up; NaN else.

        No measurement behind a window's warm-up is used in it. beside (rows, noises): forces beside the point's own.
        """
        run, kernels = self.runs[n], self.vehicle.kernels
        starts, ends = self.windows(n, horizon)
        out, driven = np.full(run.outputs.shape, np.nan), driven_inputs(run, self.declared, point)
        found = np.isfinite(states[starts]).all(axis=1)
        starts, ends = starts[found], ends[found]
        if len(starts):
            with contextlib.suppress(RaisedError, np.linalg.LinAlgError):
                kernels.fly_run(
                    run.t, held_inputs(self.declared, driven), starts, ends, states[starts], point.theta, point.own,
                    point.reading, forces(self.declared, point, run.t, driven) + beside, self.kinds, self.angles,
                    self.parts, out,
                )  # fmt: skip
        return out

    def errors(self, n: int, predicted: np.ndarray, horizon: float, wrapped: bool = True) -> np.ndarray:
        """Measured less predicted (..., rows, outputs) in tolerances, (..., scored rows, outputs); NaN: not measured.

        wrapped: angles modulo 2 pi; else turns are counted from a window's start on, so that errors are smooth.
        """
        rows, cuts = self._scored(n, horizon)
        measured, predicted = self.runs[n].outputs[rows], predicted[..., rows, :]
        error = measured - predicted
        with np.errstate(invalid="ignore"):  # of a flight that ran away
            error[..., self.angles] = names.wrap(error[..., self.angles])
        for k in np.flatnonzero(self.angles) if not wrapped else ():
            seen = np.flatnonzero(np.isfinite(measured[:, k]))
            turned = np.any(np.abs(np.diff(error[..., seen, k])) > np.pi, axis=tuple(range(error.ndim - 2)))
            after = seen[1:][turned]
            for a, b in itertools.pairwise(cuts) if len(after) else ():
                if np.any((after > a) & (after < b)):
                    inside = seen[(seen >= a) & (seen < b)]
                    error[..., inside, k] = np.unwrap(error[..., inside, k])
        lost = np.isnan(predicted).all(axis=-1)
        if lost.any():
            error[lost] = np.where(np.isnan(measured), np.nan, LOST * self.tolerances)[np.nonzero(lost)[-1]]
        with np.errstate(over="ignore"):
            return np.clip(error / self.tolerances, -LOST, LOST)

    def predicted(self, n: int) -> np.ndarray:
        """Run n by the vehicle's own model, (rows, outputs): windows one after the other; what none covers is read.

        Rows of warm-ups, and what is left behind the last window, are the model's outputs at the filter's states.
        """
        point, kernels, run = with_run_numbers(self.declared, self.point), self.vehicle.kernels, self.runs[n]
        by = self.filter(n, point)
        out = self.predict(n, point, self.horizon, by.states)
        for row in np.flatnonzero(np.isnan(out).all(axis=1)):
            h = kernels.measure(by.states[row, : len(self.kinds)], run.inputs[row], self.point.theta)
            gain, bias, drift = self.point.reading[:3]
            out[row] = gain * h + bias + drift * (run.t[row] - run.t[0])
        return out

    def gaps(self, n: int, point: ModelPoint, horizon: float) -> np.ndarray:
        """Root mean square of measured less predicted, in tolerances, (outputs,), the run's own numbers estimated along
        it; NaN where nothing was recorded."""
        point = with_run_numbers(self.declared, point)
        error = self.errors(n, self.predict(n, point, horizon, self.filter(n, point).states), horizon)
        seen = np.isfinite(error).any(axis=0)
        found = np.full(len(self.tolerances), np.nan)
        found[seen] = np.sqrt(np.nanmean(error[:, seen] ** 2, axis=0))
        return found

    def residuals(self, n: int, points: Sequence[ModelPoint], by: Filtered, horizon: float) -> np.ndarray:
        """Errors of models in tolerances, (points, scored rows, outputs): windows begun by kept gains; missing: 0."""

        begun = int(self.windows(n, horizon)[0][-1]) + 1  # rows until the last window has begun

        def one(point: ModelPoint) -> np.ndarray:
            return self.smooth_errors(n, self.predict(n, point, horizon, self.follow(n, point, by, begun)), horizon)

        return np.array(self.each(one, points))

    def smooth_errors(self, n: int, predicted: np.ndarray, horizon: float) -> np.ndarray:
        """`errors` of a prediction, turns counted, 0 where nothing was measured."""
        return np.nan_to_num(self.errors(n, predicted, horizon, wrapped=False), nan=0.0)

    @property
    def gives_rates(self) -> bool:
        """Whether the model is a derivative, so that others near it are flown beside it."""
        return self.vehicle.level > 0 and not hasattr(self.vehicle.model, "step")

    def each_run(self, flown: Callable[[int], Any]) -> list[Any]:
        """Every run flown, the longest first: threads end together."""
        order = sorted(range(len(self.runs)), key=lambda n: -len(self.runs[n].t))
        found = dict(zip(order, self.each(flown, order), strict=True))
        return [found[n] for n in range(len(self.runs))]

    def each(self, flown: Callable[[Any], Any], over: Iterable[Any]) -> list[Any]:
        """Flights side by side, on as many threads as there are processors; one after the other on such a thread."""
        every, threads = list(over), numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]  # made at run time
        alone = threading.current_thread() is threading.main_thread()
        workers = min(len(every), threads) if self.vehicle.level and alone else 1
        workers = self.vehicle.kernels.at_once(workers) if workers > 1 else 1
        if workers < 2:
            return [flown(each) for each in every]
        found, left = [None] * len(every), iter(range(len(every)))

        def fly() -> None:
            for k in left:  # what is next is taken by whichever thread is free
                found[k] = flown(every[k])

        with ThreadPoolExecutor(workers - 1) as pool:
            others = [pool.submit(fly) for _ in range(1, workers)]
            fly()
            for one in others:
                one.result()
        return found

    @property
    def horizon(self) -> float:
        """Of windows, s: the file's, or some of the model's slowest time constants, the median of runs."""
        if self.declared.horizon is not None:
            return float(self.declared.horizon)
        if self._time_constant is None:
            self._time_constant = float(np.median([time_constant(self, n) for n in range(len(self.runs))]))
        return float(np.clip(TIME_CONSTANTS * self._time_constant, *HORIZON))


def _unread(run: OwnRun, declared: Declaration) -> str:
    """Columns of a run's file that the model has no use for, in brackets."""
    known = {TIME, *(one.column for one in declared.inputs), *(one.column for one in declared.outputs)}
    others = [name for name in run.columns if name not in known]
    return f" (the model knows nothing of {', '.join(others)})" if others else ""


def state_kinds(declared: Declaration) -> list[int]:
    """What each state is for the kernels: 0 vector, 1 angle, 2 first of a quaternion, 3 the others of it."""
    kinds: list[int] = []
    for one in declared.states:
        if one.kind != QUATERNION:
            kinds.append(int(one.kind == ANGLE))
        else:
            kinds.append(QUATERNION_REST if QUATERNION_FIRST in kinds[-3:] else QUATERNION_FIRST)
    return kinds


def _range_share(runs: Sequence[OwnRun], n: int) -> float:
    """A twentieth of an output's range: tolerance where neither file nor unit gives one."""
    values = np.concatenate([run.outputs[:, n] for run in runs])
    values = values[np.isfinite(values)]
    return float(np.ptp(values)) / 20.0 or 1.0 if len(values) else 1.0
