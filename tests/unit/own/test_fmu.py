"""A vehicle whose model is an FMU that another project's builder made, FMI 2 and 3."""

import textwrap
from dataclasses import replace

import numpy as np
import pytest

from glider.hal.strict import ConfigError
from glider.tools.data.errors import InputError
from glider.tools.own.check import load_own
from glider.tools.own.diagnose import diagnose_own, plain
from glider.tools.own.identified import VEHICLE as VEHICLE_FILE
from glider.tools.own.identified import write
from glider.tools.own.identify import identify
from glider.tools.own.load import read_own
from glider.tools.own.runs import OwnRun

SLAVES = {
    2: """
        import math
        from pythonfmu import Fmi2Causality as C, Fmi2Slave, Fmi2Variability as V, Real

        class Body(Fmi2Slave):
            def __init__(self, **given):
                super().__init__(**given)
                self.heat = self.warmth = self.warmth_start = 0.0
                self.loss, self.gain = 0.2, 0.5
                self.register_variable(Real("heat", causality=C.input))
                self.register_variable(Real("warmth", causality=C.output))
                for name in ("loss", "gain", "warmth_start"):
                    self.register_variable(Real(name, causality=C.parameter, variability=V.fixed))
        """,
    3: """
        import math
        from pythonfmu3 import Fmi3Causality as C, Fmi3Slave, Fmi3Variability as V, Float64

        class Body(Fmi3Slave):
            def __init__(self, **given):
                super().__init__(**given)
                self.time = self.heat = self.warmth = self.warmth_start = 0.0
                self.loss, self.gain = 0.2, 0.5
                self.register_variable(Float64("time", causality=C.independent, variability=V.continuous))
                self.register_variable(Float64("heat", causality=C.input, start=0.0))
                self.register_variable(Float64("warmth", causality=C.output))
                for name in ("loss", "gain", "warmth_start"):
                    value = getattr(self, name)
                    self.register_variable(Float64(name, causality=C.parameter, variability=V.fixed, start=value))
        """,
}
MOTION = """
            def exit_initialization_mode(self):
                self.warmth = self.warmth_start

            def do_step(self, t, step):
                share = math.exp(-self.loss * step)
                self.warmth = share * self.warmth + (1.0 - share) * self.gain * self.heat / self.loss
                return True
        """
VEHICLE = """
format = 1
model = "Body.fmu"
[parameters.loss]
uncertainty = 0.1
[sensors.warmth]
tolerance = 0.5
[windows]
seconds = 20.0
"""


def warmed(start: float, heat: np.ndarray, loss: float) -> np.ndarray:
    """What the body does under heat of every half second."""
    found, share = [start], np.exp(-loss * 0.5)
    for one in heat[:-1]:
        found.append(share * found[-1] + (1.0 - share) * 0.5 * one / loss)
    return np.array(found)


@pytest.fixture(scope="module", params=[2, 3])
def vehicle(request, tmp_path_factory):
    builder = pytest.importorskip({2: "pythonfmu", 3: "pythonfmu3"}[request.param]).builder
    folder = tmp_path_factory.mktemp(f"fmi{request.param}")
    script = f"body{request.param}.py"  # both live in one interpreter: a module each
    (folder / script).write_text(
        textwrap.dedent(SLAVES[request.param]) + textwrap.dedent(MOTION).replace("\n", "\n    ")
    )
    built = builder.FmuBuilder.build_FMU(folder / script, dest=folder)
    assert built is not None
    (folder / "body.toml").write_text(VEHICLE)
    return folder / "body.toml"


def test_what_its_variables_say_is_the_declaration_and_a_rollout_begins_at_the_readings(vehicle):
    own = load_own(vehicle)
    assert own.level == 0
    declared = own.declared
    names = [[one.name for one in some] for some in (declared.inputs, declared.outputs, declared.parameters)]
    assert names == [["heat"], ["warmth"], ["loss", "gain"]]
    t, heat = np.arange(0.0, 30.0, 0.5), np.repeat([4.0, 0.0, 8.0], 20)
    for loss in (0.2, 0.4, 0.2):  # no rollout depends on the one before
        flown = own.model.rollout({"warmth": 3.0, "warmth_rate": 0.0}, t, heat[:, None], np.array([loss, 0.5]))
        assert flown[:, 0] == pytest.approx(warmed(3.0, heat, loss), abs=1e-9)


def test_it_is_identified_and_a_weaker_heater_is_told(vehicle, tmp_path):
    random, runs, t = np.random.default_rng(2), [], np.arange(0.0, 60.0, 0.5)
    for n in range(3):
        heat = np.repeat(random.uniform(0.0, 10.0, 12), 10)
        y = warmed(float(random.uniform(0.0, 5.0)), heat, 0.3) + 0.05 * random.standard_normal(len(t))
        runs.append(OwnRun(f"run{n}", t, heat[:, None], y[:, None]))
    found = identify(load_own(vehicle), [runs])
    assert 0.2 + found.values[0] * found.nuisance[0].spread == pytest.approx(0.3, abs=0.01)
    write(found, tmp_path)
    again = load_own(tmp_path / VEHICLE_FILE)
    weaker = [replace(run, inputs=run.inputs / 0.7) for run in runs]
    chances = plain(again, *reversed(diagnose_own(again, weaker)), "weaker")["causes"]
    alike = [one["probability"] for one in chances if one["label"] in ("heat_gain", "gain", "warmth_gain")]
    assert sum(alike) > 0.8


def test_a_file_that_is_none_is_named(tmp_path):
    (tmp_path / "v.toml").write_text('format = 1\nmodel = "none.fmu"\n')
    with pytest.raises(ConfigError, match=r"no file none\.fmu"):
        read_own(tmp_path / "v.toml")
    (tmp_path / "none.fmu").write_bytes(b"PK no archive")
    with pytest.raises(InputError, match="the FMU cannot be used"):
        read_own(tmp_path / "v.toml")
