"""A vehicle file that is not right is refused by name and line, and nothing it holds raises anything else."""

import re
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from glider.firmware.model.vehicle import Vehicle, decode_vehicle
from glider.hal.strict import ConfigError
from tests.support.examples import examples
from tests.support.model_states import VEHICLE_TEXT

LINES = VEHICLE_TEXT.splitlines()
WRONG = {
    "text": '"13"',
    "nothing": '""',
    "truth": "true",
    "date": "1979-05-27",
    "not a number": "nan",
    "infinite": "-inf",
    "empty list": "[]",
    "list": '["a", 1.0, nan]',
    "table": "{ a = 1 }",
    "beyond floats": "1" + "0" * 400,
    "beyond anything": "-1e300",
}


def keys() -> list[tuple[int, str, str]]:
    """Index of the line, header and name of every `name = value` of the shipped vehicle."""
    found, header = [], ""
    for index, line in enumerate(LINES):
        if match := re.match(r"\[([\w.]+)\]", line):
            header = match[1]
        elif match := re.match(r"(\w+) = ", line):
            found.append((index, header, match[1]))
    return found


def inline_keys() -> list[tuple[int, str, str, str]]:
    """The same, with name of the inline table, for the keys of sensors."""
    return [
        (index, header, name, inner)
        for index, header, name in keys()
        for inner in re.findall(r"(\w+) = [\d.]+", LINES[index].partition("{")[2])
    ]


def refusal(lines: list[str]) -> ConfigError:
    with pytest.raises(ConfigError) as caught:
        decode_vehicle("\n".join(lines) + "\n", "vehicle.toml")
    error = caught.value
    assert "\n" not in str(error)
    assert str(error).startswith("vehicle.toml")
    return error


def refused(text: str) -> str | None:
    """What is wrong with a text; None for a vehicle. Anything but a ConfigError goes through."""
    try:
        assert isinstance(decode_vehicle(text, "vehicle.toml"), Vehicle)
    except ConfigError as error:
        return str(error)
    return None


def dotted(header: str, name: str) -> str:
    return f"{header}.{name}" if header else name


def test_shipped_file_has_the_keys_this_test_changes():
    assert len(keys()) > 45
    assert decode_vehicle(VEHICLE_TEXT, "vehicle.toml").name == "roughie"
    in_file = tomllib.loads(VEHICLE_TEXT)
    assert {header.split(".")[0] or name for _, header, name in keys()} == set(in_file)


@pytest.mark.parametrize(("index", "header", "name"), [key for key in keys() if key[1] != "limits"])
def test_a_missing_key_is_named(index, header, name):
    error = refusal(LINES[:index] + LINES[index + 1 :])
    assert error.key == dotted(header, name)
    assert "missing key" in str(error)
    if header:
        assert LINES[error.line - 1].startswith(f"[{header}]")


@pytest.mark.parametrize("value", WRONG.values(), ids=WRONG.keys())
@pytest.mark.parametrize(("index", "header", "name"), keys())
def test_a_wrong_value_is_named_with_its_line(index, header, name, value):
    if name == "name" and value == '"13"':
        return  # a vehicle may be called 13
    error = refusal([*LINES[:index], f"{name} = {value}", *LINES[index + 1 :]])
    assert error.key.startswith(dotted(header, name))
    assert error.line == index + 1


@pytest.mark.parametrize("value", ['"x"', "true", "nan", "-1.0", "[1.0]"])
@pytest.mark.parametrize(("index", "header", "name", "inner"), inline_keys())
def test_a_wrong_value_in_an_inline_table_is_named(index, header, name, inner, value):
    line = re.sub(rf"\b{inner} = [\d.]+", f"{inner} = {value}", LINES[index])
    error = refusal([*LINES[:index], line, *LINES[index + 1 :]])
    assert error.key == f"{header}.{name}.{inner}"
    assert error.line == index + 1


@examples(200)
@given(st.sampled_from(keys()), st.text(min_size=1, max_size=20))
def test_an_unknown_key_is_named_with_its_line(key, name):
    index, header, _ = key
    known = set(tomllib.loads(VEHICLE_TEXT)) if not header else {other for _, at, other in keys() if at == header}
    if name in known | {"control", "lift_law"}:
        return
    quoted = "".join(f"\\U{ord(char):08X}" for char in name if not 0xD800 <= ord(char) <= 0xDFFF)
    error = refusal([*LINES[:index], f'"{quoted}" = 1.0', *LINES[index:]])
    assert "unknown key" in str(error) or "expected" in str(error)
    assert error.line is not None or not header


@pytest.mark.parametrize("name", ["K_d0", "spare", "we`ird", "with space"])
def test_an_ordinary_unknown_key_is_found_on_its_line(name):
    index = next(index for index, _, other in keys() if other == "K_D")
    error = refusal([*LINES[:index], f'"{name}" = 1.0', *LINES[index:]])
    assert error.key == f"hydrodynamics.{name}"
    assert error.line == index + 1


@examples(300)
@given(st.data())
def test_damage_raises_nothing_but_config_errors(data):
    """Cut out, doubled or overwritten pieces: either a vehicle or a ConfigError of one line."""
    begin = data.draw(st.integers(0, len(VEHICLE_TEXT)))
    end = data.draw(st.integers(begin, min(begin + 200, len(VEHICLE_TEXT))))
    implausible = st.sampled_from(["", "9" * 5000, "[" * 3000, "{a=" * 50, "\x00"])
    piece = data.draw(st.one_of(st.text(max_size=30), implausible))
    complaint = refused(VEHICLE_TEXT[:begin] + piece + VEHICLE_TEXT[end:])
    assert complaint is None or (complaint.startswith("vehicle.toml") and len(complaint.splitlines()) == 1)


@examples(300)
@given(st.one_of(st.text(), st.text(alphabet="[]{}=\"'#.,\n 0123456789abcxeE_-+:T")))
def test_any_text_raises_nothing_but_config_errors(text):
    with pytest.raises(ConfigError) as caught:
        decode_vehicle(text, "vehicle.toml")
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("digits", [400, 5000])
def test_absurd_integers(digits):
    index = next(index for index, _, name in keys() if name == "m_t")
    error = refusal([*LINES[:index], f"m_t = 1{'0' * digits}", *LINES[index + 1 :]])
    assert error.line == index + 1


def test_masses_that_cannot_be():
    index = next(index for index, _, name in keys() if name == "m_r")
    error = refusal([*LINES[:index], "m_r = 12.0", *LINES[index + 1 :]])
    assert error.key == "mass"
    assert "m_r + m_s = 14.0 kg" in str(error)
