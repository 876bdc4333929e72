"""The observer of a model that is only rolled out: no filter, windows begin at trends of the readings."""

from dataclasses import dataclass, field

import numpy as np

from glider.tools.data.errors import InputError
from glider.tools.own import kernels as names
from glider.tools.own.driven import driven_inputs
from glider.tools.own.effects import ModelPoint
from glider.tools.own.load import called
from glider.tools.own.observer import NO_LINEAR, WARM_UP, WARM_UP_SHARE, Filtered, Observer
from glider.tools.own.runs import OwnRun
from glider.tools.own.steps import HORIZON
from glider.tools.own.trends import Trend, trend_of


@dataclass
class BlackBox(Observer):
    """A model that is only rolled out: its `initial` says where a window begins, by readings until its warm-up ends."""

    _trends: dict[int, list[Trend]] = field(default_factory=dict)  # by run

    def _choose_parts(self) -> None:
        self.kinds, self.scales = np.zeros(0, dtype=int), np.zeros(0)

    def _choose_starts(self) -> None:
        return

    def readings(self, n: int, point: ModelPoint, row: int, until: float) -> dict[str, float]:
        """Value and rate of every output at a row of run n, by readings until a time, with the sensors' errors off."""
        run, declared, found = self.runs[n], self.declared, dict[str, float]()
        if n not in self._trends:
            sigma = np.sqrt(self.point.variance)
            self._trends[n] = [trend_of(run.t, y, float(s), one.angle) for y, s, one in
                               zip(run.outputs.T, sigma, declared.outputs, strict=True)]  # fmt: skip
        for k, (one, trend) in enumerate(zip(declared.outputs, self._trends[n], strict=True)):
            gain, ((value, rate), _) = point.reading[0, k], trend.at(run.t[row], until)
            found[one.name] = (value - point.reading[1, k]) / gain if gain else np.nan
            found[f"{one.name}_rate"] = rate / gain if gain else np.nan
        return found | ({name: value for name, (value, _) in declared.start.items()} if row == 0 else {})

    @property
    def horizon(self) -> float:
        return float(self.declared.horizon or HORIZON[1])

    def filter(self, n: int, point: ModelPoint, covariances: bool = False, linear: bool = False) -> Filtered:
        rows = len(self.runs[n].t)
        return Filtered(0.0, 0.0, 1, np.zeros((rows, 0, 0)), np.zeros((rows, 0)), np.zeros((0, 0, 0)), NO_LINEAR)

    def follow(self, n: int, point: ModelPoint, by: Filtered, rows: int | None = None) -> np.ndarray:
        return by.states

    def predict(self, n: int, point: ModelPoint, horizon: float, states: np.ndarray, beside=0.0) -> np.ndarray:
        run = self.runs[n]
        driven = driven_inputs(run, self.declared, point)
        out = np.full(run.outputs.shape, np.nan)
        starts, ends = self.windows(n, horizon)
        warm = min(WARM_UP, WARM_UP_SHARE * horizon)
        for start, end in zip(starts, ends, strict=True):
            begin = int(np.searchsorted(run.t, run.t[start] - warm - 1e-6))
            part = OwnRun(run.name, run.t[begin:end], driven[begin:end], run.outputs[begin:end], run.path)
            readings = self.readings(n, point, begin, max(run.t[start], run.t[begin] + warm))
            x0 = called(self.vehicle, "initial", readings) if hasattr(self.vehicle.model, "initial") else readings
            with np.errstate(all="ignore"):  # a model that diverges is far off
                flown = called(self.vehicle, "rollout", x0, part.t - part.t[0], part.inputs, point.theta)
            flown = np.asarray(flown, dtype=np.float64)
            if flown.shape != part.outputs.shape:
                raise InputError(
                    f"rollout: expected {part.outputs.shape} outputs, got {flown.shape}", source=self.vehicle.source
                )
            lagged, history = np.zeros(flown.shape[1]), np.zeros(flown.shape)
            for row, h in enumerate(flown):
                out[begin + row] = names.read(h, part.t[row], row, part.t, lagged, history, self.angles, point.reading)
            out[begin:start] = np.nan
        return out

    def predicted(self, n: int) -> np.ndarray:
        return self.predict(n, self.point, self.horizon, np.zeros((0, 0)))
