"""`gap diagnose` of ocean gliders: one effect, two, rougher water, and one that no label names."""

import json
from dataclasses import replace

import numpy as np
import pytest

from glider.sim_backend.foreign import ocean as foreign
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import load_case
from glider.tools.identify.ocean.files import vehicle_text
from glider.tools.identify.ocean.identify import identify_ocean
from glider.tools.report.pooled import write_pooled_report
from glider.tools.verify.challenge.ocean_cases import as_run, flown, with_change
from glider.tools.watch.whole_case import diagnose_ocean, plain, write
from tests.support.ocean import as_case, drawn, fly_dives

pytestmark = pytest.mark.computes(seconds=25)

DIVES = 6
WRONG = np.radians(4.0)


@pytest.fixture(scope="module")
def identified(tmp_path_factory):
    """The vehicle's file, identified from other dives of its mission."""
    folder = tmp_path_factory.mktemp("before")
    (folder / "identified.toml").write_text(vehicle_text(identify_ocean(as_case(folder / "case", fly_dives(8).runs))))
    return str(folder / "identified.toml")


def flown_by(V, noise_beats_label=1.0):
    """The first dives of the mission by another vehicle, in water that moves so many times as much."""
    mission, runs = drawn("slocum", 1), []
    for n in range(DIVES):
        S = mission.seas[n].copy()
        S[foreign.WATER] *= noise_beats_label
        runs.append(as_run(mission, n, flown(mission, n, V, S), False))
    return runs


def said_of(folder, runs, vehicle):
    """The diagnosis of runs with a vehicle file."""
    return diagnose_ocean(load_case(as_case(folder / "case", runs).folder, vehicle))


def test_without_an_effect_it_is_none(tmp_path, identified):
    found = said_of(tmp_path, flown_by(drawn("slocum", 1).V), identified)
    assert (found.verdict, found.selected, found.left) == ("none", [], None)
    assert found.probabilities["none"] > 0.8


def test_two_effects_are_both_named(tmp_path, identified):
    V = with_change(with_change(drawn("slocum", 1).V, "drag", 0.4), "net_buoyancy", 0.12)
    found = said_of(tmp_path, flown_by(V), identified)
    assert found.verdict == "cause"
    assert set(found.selected) in ({"drag", "net_buoyancy"}, {"drag", "density_bias"})
    answer = plain(found)
    assert answer["stages"][-1]["stage"] == " ".join(f"+ {label}" for label in found.selected)
    assert answer["gap"]["after"]["depth"] < 0.5 * answer["gap"]["recalibrated"]["depth"]
    assert sum(one["probability"] for one in answer["causes"]) == pytest.approx(1.0)
    write(found, tmp_path)
    flagged = write_pooled_report(tmp_path)
    assert all(label in flagged for label in found.selected)


def test_what_no_label_names_is_unknown(tmp_path, identified):
    """A pitch that reads too much in the upper half of the water and too little in the lower one."""
    runs = flown_by(drawn("slocum", 1).V)
    for n, run in enumerate(runs):
        depth, pitch = run.columns[names.DEPTH], run.columns[names.ATTITUDE[1]]
        wrong = pitch + WRONG * np.sin(2.0 * np.pi * depth / np.nanmax(depth))
        runs[n] = replace(run, columns=run.columns | {names.ATTITUDE[1]: wrong})
    found = said_of(tmp_path, runs, identified)
    assert (found.verdict, found.selected) == ("unknown", [])
    assert "oil" in plain(found)["next_run"]["text"]
    assert max(found.probabilities, key=lambda label: found.probabilities[label]) == "unknown"
    assert found.left.channel == "depth"
    assert found.left.excess > 0.4
    assert found.where[0]["probability"] > 0.0
    write(found, tmp_path)
    answer = json.loads((tmp_path / "diagnosis.json").read_text())
    assert answer["left"]["channel"] == "depth"
    assert any("no label" in one for one in answer["cautions"])
    assert "no label" in write_pooled_report(tmp_path)


def test_rougher_water_is_no_unknown_effect(tmp_path, identified):
    found = said_of(tmp_path, flown_by(drawn("slocum", 1).V, 3.0), identified)
    assert found.verdict in ("none", "cause")
    assert found.selected in ([], ["vertical_water"])
