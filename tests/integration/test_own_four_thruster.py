"""The four-thruster AUV of docs/examples: its physics, and, where the recordings are, what is identified from them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glider.tools.own.effects import nominal_point
from glider.tools.own.identified import VEHICLE, write
from glider.tools.own.identify import identify
from glider.tools.own.load import read_own
from glider.tools.own.observer import Observer
from glider.tools.own.runs import load_own_runs
from glider.tools.own.watch import watch

pytestmark = pytest.mark.computes(seconds=150)

ROOT = Path(__file__).resolve().parents[2]
HAIZHE = ROOT / "docs" / "examples" / "four_thruster_auv" / "haizhe.toml"
DIVES = ROOT.parent / "shared" / "data" / "haizhe"
DIVE = 8.0  # s


@pytest.fixture(scope="module")
def vehicle():
    return read_own(HAIZHE)


def depth(vehicle, pulse: float, volts: float = 11.8, **changed: float) -> float:
    """Depth at the end of a dive."""
    declared, theta = vehicle.declared, nominal_point(vehicle.declared).theta
    for name, value in changed.items():
        theta[declared.index("parameters", name)] = value
    x, w, u = np.zeros(len(declared.states)), np.zeros(len(declared.noises)), np.array([pulse] * 4 + [volts])
    for _ in range(round(DIVE / 0.05)):
        x = vehicle.kernels.advance(x, u, w, theta, 0.05, 1)
    return float(vehicle.kernels.measure(x, u, theta)[0])


def test_it_is_compiled_and_floats_with_its_motors_off(vehicle):
    assert vehicle.kernels.compiled, vehicle.kernels.why
    assert depth(vehicle, 1100.0) == pytest.approx(0.0, abs=1e-3)


def test_thrust_voltage_and_weight_take_it_down(vehicle):
    usual = depth(vehicle, 1198.0)
    assert 0.2 < usual < 0.8
    assert depth(vehicle, 1202.0) > usual + 0.1
    assert depth(vehicle, 1198.0, volts=11.9) > usual + 0.05
    lighter = vehicle.declared.parameters[vehicle.declared.index("parameters", "net_buoyancy")].value - 0.05
    assert depth(vehicle, 1198.0, net_buoyancy=lighter) > usual + 0.1
    assert depth(vehicle, 1198.0, load=0.05) > usual + 0.1


@pytest.fixture(scope="module")
def identified(vehicle, tmp_path_factory):
    """The vehicle identified from every second dive of a session, and the session's dives."""
    if not DIVES.is_dir():
        pytest.skip("the recordings are not here")
    normal = load_own_runs(DIVES / "normal_a", vehicle.declared)
    folder = tmp_path_factory.mktemp("identified")
    write(identify(vehicle, [normal[::2]]), folder)
    return read_own(folder / VEHICLE), normal


def test_further_dives_of_a_session_are_nothing_new_and_dives_with_a_load_are(identified):
    model, normal = identified
    loaded = load_own_runs(DIVES / "addweight", model.declared)[:3]
    found = watch(model, [*normal[1::2][-5:], *loaded], normal[::2])
    begins = [one.first for one in found.events] + [found.names.index(one["from_run"]) for one in found.sessions]
    assert set(begins) == {5}
    assert not (found.strange[:5] > 0.5).any()


DAMAGED = 5  # the dive of a watch from which on something is wrong, in the reference's own session


def watched(identified, damage):
    """The one event of a watch of further normal dives, `damage` done to those from DAMAGED on."""
    model, normal = identified
    runs = [damage(run) if n >= DAMAGED else run for n, run in enumerate(normal[1::2])]
    found = watch(model, runs, normal[::2])
    (event,) = found.plain()["events"]
    assert found.sessions == []
    assert event["from_run"] == found.names[DAMAGED]
    return event


def test_a_depth_sensor_that_is_off_is_named_though_sessions_differ_in_its_zero(identified):
    place = identified[0].declared.index("outputs", "depth")

    def off(run):
        outputs = run.outputs.copy()
        outputs[:, place] += 0.1
        return replace(run, outputs=outputs)

    event = watched(identified, off)
    assert event["label"] == "depth_bias"
    assert event["size"] == pytest.approx(0.1, abs=0.03)


def test_a_motor_that_gives_less_thrust_is_named(identified):
    """A propeller of which 0.7 is left, by what the model has it do to a real dive."""
    model, _ = identified

    def weaker(run):
        observer = Observer(model, [run])
        by, whole = observer.filter(0, observer.point), observer.horizon
        worn = observer.point.copy()
        worn.driven[3] = {"offset": -32.0}  # us; thrust goes with the square of the speed
        moved = observer.predict(0, worn, whole, by.states) - observer.predict(0, observer.point, whole, by.states)
        seen = np.isfinite(moved).all(axis=1)
        changed = np.array([np.interp(run.t, run.t[seen], column) for column in moved[seen].T]).T
        return replace(run, outputs=run.outputs + changed)

    event = watched(identified, weaker)
    assert all(label.startswith("pwm4_") for label in event["group"])


def test_dives_that_were_left_out_are_predicted_and_a_load_is_seen_against_the_command(vehicle, identified):
    model, normal = identified
    place = model.declared.index("outputs", "depth")

    def errors(runs) -> np.ndarray:
        """Measured less predicted depth in the last second of each dive, m."""
        observer = Observer(model, runs)
        found = []
        for n, run in enumerate(runs):
            flown = observer.predict(n, observer.point, observer.horizon, observer.filter(n, observer.point).states)
            last = (run.t - run.t[0] > DIVE - 1.0) & (run.t - run.t[0] < DIVE - 0.1)
            found.append(float(np.mean(run.outputs[last, place] - flown[last, place])))
        return np.array(found)

    assert model.file.identified is not None
    assert np.sqrt(np.mean(errors(normal[1::2]) ** 2)) < 0.12
    loaded = load_own_runs(DIVES / "addweight", vehicle.declared)[::4]
    assert loaded[0].inputs[10, 0] < normal[0].inputs[10, 0]  # less thrust is asked for
    assert (errors(loaded) > 0.15).all()
