"""Results of the API: the command's sentences, tables, pictures, and nothing that can be changed or is printed."""

import dataclasses
import json

import numpy as np
import pytest
from click.testing import CliRunner

import glider
from glider.tools.cli.effects import effects as effects_command
from glider.tools.cli.gap import gap as gap_command

pytestmark = pytest.mark.computes(seconds=20)


@pytest.fixture(scope="module")
def case() -> glider.Case:
    return glider.simulate(["spiral", "spiral"], effects={"drag": {"scale": 0.4}}, seed=1)


@pytest.fixture(scope="module")
def gap(case) -> glider.Gap:
    return glider.measure_gap(case)


@pytest.fixture(scope="module")
def every(case, gap) -> dict[str, glider.Case | glider.Gap]:
    return {
        "case": case, "run": case[0], "gap": gap, "readings": glider.readings(case), "effects": glider.effects(),
        "vehicles": glider.vehicles(),
    }  # fmt: skip


def test_a_simulated_case_is_the_flights_of_the_command(case, tmp_path):
    """The same mission, effect and seed by `glider fly` and `glider log export`: the same numbers."""
    from tests.support.commands import glider as command

    flown = command("fly", "--mission", "spiral", "--seed", "2", "--effect", "drag:scale=0.4", "--log", "f.mcap",
                    cwd=tmp_path)  # fmt: skip
    assert flown.returncode == 0, flown.stderr
    exported = command("log", "export", "f.mcap", "--out", "case", cwd=tmp_path)
    assert exported.returncode == 0, exported.stderr
    run = glider.load_case(tmp_path / "case")[0]
    assert run.columns.keys() == case[1].columns.keys()
    assert all(np.array_equal(run[name], case[1][name], equal_nan=True) for name in run.columns)
    log = glider.read_log(tmp_path / "f.mcap")
    assert log.complete
    assert np.array_equal(log.run.t, run.t)
    assert "complete" in log.summary()
    assert log.to_case()[0].columns.keys() == run.columns.keys()


def test_a_case_is_saved_and_read_back(case, tmp_path):
    case.save(tmp_path / "case")
    back = glider.load_case(tmp_path / "case")
    assert back.summary() == case.summary()
    assert back.vehicle == "roughie"
    for one, other in zip(back, case, strict=True):
        assert one.flight == other.flight
        assert all(np.array_equal(one[name], other[name], equal_nan=True) for name in one.columns)
    with pytest.raises(glider.InputError, match="a case"):
        case.save(tmp_path / "case")


def test_a_vehicle_s_own_file_goes_with_its_case(case, tmp_path):
    from glider.firmware.model.library import shipped

    (tmp_path / "mine.toml").write_text(shipped("model/vehicles")["roughie"].replace("K_D0 = 3.0", "K_D0 = 4.0"))
    case.save(tmp_path / "case")
    mine = glider.load_case(tmp_path / "case", vehicle=str(tmp_path / "mine.toml"))
    mine.save(tmp_path / "mine")
    assert "K_D0 = 4.0" in (tmp_path / "mine" / "vehicle.toml").read_text()


def test_the_summary_is_what_the_command_prints(case, gap, tmp_path):
    case.save(tmp_path / "case")
    arguments = ["measure", str(tmp_path / "case"), "--report", str(tmp_path / "gap.html")]
    done = CliRunner().invoke(gap_command, arguments)
    assert done.stdout == gap.summary() + "\n"
    as_json = CliRunner().invoke(gap_command, [*arguments, "--json"])
    assert json.loads(as_json.stdout)["total"] == pytest.approx(gap.total)
    readings = CliRunner().invoke(gap_command, ["readings", str(tmp_path / "case")])
    assert readings.stdout == glider.readings(case).summary() + "\n"
    assert CliRunner().invoke(effects_command, ["drag"]).stdout == glider.effects("drag").summary() + "\n"


