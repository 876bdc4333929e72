"""Record definitions: names that ROS takes, places, and text that reads back."""

import pytest

from glider.hal.recorder.schema import Field, RecordSpec, parse_fields, specs_from_json, specs_to_json

SPEC = RecordSpec(
    "/tick",
    "glider/msg/Tick",
    (Field("t_s", "s", "time since the start"), Field("force_n", "N", "body axes", 3), Field("leg", "1")),
)


def test_places_count_arrays_whole():
    assert SPEC.width == 5
    assert [SPEC.index(name) for name in ("t_s", "force_n", "leg")] == [0, 1, 4]
    with pytest.raises(KeyError, match="depth_m"):
        SPEC.index("depth_m")


def test_the_text_says_units_and_reads_back():
    assert "float64[3] force_n  # [N] body axes" in SPEC.text()
    assert parse_fields(SPEC.text()) == SPEC.fields
    assert specs_from_json(specs_to_json([SPEC])) == [SPEC]


@pytest.mark.parametrize(
    "text", ["", "float32 a\n", "float64 a\nstring b\n", "float64[] a\n", "geometry_msgs/Pose p\n"]
)
def test_other_definitions_are_not_ours_to_decode(text):
    assert parse_fields(text) is None


@pytest.mark.parametrize("name", ["", "T", "a b", "a__b", "_a", "a_", "1a", "ä"])
def test_names_that_ros_refuses_are_refused(name):
    with pytest.raises(ValueError, match="field"):
        Field(name, "m")


@pytest.mark.parametrize(
    ("topic", "name", "fields"),
    [
        ("tick", "glider/msg/Tick", SPEC.fields),
        ("/events", "glider/msg/Tick", SPEC.fields),
        ("/tick", "Tick", SPEC.fields),
        ("/tick", "glider/msg/Tick", ()),
        ("/tick", "glider/msg/Tick", (Field("a", "m"), Field("a", "m"))),
    ],
)
def test_specs_that_make_no_sense_are_refused(topic, name, fields):
    with pytest.raises(ValueError, match=r"topic|schema name|fields"):
        RecordSpec(topic, name, fields)
