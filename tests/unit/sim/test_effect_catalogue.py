"""The catalogue: every label in its place, ranges that are kept, nothing changed at the defaults."""

import numpy as np
import pytest

from glider.firmware.core.vehicle.layout import X_BALLAST, X_SERVO, X_SLIDER
from glider.hal.board import BoardRequest
from glider.hal.strict import ConfigError
from glider.sim_backend.board import build_board
from glider.sim_backend.core.effects import effect_layout as ef
from glider.sim_backend.core.effects.base import EffectError
from glider.sim_backend.core.effects.catalogue import apply_effects, catalogue, check_values
from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.flight.compose import parse_effects
from tests.support.effect_flights import FLOWN, MOCAP, at_spread, flown, world

ROUGH = {"disturbance_linear": 0.01, "disturbance_angular": 0.02}
NOMINAL, READ = flown(world(**ROUGH))
WATER = ("current", "current_shear")
ACTUATOR_OF = {"servo": X_SERVO, "slider": X_SLIDER, "ballast": X_BALLAST}


def arrays(made):
    return (made.P, made.E, made.F, made.waves, made.sensors, made.errors, made.x)


def test_every_entry_of_the_effect_vector_belongs_to_one_parameter():
    """But for the two signs of a mass that changes with depth, which are two labels; biases are no effect."""
    entries = [p.entry for effect in catalogue().values() for p in effect.parameters if p.entry >= 0]
    assert sorted(entries) == sorted([*range(ef.BIAS), ef.MASS_PER_DEPTH])


@pytest.mark.parametrize("label", catalogue())
def test_parameters_have_ranges_around_their_defaults_and_are_refused_outside(label):
    for p in catalogue()[label].parameters:
        assert p.low <= p.default <= p.high
        assert p.low < p.high
        assert p.spread > 0.0
        for bad in (p.low - 0.01 * p.spread, p.high + 0.01 * p.spread, float("nan"), float("inf")):
            with pytest.raises(EffectError, match=f"effect {label}: {p.name} = .* is outside") as caught:
                check_values(label, {p.name: bad})
            assert "\n" not in str(caught.value)
        assert check_values(label, {p.name: p.high})[p.name] == p.high
    with pytest.raises(EffectError, match=f"{label} .*'gremlins'"):
        check_values(label, {"gremlins": 0.0})


@pytest.mark.parametrize("label", MOCAP)
def test_motion_captures_clock_cannot_be_flown(label):
    with pytest.raises(EffectError, match=f"{label} .*clock"):
        apply_effects(world(), {label: at_spread(label)})


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("[effects.gremlins]", "b.toml: effects.gremlins: no effect 'gremlins'"),
        ("[effects.drag]\nscale = -5.0", "effects.drag: effect drag: scale = -5 "),
        ("[effects.clock_skew]\nskew = 0.1", "effects.clock_skew: "),
    ],
)
def test_a_board_file_with_an_effect_that_cannot_be_says_so_in_one_line(table, said):
    request = BoardRequest(text=f'format = 1\nkind = "sim"\n{table}\n', source="b.toml", vehicle=None)
    with pytest.raises(ConfigError) as caught:
        build_board(request)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("label", FLOWN)
def test_a_default_changes_nothing(label):
    made = world({label: {}}, **ROUGH)
    for one, other in zip(arrays(made), arrays(world(**ROUGH)), strict=True):
        assert np.array_equal(one, other)
    states, frames = flown(made, 10.0)
    assert np.array_equal(states, NOMINAL[: len(states)])
    assert np.array_equal(frames, READ[: len(frames)], equal_nan=True)


@pytest.mark.parametrize("label", FLOWN)
def test_at_its_spread_a_label_changes_its_own_part_and_leaves_the_rest(label):
    effect = catalogue()[label]
    states, frames = flown(world({label: at_spread(label)}, **ROUGH))
    off = np.abs(states - NOMINAL).max(axis=0)[:16]
    seen = np.nanmax(np.abs(frames - READ) / (1.0 + np.abs(READ)))
    assert seen < 1e-9 if label in WATER else seen > 1e-5  # by the vehicle itself
    if effect.subsystem == "sensing":
        assert (off < 1e-9).all()  # the vehicle moves as it did
    else:
        assert off[:13].max() > 1e-4
    if label in WATER:
        assert (off[2:] < 1e-9).all()
        assert off[:2].max() > 0.5
    actuators = [X_SERVO, X_SLIDER, X_BALLAST]
    if effect.subsystem == "actuation":
        actuators.remove(ACTUATOR_OF[effect.element])
    if effect.subsystem != "timing":
        assert (off[actuators] < 1e-9).all()


@pytest.mark.parametrize("label", [label for label in FLOWN if catalogue()[label].subsystem == "sensing"])
def test_a_sensing_label_errs_in_its_own_readings_only(label):
    """In the frame: IMU at 0 (attitude 2..4, rates 5..7), beacon at 8 (pressure 10), draw-wires behind it."""
    own = {"attitude": range(2, 5), "gyro": range(5, 8), "depth": (10,)}[catalogue()[label].element]
    _, frames = flown(world({label: at_spread(label)}, **ROUGH))
    off = np.abs(frames - READ)[20:].max(axis=0)
    others = [i for i in range(len(off)) if i not in own]
    assert np.nanmax(off[others]) < 1e-6  # NaN: not fitted
    assert off[list(own)].max() > 1e-3


def test_an_effect_named_alone_has_a_sigma_of_its_prior_and_every_one_of_them_can_be_flown():
    for label, effect in catalogue().items():
        if (effect.subsystem, effect.element) == ("timing", "mocap"):
            continue
        values = parse_effects((label,))[label]
        assert values == effect.usual
        assert all(p.low <= values[p.name] <= p.high and values[p.name] != 0.0 for p in effect.parameters), label
    assert parse_effects(("drag:scale=0.6",)) == {"drag": {"scale": 0.6}}


def test_the_command_lists_effects_with_their_parameters(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["glider", "effects", "drag"])
    assert report_errors(cli) == 0
    said = capsys.readouterr().out
    assert said.startswith("drag  ")
    assert "scale" in said
    assert len(said.splitlines()) == 1 + len(catalogue()["drag"].parameters)
    monkeypatch.setattr("sys.argv", ["glider", "effects", "dragg"])
    assert report_errors(cli) == 2
    assert "no effect 'dragg'" in capsys.readouterr().err
