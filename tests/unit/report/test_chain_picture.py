"""The chain's picture: the likely box lit, its element named, nothing lit where there is no gap."""

import re
from xml.etree import ElementTree

import pytest

from glider.sim_backend.core.effects.catalogue import catalogue
from glider.tools.diagnose.chain import MIN_EVIDENCE_NAT, ordered, shared_out
from glider.tools.diagnose.noise_probes import NoiseProbe, ProbeResult
from glider.tools.diagnose.record import LinkRecord, Place
from glider.tools.diagnose.stages import STAGES, stage_of
from glider.tools.report.chain_picture import chain_svg

BALLAST = Place("actuation", "ballast", 0.9)
SURGE = Place("hydrodynamics", "surge", 0.08)


def inflations(text: str) -> dict[str, float]:
    return dict(zip(STAGES, map(float, re.findall(r'fill-opacity="([\d.]+)"', text)), strict=True))


def test_every_place_of_the_catalogue_has_its_stage():
    assert {stage_of(e.subsystem, e.element) for e in catalogue().values()} == set(STAGES)


def test_the_likely_box_is_lit_and_named():
    text = chain_svg([BALLAST, SURGE], [], doubt=False)
    ElementTree.fromstring(text)
    assert inflations(text) == {"command": 0.0, "actuator": 0.9, "force and moment": 0.08, "motion": 0.0, "sensor": 0.0}
    assert "ballast</text>" in text
    assert "90 %" in text
    assert "stage doubt" not in text


def test_a_further_effect_is_lit_too():
    text = chain_svg([BALLAST], [("sensing", "attitude")], doubt=False)
    assert inflations(text)["sensor"] == 1.0
    assert "attitude too" in text


def test_without_a_gap_nothing_is_lit():
    text = chain_svg([], [], doubt=False)
    ElementTree.fromstring(text)
    assert set(inflations(text).values()) == {0.0}
    assert "nothing" in text


def test_doubt_is_dashed_only_where_it_may_lie():
    assert chain_svg([BALLAST, SURGE], [], doubt=True).count("stage doubt") == 2


def probed(name: str, stage: str, gain: float) -> ProbeResult:
    return ProbeResult(NoiseProbe(name, stage, "actuation", "ballast"), gain, 3.0)


def test_shares_are_of_the_best_explanation_in_the_order_of_the_chain():
    found = shared_out([probed("depth", "sensor", 50.0), probed("ballast", "actuator", 190.0)], 200.0)
    assert found == [LinkRecord("actuator", "ballast", 0.95), LinkRecord("sensor", "depth", 0.25)]
    beyond = shared_out([probed("ballast", "actuator", 400.0), probed("depth", "sensor", 100.0)], 200.0)
    assert [link.share for link in beyond] == pytest.approx([1.0, 0.25])


def test_nothing_to_share_out():
    assert shared_out([probed("depth", "sensor", 0.5 * MIN_EVIDENCE_NAT)], 0.0) == []


def test_a_link_counts_once_with_its_best():
    assert ordered([LinkRecord("sensor", "gyro", 0.2), LinkRecord("command", "delay", 0.1), LinkRecord("sensor",
        "gyro", 0.7)]) == [ LinkRecord("command", "delay", 0.1), LinkRecord("sensor", "gyro", 0.7)
    ]  # fmt: skip
