"""A model by its name: one of another kind of vehicle is refused in one line."""

import numpy as np
import pytest

from glider.hal.strict import ConfigError
from glider.tools.data.runs.case import load_case, write_case
from glider.tools.data.runs.run import Run
from glider.tools.inference.load import load_model

FACTS = {"site": "sea", "log_rate_hz": 1.0, "water_density_kg_m3": 1025.0}


def case_of(folder, vehicle, *columns):
    """A case of three rows."""
    run = Run("x", None, {"t_s": np.arange(3.0), "depth_m": np.ones(3)} | {name: np.ones(3) for name in columns})
    write_case(folder, [run], vehicle=vehicle, **FACTS)
    return load_case(folder)


def test_a_vehicle_of_another_kind_is_no_model_of_a_case(tmp_path):
    ocean = case_of(tmp_path / "ocean", "slocum", "oil_m3")
    pool = case_of(tmp_path / "pool", "roughie")
    assert load_model("seaglider", ocean).name == "seaglider"
    assert load_model("roughie", pool).name == "roughie"
    for wanted, case in (("roughie", ocean), ("slocum", pool)):
        with pytest.raises(ConfigError, match=f"{wanted}: kind: "):
            load_model(wanted, case)
    corrected = tmp_path / "corrected.toml"
    corrected.write_text('format = 1\ncorrected = true\nvehicle = "roughie"\n')
    assert load_model(str(corrected), pool).name == str(corrected)
    with pytest.raises(ConfigError, match="another kind"):
        load_model(str(corrected), ocean)
