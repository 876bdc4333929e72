"""k2 against (29) on loading: what a vehicle asks for, and that the command says so."""

import json
import math

import msgspec
import numpy as np
import pytest

from glider.firmware.core.vehicle import layout
from glider.firmware.model.estimator_settings import parameter_sigma
from glider.firmware.model.gains import Control, Law, LawGains
from glider.firmware.model.k2_margin import K2Margin, glides, k2_asked, k2_margins
from glider.firmware.model.vehicle import UncertaintyTable
from glider.tools.data.sources import load_vehicle
from tests.support.commands import glider
from tests.support.law_flights import output_accelerations, plant_rates
from tests.support.model_states import state

VEHICLE = load_vehicle("roughie")
EPS = (0.1, 0.1)


def with_k2(pitch: float, depth: float) -> Control:
    gains = [LawGains(k1=0.8, k2=k2, k3=0.8, eps=eps) for k2, eps in zip((pitch, depth), EPS, strict=True)]
    return Control(controller="law", law=Law(pitch=gains[0], depth=gains[1]))


def test_the_k2_asked_for_divides_covered_from_not_covered():
    asked = k2_asked(VEHICLE, EPS, 1.0)
    for factor, covered in ((0.99, False), (1.01, True)):
        for axis in k2_margins(VEHICLE, with_k2(*map(float, factor * asked))):
            assert axis.covered is covered


def test_no_corner_of_the_box_pushes_harder_than_what_is_asked():
    """The plant's own accelerations in every glide, parameters off by one sigma each way, times one over |g|.

    And some corner takes up half of it: what is asked for is a need, no fancy.
    """
    P, asked, rng = VEHICLE.vector(), k2_asked(VEHICLE, EPS, 1.0), np.random.default_rng(3)
    sigma = parameter_sigma(P, VEHICLE.uncertainty)
    disturbance = np.array([VEHICLE.disturbance.angular, VEHICLE.disturbance.linear])
    push = np.zeros(2)
    for flow, actuators in glides(P):
        pitch = math.atan2(-flow[0], flow[2])
        x = state((0.0, pitch, 0.0), flow[3:], actuators[:3])

        def acc(vehicle, x=x):
            return output_accelerations(x, plant_rates(vehicle, x, x[layout.X_ACT :])[7:13])

        def grip(i, x=x, acc=acc):
            moved = x.copy()
            moved[layout.X_ACT + 1 + i] += 1e-5
            return abs(acc(P, moved)[i] - acc(P)[i]) / 1e-5

        g = np.array([grip(0), grip(1)])
        effects = np.array([acc(P + sigma * (np.arange(layout.N_P) == n)) - acc(P) for n in range(layout.N_P)])
        corners = [np.sign(effects[:, 0]), np.sign(effects[:, 1]), *rng.choice([-1.0, 1.0], (5, layout.N_P))]
        for corner in corners:
            off = np.abs(acc(P + sigma * corner) - acc(P))
            push = np.maximum(push, (off + disturbance) / (g * np.minimum(g / EPS, 1.0)))
    assert (push <= 1.001 * asked).all()
    assert (push >= 0.5 * asked).all()


def test_more_uncertainty_asks_for_more_and_none_for_the_disturbance_alone():
    none = UncertaintyTable(K=0.0, mass=0.0, added=0.0, net_mass=0.0, cg=0.0)
    sure = msgspec.structs.replace(VEHICLE, uncertainty=none)
    assert (k2_asked(sure, EPS, 1.0) < k2_asked(VEHICLE, EPS, 1.0)).all()
    assert (k2_asked(VEHICLE, EPS, 1.0) < k2_asked(VEHICLE, EPS, 3.0)).all()
    least_grip = 6.0  # rad/s2 a metre: the slider's, at 45 deg
    assert 0.0 < k2_asked(sure, EPS, 1.0)[0] < VEHICLE.disturbance.angular / least_grip * 1.5


def test_a_vehicle_that_no_k2_covers_is_said_to_be_one():
    vague = msgspec.structs.replace(VEHICLE, uncertainty=msgspec.structs.replace(VEHICLE.uncertainty, added=3.0))
    for axis in k2_margins(vague, Control()):
        assert axis.asked == math.inf
        assert not axis.covered


def test_it_says_what_is_asked_what_is_set_and_what_is_left():
    said = str(K2Margin("pitch", "m", 0.004, 0.003, 0.01))
    assert said == "k2 of pitch 0.004 m, (29) asks 0.003 m (0.01 at 3 sigma): covered, margin +0.001 m"
    assert "NOT covered, margin -0.001 m" in str(K2Margin("pitch", "m", 0.002, 0.003, 0.01))


def test_the_shipped_gains_cover_the_shipped_vehicle():
    assert all(axis.covered for axis in k2_margins(VEHICLE, Control()))


MISSION = """
format = 1
name = "short"
time_limit_s = 60.0
[site]
name = "pool"
depth_m = 6.0
[[leg]]
pitch_deg = -5.0
duration_s = 1.0
ballast_kg = -0.2
[control]
controller = "law"
law.pitch = { k1 = 0.8, k2 = 0.0001, k3 = 0.8, eps = 0.1 }
"""


@pytest.mark.parametrize(("command", "code"), [("check", 0), ("fly", None)])
def test_a_k2_that_does_not_cover_is_a_warning_and_no_error(command, code, tmp_path):
    (tmp_path / "short.toml").write_text(MISSION)
    options = ["--json"] if command == "check" else ["--no-log"]
    done = glider(command, "--mission", "short.toml", *options, cwd=tmp_path)
    if command == "fly":
        assert "warning: k2 of pitch 0.0001 m, (29) asks" in done.stderr
        assert "k2 of depth" not in done.stderr
        return
    assert done.returncode == code, done.stderr
    pitch, depth = (f for f in json.loads(done.stdout)["findings"] if f["check"] == "law")
    assert (pitch["pass"], pitch["warning"], depth["warning"]) == (True, True, False)
    assert pitch["k2"] == 0.0001
    assert pitch["asked"] > pitch["k2"]
