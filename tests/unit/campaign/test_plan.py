"""Campaign files and options: what is refused, and what a fingerprint notices."""

import pickle
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from glider.firmware.model.gains import Control
from glider.hal.strict import ConfigError
from glider.tools.data.errors import InputError
from glider.tools.study.campaign.fingerprint import fingerprint
from glider.tools.study.campaign.plan import build_plan, load_campaign, shipped_campaigns, with_options

TEXT = 'format = 1\nname = "one"\nmissions = ["spiral"]\ncontrollers = ["pid"]\nseeds = 3\n'


@pytest.fixture
def campaign_file(tmp_path):
    def write(more: str, text: str = TEXT) -> Path:
        path = tmp_path / "one.toml"
        path.write_text(text + more)
        return path

    return write


@pytest.mark.parametrize("name", shipped_campaigns())
def test_shipped_campaigns_can_be_flown(name):
    campaign, base = load_campaign(name)
    assert campaign.name == name
    assert build_plan(campaign, base).flights > 0


def test_robustness_is_what_it_says():
    plan = build_plan(*load_campaign("robustness"))
    assert set(plan.campaign.controllers) == {"law", "hybrid", "pid"}
    assert plan.flights >= 3000
    assert plan.campaign.spread.parameters == 3.0
    assert plan.campaign.environment.current_m_s == plan.campaign.environment.wave_height_m == 0.2


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("speed = 3\n", "unknown key"),
        ("[spread]\nparameters = -1.0\n", "one.toml:7: spread.parameters"),
        ("[environment]\ncurrent_m_s = nan\n", "finite number"),
        ("[environment]\nwave_period_s = [8.0, 3.0]\n", "expected \\[low, high\\]"),
        ("[environment]\nwave_period_s = [0.0, 3.0]\n", "expected \\[low, high\\]"),
        ("[environment]\ndisturbance = [0.1, 9.0]\n", "expected \\[low, high\\]"),
        ("[start]\ndepth_m = [1.0]\n", "start.depth_m"),
    ],
)
def test_files_are_read_strictly(campaign_file, more, said):
    with pytest.raises(ConfigError, match=said) as caught:
        load_campaign(str(campaign_file(more)))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"missions": ["nope"]}, "no mission 'nope'"),
        ({"missions": ["spiral", "spiral"]}, "stands there twice"),
        ({"controllers": ["autopilot"]}, "autopilot"),
        ({"controllers": ["pid", "pid"]}, "stands there twice"),
        ({"vehicle": "nope"}, "no vehicle 'nope'"),
        ({"board": "nope"}, "no board 'nope'"),
        ({"seeds": 0}, "seeds"),
        ({"environment.current_m_s": float("nan")}, "finite number"),
        ({"environment.wave_height_m": -0.1}, "wave_height_m"),
        ({"start.depth_m": (2.0, 1.0)}, "depth_m"),
        ({"environment.disturbance": (0.0, float("inf"))}, "finite number"),
    ],
)
def test_options_are_checked_as_files_are(options, said):
    with pytest.raises((InputError, ConfigError), match=said) as caught:
        build_plan(with_options(load_campaign("robustness")[0], options))
    assert "\n" not in str(caught.value)


def test_a_campaign_nobody_has():
    with pytest.raises(InputError, match=r"'nope': .*robustness"):
        load_campaign("nope")


def test_files_that_a_campaign_names_stand_beside_it(campaign_file, tmp_path):
    from glider.firmware.model.library import shipped

    path = campaign_file("", TEXT.replace('"spiral"', '"mine.toml"'))
    (tmp_path / "mine.toml").write_text(shipped("guidance/missions")["spiral"].replace('"spiral"', '"mine"'))
    assert build_plan(*load_campaign(str(path))).missions[0].name == "mine"


def test_the_law_needs_the_filter(plan_of):
    plan = plan_of()
    measured = msgspec.structs.replace(plan.missions[0], control=Control(estimator="measured"))
    with pytest.raises(InputError, match="body velocities"):
        replace(plan, missions=(measured,)).pilot(0, "law")


def test_a_fingerprint_notices_what_changes_a_flight(plan_of, monkeypatch):
    plan = plan_of()
    found = fingerprint(plan)
    assert fingerprint(pickle.loads(pickle.dumps(plan))) == found
    assert fingerprint(plan_of(seeds=3)) != found
    assert fingerprint(plan_of(**{"spread.parameters": 3.1})) != found
    control = Control()
    other = msgspec.structs.replace(control, pitch=msgspec.structs.replace(control.pitch, kp=0.21))
    assert fingerprint(replace(plan, vehicle=msgspec.structs.replace(plan.vehicle, control=other))) != found
    monkeypatch.setattr("glider.tools.study.campaign.fingerprint.kernels_digest", lambda: "other kernels")
    assert fingerprint(plan) != found
