"""Kinds of vehicles: one door, and nobody behind it who knows them by name."""

import ast
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

import glider
from glider.hal.strict import ConfigError
from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.data import vehicle_kinds
from glider.tools.data.runs.case import load_case, write_case
from glider.tools.data.runs.run import Run
from glider.tools.data.sources import load_any_vehicle, load_vehicle
from glider.tools.inference.model import nominal_model

ROOT = Path(glider.__file__).resolve().parent
FACTS = dict(site="made", log_rate_hz=10.0, water_density_kg_m3=998.0)
VEHICLE_CLASSES = {"Vehicle", "OceanVehicle"}
# what refuses a vehicle that is not ROUGHIE's, by its class; a kind that is known by name is known nowhere else
REFUSALS = {"tools/data/sources.py", "tools/inference/numbers_out.py"}


def test_both_kinds_are_entry_points_and_whole():
    assert {one.name for one in metadata.entry_points(group=vehicle_kinds.GROUP)} >= {"roughie", "ocean"}
    asked = {name for name in vars(vehicle_kinds.VehicleKind) if not name.startswith("_")}
    asked |= set(vehicle_kinds.VehicleKind.__annotations__)
    for name, kind in vehicle_kinds.kinds().items():
        assert kind.name == name
        assert {one for one in asked if not hasattr(kind, one)} == set()


def test_no_module_asks_by_class_which_kind_a_vehicle_is():
    found = set()
    for path in sorted(ROOT.glob("tools/**/*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "isinstance":
                named = {getattr(one, "id", "") for one in ast.walk(node.args[1])}
                if named & VEHICLE_CLASSES:
                    found.add(path.relative_to(ROOT).as_posix())
    assert found == REFUSALS


COUSIN = """
from typing import ClassVar

from glider.firmware.model.vehicle import Vehicle
from glider.tools.kinds.roughie import Roughie


class CousinVehicle(Vehicle):
    kind: ClassVar[str] = "cousin"


class Cousin(Roughie):
    name, group, noun, vehicle = "cousin", "theirs", "a cousin of ROUGHIE's", CousinVehicle

    def shipped(self):
        return {"cousin": 'kind = "cousin"\\n' + super().shipped()["roughie"]}

    def decode(self, text, source):
        found = super().decode(text.replace('kind = "cousin"\\n', ""), source)
        return CousinVehicle(**{name: getattr(found, name) for name in found.__struct_fields__})


KIND = Cousin()
"""


@pytest.fixture
def cousin(tmp_path, monkeypatch):
    """A kind that a distribution of somebody's brings, installed: ROUGHIE's equations, and a file that says so."""
    (tmp_path / "site" / "cousin-1.0.dist-info").mkdir(parents=True)
    (tmp_path / "site" / "cousin_kind.py").write_text(COUSIN)
    for name, text in (
        ("METADATA", "Metadata-Version: 2.1\nName: cousin\nVersion: 1.0\n"),
        ("entry_points.txt", f"[{vehicle_kinds.GROUP}]\ncousin = cousin_kind:KIND\n"),
    ):
        (tmp_path / "site" / "cousin-1.0.dist-info" / name).write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    vehicle_kinds.kinds.cache_clear()
    yield vehicle_kinds.kinds()["cousin"]
    vehicle_kinds.kinds.cache_clear()


def test_a_third_kind_touches_no_file_of_the_tree(cousin, tmp_path, monkeypatch, capsys):
    t = 0.1 * np.arange(300)
    columns = {"t_s": t, "depth_m": 1.0 + 0.1 * t, "roll_rad": 0.0 * t, "pitch_rad": -0.3 + 0.0 * t, "yaw_rad": 0.0 * t}
    write_case(tmp_path / "case", [Run("run00", None, columns)], vehicle="cousin", **FACTS)
    case = load_case(tmp_path / "case")
    assert vehicle_kinds.kind_of(case.vehicle) is cousin
    assert nominal_model(case).P.shape == nominal_model(load_case(tmp_path / "case", "roughie")).P.shape
    assert glider.vehicles().kinds["cousin"] == "theirs"
    asked = ["gap", "velocity", str(tmp_path / "case"), "--out", str(tmp_path / "out")]
    monkeypatch.setattr("sys.argv", ["glider", *asked])
    assert report_errors(cli) == 2
    assert "cousin is a cousin of ROUGHIE's: this command takes an ocean glider" in capsys.readouterr().err


def test_a_file_of_a_kind_that_is_not_installed_is_refused(tmp_path):
    path = tmp_path / "other.toml"
    path.write_text('format = 1\nkind = "submarine"\n')
    with pytest.raises(ConfigError, match=r"other.toml.*kind.*'submarine'.*ocean, roughie"):
        load_any_vehicle(str(path))
    with pytest.raises(ConfigError, match="an ocean glider: this command flies or asks a ROUGHIE-like vehicle"):
        load_vehicle("slocum")
