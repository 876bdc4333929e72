"""Mission files: strict, and refused with the key that is wrong."""

import pytest

from glider.firmware.guidance.mission import decode_mission
from glider.firmware.model.library import shipped
from glider.hal.strict import ConfigError
from glider.tools.data.sources import load_vehicle

GOOD = shipped("guidance/missions")["sawtooth"]


@pytest.mark.parametrize(
    ("old", "new", "where", "what"),
    [
        ("depth_m = 4.0", "depth_m = 5.8", "m.toml", "deeper than"),
        ("depth_m = 4.0", "duration_s = 10.0", "m.toml:11: leg[0]", "has its duration_s"),
        ("time_limit_s = 120.0", "", "m.toml:11: leg[0]", "time_limit_s: "),
        ("pitch_deg = -20.0", "pitch_deg = -95.0", "m.toml:13: leg[0].pitch_deg", ">= -75"),
        ("pitch_deg = -20.0", "pitch = -20.0", "m.toml:13: leg[0].pitch", "unknown key"),
        ("depth_m = 6.0", "depth_m = inf", "m.toml:9: site.depth_m", "finite"),
        ("format = 1", "format = 2", "m.toml:2: format", "<= 1"),
        ('name = "sawtooth"', "name = 3", "m.toml:3: name", "`str`"),
        ("[site]", "[sight]", "m.toml:7: sight", "unknown key"),
    ],
)
def test_what_is_wrong_is_named(old, new, where, what):
    text = GOOD.replace(old, new, 1)
    assert text != GOOD
    with pytest.raises(ConfigError) as error:
        decode_mission(text, "m.toml")
    assert str(error.value).startswith(where)
    assert what in str(error.value)


def test_a_mission_that_goes_nowhere_is_refused():
    text = GOOD[: GOOD.index("[[leg]]")] + "[[leg]]\nduration_s = 10.0\npitch_deg = 0.0\n"
    with pytest.raises(ConfigError, match="go nowhere"):
        decode_mission(text, "m.toml")


def test_ballast_outside_the_vehicles_range_is_refused():
    mission = decode_mission(shipped("guidance/missions")["spiral"].replace("0.15", "0.5"), "m.toml")
    with pytest.raises(ConfigError, match=r"leg\[0\].ballast_kg: 0.5 kg .*roughie"):
        mission.matrix(load_vehicle("roughie"), "m.toml")