def test_nothing_can_be_changed(every):
    for name, one in every.items():
        field = dataclasses.fields(one)[0].name
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(one, field, None)
        if hasattr(one, "answer") and not isinstance(one.answer, tuple):
            with pytest.raises(TypeError):
                one.answer["total"] = 0.0
        assert name in every
    run = every["run"]
    for values in (run.t, run["depth_m"], run.columns["depth_m"]):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 1.0
    with pytest.raises(TypeError):
        run.columns["depth_m"] = run.t


def test_tables_pages_and_pictures(every):
    from matplotlib.figure import Figure

    for one in every.values():
        frame, dataset = one.to_pandas(), one.to_xarray()
        assert len(frame) >= 0
        assert dataset.sizes
        assert "<table>" in one._repr_html_()
        axes = Figure().subplots()
        assert one.plot(axes) is axes
        assert one.plot().figure is not axes.figure
    import matplotlib.pyplot as plt

    assert plt.get_fignums() == []


def test_a_case_s_frame_has_every_row(case):
    frame, dataset = case.to_pandas(), case.to_xarray()
    rows = sum(len(run.t) for run in case)
    assert len(frame) == rows == dataset.sizes["row"]
    assert frame.index.names == ["run", "t_s"]
    assert np.array_equal(frame.loc["run01"]["depth_m"], case[1]["depth_m"], equal_nan=True)
    assert dataset["depth_m"].attrs == {"units": "m"}
    assert case[0].to_xarray()["pitch_rad"].attrs == {"units": "rad"}


def test_measured_and_predicted_are_of_one_shape(gap):
    measured, predicted = gap.measured(0), gap.predicted(0)
    assert measured.keys() == predicted.keys()
    assert all(measured[name].shape == predicted[name].shape for name in measured)
    known = np.isfinite(measured["pitch_rad"])
    assert np.corrcoef(measured["pitch_rad"][known], predicted["pitch_rad"][known])[0, 1] > 0.9
    both = gap.to_xarray()
    assert both["measured"].shape == both["predicted"].shape


@pytest.mark.parametrize(("call", "said"), [
    (lambda: glider.simulate("nowhere"), "no mission 'nowhere'"),
    (lambda: glider.simulate([]), "missions: "),
    (lambda: glider.simulate("spiral", seed=-1), "seed: "),
    (lambda: glider.simulate("spiral", effects={"nothing": None}), "effects: "),
    (lambda: glider.simulate("spiral", effects={"drag": {"scale": 100.0}}), "outside"),
    (lambda: glider.simulate("spiral", effects=["drag:scale"]), "scale"),
    (lambda: glider.simulate("spiral", vehicle="slocum"), "ocean"),
    (lambda: glider.effects("nothing"), "no effect 'nothing'"),
    (lambda: glider.read_log("none.mcap"), "none.mcap: "),
    (lambda: glider.load_case("none"), "none: "),
])  # fmt: skip
def test_a_mistake_is_one_line(call, said, capfd):
    with pytest.raises(glider.InputError, match=said) as error:
        call()
    assert "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")


def test_slices_and_names_of_runs(case):
    assert [run.name for run in case[1:]] == ["run01"]
    assert case["run01"].name == "run01"
    with pytest.raises(KeyError):
        case["run07"]
    with pytest.raises(glider.InputError, match="5:7"):
        case[5:7]


def test_progress_is_a_callback_and_nothing_else_is_said(capfd):
    heard: list[str] = []
    glider.simulate("spiral", seed=5, progress=heard.append)
    assert ["spiral" in one for one in heard] == [True]
    assert capfd.readouterr() == ("", "")


def test_a_missing_package_is_said_with_its_extra(case, monkeypatch):
    monkeypatch.setattr("glider.tools.data.errors.find_spec", lambda name: None)
    for call in (case.to_pandas, case.to_xarray, case.plot):
        with pytest.raises(glider.MissingExtra, match=r"pip install 'underwater-glider\[notebook\]'"):
            call()
