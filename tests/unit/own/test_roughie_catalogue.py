"""ROUGHIE with the catalogue's effects as a user's model: it flies as the tree's own, and its labels are known."""

import numpy as np
import pytest

from glider.sim_backend.core.effects.catalogue import catalogue
from glider.sim_backend.models import roughie
from glider.tools.own.declare import declaration
from glider.tools.own.effects import labels_of
from tests.support import roughie_catalogue as model


def test_without_effects_it_flies_as_the_vehicle_does():
    random = np.random.default_rng(3)
    x = np.concatenate([[1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0], 0.1 * random.standard_normal(6), [0.2, 0.01, 0.05]])
    u, w = np.array([0.3, 0.02, -0.05]), 0.01 * random.standard_normal(6)
    known = [one[2] for one in roughie.parameters]
    theta = np.array([one.get("value", 0.0) for one in model.parameters])
    assert model.derivative(np.append(x, 5.0), u, w, theta)[:-1] == pytest.approx(roughie.derivative(x, u, w, known))
    assert model.measure(np.append(x, 5.0), u, theta)[:9] == pytest.approx(roughie.measure(x, u, known))


def test_every_label_is_one_of_the_catalogue_s():
    declared = declaration(model)
    labels = [one for one in (*labels_of(declared), *(one.name for one in declared.parameters))
              if not one.endswith("_drift") and not one.startswith(("slider_wire", "ballast_wire"))]  # fmt: skip
    causes = [{"label": one, "probability": 1.0, "parameters": {one: {"estimate": -1.0}}} for one in labels]
    unknown = set(model.catalogue_chances(causes)) - set(catalogue())
    assert unknown <= {f"mocap_{axis}_{kind}" for axis in "xyz" for kind in ("bias", "gain")} | {
        f"{name}_{kind}" for name in ("slider", "ballast") for kind in ("limit", "backlash")
    } | {"inputs_lag", "inputs_delay"}
