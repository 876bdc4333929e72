"""corrected.toml: what is written is what is flown; what is wrong in it is named."""

import numpy as np
import pytest

from glider.firmware.core.vehicle import layout
from glider.hal.strict import ConfigError
from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.data.sources import load_vehicle
from glider.tools.inference.corrected import LINKS, corrected_text, load_corrected
from glider.tools.inference.model import Model


@pytest.fixture
def nominal() -> Model:
    P = load_vehicle("roughie").vector()
    return Model("nominal", P, np.zeros(layout.N_P))


def test_a_corrected_model_reads_back_bit_for_bit(nominal, tmp_path):
    rng = np.random.default_rng(6)
    P, F = nominal.P.copy(), np.zeros(ef.N_F)
    P[layout.K_D0] *= 1.01
    P[layout.CG_Y] = 1.7e-5
    F[ef.BIAS : ef.BIAS + 9] = 1e-3 * rng.standard_normal(9)
    F[ef.STALL], F[ef.CURRENT_N], F[ef.CURRENT_E] = 12.3, 0.05, -0.02
    effects = {"stall": {"inverse": 12.3}, "current": {"north": 0.05, "east": -0.02}}
    path = tmp_path / "corrected.toml"
    path.write_text(corrected_text("roughie", nominal.P, P, F, effects))
    model = load_corrected(path, nominal)
    assert np.array_equal(model.P, P)
    assert np.array_equal(model.F, F)


@pytest.mark.parametrize(("text", "key"), [
    ("[parameters]\nk_dd = 1.0\n", "parameters.k_dd"),
    ("[bias]\nrow = 1.0\n", "bias.row"),
    ("[effects.stal]\ninverse = 1.0\n", "effects.stal"),
    ("[effects.stall]\ninverse = -1.0\n", "effects.stall"),
    ("[parameters]\nk_d0 = nan\n", "k_d0"),
    ("surprise = 1\n", "surprise"),
])  # fmt: skip
def test_what_is_wrong_is_named(nominal, tmp_path, text, key):
    path = tmp_path / "corrected.toml"
    path.write_text('format = 1\ncorrected = true\nvehicle = "roughie"\n' + text)
    with pytest.raises(ConfigError) as caught:
        load_corrected(path, nominal)
    assert "corrected.toml" in str(caught.value)
    assert key.rsplit(".", maxsplit=1)[-1] in str(caught.value)


def test_a_correction_reads_back_bit_for_bit(nominal, tmp_path):
    F = np.zeros(ef.N_F)
    F[ef.LINK] = 1.0 + LINKS.index("slider wire")
    F[ef.SHAPE], F[ef.SHAPE + ef.SHAPES.index("angle of attack")] = 1.0 / 3.0, -0.7e-3
    path = tmp_path / "data_driven.toml"
    path.write_text(corrected_text("roughie", nominal.P, nominal.P, F, {}))
    assert np.array_equal(load_corrected(path, nominal).F, F)


@pytest.mark.parametrize(("text", "key"), [
    ('[correction]\nlink = "keel"\nshapes = {}\n', "correction.link"),
    ('[correction]\nlink = "servo"\nshapes = { moon = 1.0 }\n', "correction.shapes.moon"),
])  # fmt: skip
def test_a_correction_that_is_none_is_named(nominal, tmp_path, text, key):
    path = tmp_path / "data_driven.toml"
    path.write_text(f'format = 1\ncorrected = true\nvehicle = "roughie"\n{text}')
    with pytest.raises(ConfigError) as error:
        load_corrected(path, nominal)
    assert error.value.key == key
