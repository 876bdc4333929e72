"""A model as a functional mock-up unit for co-simulation, FMI 2 or 3, run by FMPy: a black box that is rolled out.

Its variables say what it is: `input`, `output`, and `parameter` (or `structuralParameter`) of a real type, with their
units. A parameter `NAME_start`, NAME an output, is no parameter of the vehicle: a rollout begins with the first reading
of the output there; `NAME_rate_start` gets its slope.
"""

import atexit
import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.data.errors import InputError

REAL = {"Real", "Float64", "Float32"}
START = "_start"


class FmuModel:
    """An FMU that is asked for rollouts; InputError where it cannot be used."""

    def __init__(self, path: Path):
        import fmpy  # of the extra `fmu`

        self.path = path
        try:
            self._described = fmpy.read_model_description(str(path), validate=False)
        except Exception as error:  # of whatever reads the archive and its XML
            raise self._wrong(error) from None
        if self._described.coSimulation is None:
            raise InputError("an FMU for co-simulation is needed, this one is for model exchange", source=path)
        variables = [one for one in self._described.modelVariables if one.type in REAL]
        self._places = {one.name: one.valueReference for one in variables}
        outputs = [one.name for one in variables if one.causality == "output"]
        starts = {f"{name}{rate}{START}" for name in outputs for rate in ("", "_rate")}
        self._starts = [one.name for one in variables if one.name in starts and one.causality == "parameter"]
        self.inputs = {one.name: one.unit or "1" for one in variables if one.causality == "input"}
        self.outputs = [{"name": one.name, "unit": one.unit or "1"} for one in variables if one.causality == "output"]
        self.parameters = [
            [one.name, one.unit or "1", float(one.start or 0.0)] for one in variables
            if one.causality in ("parameter", "structuralParameter") and one.name not in self._starts
        ]  # fmt: skip
        try:
            folder = fmpy.extract(str(path))
            atexit.register(shutil.rmtree, folder, ignore_errors=True)
            self._unit: Any = fmpy.instantiate_fmu(folder, self._described, fmi_type="CoSimulation")
        except Exception as error:  # a binary of another machine, an archive without one
            raise self._wrong(error) from None
        self._third = self._described.fmiVersion.startswith("3")

    def _wrong(self, error: Exception) -> InputError:
        return InputError(f"the FMU cannot be used: {' '.join(str(error).split())[:200]}", source=self.path)

    def _set(self, values: dict[str, float]) -> None:
        places = [self._places[name] for name in values]
        (self._unit.setFloat64 if self._third else self._unit.setReal)(places, list(values.values()))

    def _get(self, names: list[str]) -> list[float]:
        places = [self._places[name] for name in names]
        return list((self._unit.getFloat64 if self._third else self._unit.getReal)(places))

    def rollout(self, x0: dict[str, float], t: np.ndarray, u: np.ndarray, theta: np.ndarray) -> np.ndarray:
        """Outputs (rows, outputs) from readings x0 at t (rows,) s under u (rows, inputs), held from row to row."""
        unit, names = self._unit, [one["name"] for one in self.outputs]
        begin = {one: x0.get(one.removesuffix(START), math.nan) for one in self._starts}
        values = {name: float(value) for (name, _, _), value in zip(self.parameters, theta, strict=True)}
        driven = [dict(zip(self.inputs, map(float, row), strict=True)) for row in u]
        unit.reset()
        if not self._third:
            unit.setupExperiment(startTime=float(t[0]))
        self._set(values | {name: value for name, value in begin.items() if math.isfinite(value)})
        if self._third:
            unit.enterInitializationMode(startTime=float(t[0]))
        else:
            unit.enterInitializationMode()
        self._set(driven[0])
        unit.exitInitializationMode()
        rows = [self._get(names)]
        for now, after, inputs in zip(t[:-1], t[1:], driven[:-1], strict=True):
            self._set(inputs)
            unit.doStep(currentCommunicationPoint=float(now), communicationStepSize=float(after - now))
            rows.append(self._get(names))
        return np.array(rows, dtype=np.float64)
