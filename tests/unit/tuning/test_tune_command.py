"""`glider tune`: what it prints can be pasted, its JSON has its shape, and bad input is one line."""

import json
import tomllib

import pytest
from click.testing import CliRunner

from glider.firmware.guidance.mission import decode_mission
from glider.firmware.model.gains import Control
from glider.tools.cli.tune import tune
from glider.tools.data.errors import InputError

MISSION = 'format = 1\nname = "m"\ntime_limit_s = 60.0\n[site]\nname = "pool"\ndepth_m = 6.0\n[[leg]]\ndepth_m = 5.0\n'


def run(*arguments):
    return CliRunner().invoke(tune, arguments, catch_exceptions=False)


@pytest.fixture(scope="module")
def ruled():
    return json.loads(run("--json").stdout)


def test_json_has_gains_margins_and_a_table_to_paste(ruled):
    assert set(ruled) == {"method", "vehicle", "gains", "margins", "toml"}
    assert set(ruled["gains"]["pitch"]) == {"kp", "ki", "kd"}
    assert set(ruled["gains"]["depth"]) == {"kp", "ki", "kd", "rate_bandwidth"}
    for loop in ("pitch", "depth"):
        rows = [row for row in ruled["margins"] if row["loop"] == loop]
        assert [row["trim"] for row in rows if row["design"]] == ["dive -20 deg", "climb +20 deg"]
        assert {"rest", "dive -45 deg", "climb +45 deg"} < {row["trim"] for row in rows}
        for row in rows:
            assert row["crossover_rad_s"] > 0.0
            assert row["delay_margin_s"] > 0.0
            assert row["gain_margin"] > 1.0
            assert 0.0 <= row["gain_margin_down"] < 1.0
            assert 0.0 < row["phase_margin_deg"] < 180.0


def test_the_table_goes_into_a_mission_as_it_is(ruled):
    mission = decode_mission(f"{MISSION}pitch_deg = -20.0\ntime_limit_s = 30.0\n{ruled['toml']}", "m.toml")
    assert mission.control == Control()
    printed = run().stdout
    assert printed.endswith(ruled["toml"] + "\n")
    assert tomllib.loads(ruled["toml"])["control"]["pitch"]["kp"] == ruled["gains"]["pitch"]["kp"]


def test_another_vehicle_is_tuned_for_itself(tmp_path, ruled):
    from glider.tools.data.sources import name_or_path

    text, _ = name_or_path("roughie", "vehicle", "model/vehicles")
    file = tmp_path / "heavy.toml"
    file.write_text(text.replace("m_s = 2.0", "m_s = 3.0").replace('name = "roughie"', 'name = "heavy"'))
    result = json.loads(run("--vehicle", str(file), "--json").stdout)
    assert result["vehicle"] == "heavy"
    assert result["gains"]["pitch"]["kd"] < ruled["gains"]["pitch"]["kd"]
    with pytest.raises(InputError, match="no vehicle 'nope'"):
        run("--vehicle", "nope")


def test_search_prints_both_sets_side_by_side(monkeypatch):
    from glider.tools.study.tuning import search

    monkeypatch.setattr(search, "SEARCHED", search.TuningFlights(range(1), (0.03,)))
    monkeypatch.setattr(search, "REPORTED", search.TuningFlights(range(7, 8), (0.003, 0.1)))
    result = json.loads(run("--method", "search", "--seed", "2", "--budget", "6", "--json").stdout)
    assert result["method"] == "search"
    assert result["seed"] == 2
    for loop in ("pitch", "depth"):
        found = result["search"][loop]
        assert found["cost"] <= found["cost_of_rule"]
        rows = [row for row in result["tracking"] if row["loop"] == loop]
        assert [(row["gains"], row["noise"]) for row in rows] == [
            (name, strength) for name in ("rule", "search") for strength in (0.003, 0.1)
        ]
        assert all(row["tracking_error_pct"] > 0.0 for row in rows)
    assert tomllib.loads(result["toml"])["control"]["depth"]["kd"] == result["gains"]["depth"]["kd"]
