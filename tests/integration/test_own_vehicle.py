"""A vehicle of one's own from its skeleton: checked, identified, diagnosed, watched; nothing of the tree touched."""

import csv
import json
import tomllib

import numpy as np
import pytest

from tests.support.commands import glider
from tests.support.own_vehicle import module_of, write_case

pytestmark = pytest.mark.computes(seconds=65)

HEALTHY = {"weight_in_water": 0.8, "heave_drag": 38.0, "turn_rate_per_rudder": -0.4, "yaw_damping": 0.75}


def inputs(random, t):
    """Thrust and rudder in steps of five seconds, (rows, 2)."""
    steps = len(t) // 50 + 1
    thrust = np.repeat(random.uniform(0.0, 3.0, steps), 50)[: len(t)]
    return np.column_stack([thrust, np.repeat(random.uniform(-0.4, 0.4, steps), 50)[: len(t)]])


@pytest.fixture(scope="module")
def pool(tmp_path_factory):
    """A skeleton, cases flown by its model with other numbers, and the vehicle identified from the healthy ones."""
    folder = tmp_path_factory.mktemp("own")
    made = glider("vehicle", "new", "mine", "--own", cwd=folder)
    assert made.returncode == 0, made.stderr
    model = module_of(folder / "mine_model.py")

    def case(name, seed, runs=4, **wrong):
        return write_case(
            folder / name, model, inputs, runs=runs, seed=seed, vehicle="../mine.toml", changes=HEALTHY, **wrong
        )

    case("healthy", 1, runs=8)
    done = glider("identify", "healthy", "--out", "identified", "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder, case, json.loads(done.stdout)


def diagnosed(folder, case):
    """diagnosis.json of a case by the identified vehicle."""
    done = glider(
        "gap",
        "diagnose",
        case,
        "--vehicle",
        "identified/identified.toml",
        "--out",
        f"{case}-said",
        "--json",
        cwd=folder,
    )
    assert done.returncode == 0, done.stderr
    assert (folder / f"{case}-said" / "report.html").stat().st_size > 5_000
    return json.loads(done.stdout)


def test_the_skeleton_is_a_model_that_passes_its_check(pool):
    folder, _, _ = pool
    found = json.loads(glider("vehicle", "check", "mine.toml", "--json", cwd=folder).stdout)
    assert found["level"] == 1
    assert found["compiled"]
    assert {"rudder_gain", "depth_bias", "heave_drag"} <= set(found["causes"])


def test_a_column_in_another_unit_is_said_before_anything_is_fitted(pool):
    folder, case, _ = pool
    case("centimetres", 41, runs=2, read=lambda n, y: y * [100.0, 1.0, 1.0])
    case("metres", 42, runs=2)
    known = "--vehicle", "identified/identified.toml"
    found = glider("gap", "readings", "centimetres", *known, "--json", cwd=folder)
    assert found.returncode == 0, found.stderr
    first = json.loads(found.stdout)["readings"][0]
    assert (first["columns"], first["times"]) == (["depth_m"], 0.01)
    assert "depth_m times 0.01" in glider("gap", "measure", "centimetres", *known, cwd=folder).stderr
    assert "no column" in glider("gap", "readings", "metres", *known, cwd=folder).stdout


def test_that_a_model_has_no_noises_is_said(pool):
    folder, *_ = pool
    text = (folder / "mine_model.py").read_text()
    calm = text.replace('noises = [("heave", "m/s2", 0.01), ("yawing", "rad/s2", 0.01)]', "noises = {}")
    (folder / "calm_model.py").write_text(calm.replace(" + w[0]", "").replace(" + w[1]", ""))
    (folder / "calm.toml").write_text('format = 1\nmodel = "calm_model"\n')
    checked = glider("vehicle", "check", "calm.toml", cwd=folder)
    assert "no noises are declared" in checked.stdout, checked.stdout + checked.stderr


def test_identification_finds_the_numbers_and_predicts_runs_left_out_better(pool):
    _, _, answer = pool
    assert answer["handed_out"] == "identified"
    assert answer["gap"]["after"]["total"] < 0.5 * answer["gap"]["before"]["total"]
    by_name = {one["name"]: one for one in answer["parameters"]}
    for name, value in HEALTHY.items():
        low, high = by_name[name]["ci90"]
        room = 2.0 * (high - low)
        assert low - room < value < high + room, by_name[name]


def test_a_number_of_each_run_is_found_run_by_run(pool):
    folder, case, _ = pool
    weights = np.array([0.5, 1.1, 0.7, 0.9, 0.4, 1.2])
    place = [one[0] for one in module_of(folder / "mine_model.py").parameters].index("weight_in_water")

    def with_weight(n, theta):
        theta[place] = weights[n]
        return theta

    case("trimmed", 31, runs=len(weights), theta_of=with_weight)
    text = (folder / "mine.toml").read_text() + '[parameters.weight_in_water]\nscope = "run"\n'
    (folder / "trimmed.toml").write_text(text)
    done = glider("identify", "trimmed", "--vehicle", "trimmed.toml", "--out", "by-run", "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    found = next(one for one in json.loads(done.stdout)["parameters"] if one["name"] == "weight_in_water")
    off = np.array(found["runs"]) - weights
    assert off.std() < 0.2 * weights.std()


def test_a_healthy_case_is_none(pool):
    folder, case, _ = pool
    case("same", 2)
    answer = diagnosed(folder, "same")
    assert answer["verdict"] == "none"
    assert answer["selected"] == []
    assert sum(one["probability"] for one in answer["causes"]) == pytest.approx(1.0, abs=1e-3)


def test_a_report_is_drawn_again_from_its_answer(pool):
    folder, case, _ = pool
    if not (folder / "same-said").is_dir():
        case("same", 2)
        diagnosed(folder, "same")
    before = (folder / "same-said" / "report.html").read_bytes()
    done = glider("gap", "report", "same-said", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert (folder / "same-said" / "report.html").read_bytes() == before


def test_a_rudder_that_turns_less_is_its_gain(pool):
    folder, case, _ = pool
    case("rudder", 3, driven=lambda n, u: u * [1.0, 0.7])
    answer = diagnosed(folder, "rudder")
    first = answer["causes"][0]
    assert answer["verdict"] == "cause"
    assert {"rudder_gain", "turn_rate_per_rudder"} & set(first["group"])
    assert any("from one session" in line for line in answer["cautions"])
    assert len(first["group"]) <= 3
    assert answer["gap"]["after"]["total"] < 0.6 * answer["gap"]["before"]["total"]


def test_a_gyro_that_reads_too_much_is_its_gain(pool):
    folder, case, _ = pool
    case("gyro", 4, read=lambda n, y: y * [1.0, 1.0, 1.2])
    answer = diagnosed(folder, "gyro")
    first = answer["causes"][0]
    assert first["label"] == "r_gain"
    assert answer["selected"] == ["r_gain"]
    assert first["parameters"]["r_gain"]["estimate"] == pytest.approx(0.2, abs=0.05)
    measured = glider("gap", "measure", "gyro", "--vehicle", "gyro-said/corrected.toml", "--json", cwd=folder)
    assert json.loads(measured.stdout)["channels"]["r"] == pytest.approx(answer["gap"]["after"]["r"], rel=0.1)
    assert answer["gap"]["after"]["r"] < 0.5 * answer["gap"]["before"]["r"]


def test_a_label_in_the_vehicle_file_that_the_model_has_not_is_one_line(pool):
    folder, case, _ = pool
    case("named", 8, runs=2)
    text = (folder / "identified" / "identified.toml").read_text() + "\n[effects]\nr_gin = 0.1\n"
    (folder / "identified" / "named.toml").write_text(text)
    done = glider("gap", "measure", "named", "--vehicle", "identified/named.toml", cwd=folder)
    assert done.returncode == 2
    assert f"named.toml:{len(text.splitlines())}: effects.r_gin: the model has no such label" in done.stderr


def test_a_force_that_grows_in_every_run_is_unknown(pool):
    """Water that comes in: no label has it, the thrust's offset and the depth's drift come near."""
    folder, case, _ = pool
    case("leak", 6, driven=lambda n, u: u + np.linspace(0.0, 1.0, len(u))[:, None] * [1.0, 0.0])
    answer = diagnosed(folder, "leak")
    assert answer["verdict"] == "unknown"
    assert answer["causes"][0]["probability"] > 0.5
    assert answer["selected"] == []


def test_runs_without_a_case_file_are_a_case_where_their_vehicle_is_named(pool):
    folder, case, _ = pool
    case("logs", 7, runs=2)
    command = ("gap", "measure", "logs", "--vehicle", "mine.toml", "--json")
    before = json.loads(glider(*command, cwd=folder).stdout)
    (folder / "logs" / "case.toml").unlink()
    assert json.loads(glider(*command, cwd=folder).stdout) == before
    unnamed = glider("gap", "measure", "logs", cwd=folder)
    assert unnamed.returncode == 2
    assert "case.toml" in unnamed.stderr
    for run in (folder / "logs").iterdir():
        run.unlink()
    absent = glider("gap", "measure", "logs", "--vehicle", "yours.toml", cwd=folder)
    assert absent.returncode == 2
    assert "no vehicle 'yours.toml'" in absent.stderr
    empty = glider(*command, cwd=folder)
    assert empty.returncode == 2
    assert "neither case.toml nor run*.csv" in empty.stderr


MAPPING = """
format = 1
vehicle = "mine.toml"
[time]
column = "stamp"
unit = "ms"
[columns.thrust_n]
source = "Thrust"
[columns.rudder_rad]
source = "Rudder (deg)"
unit = "deg"
[columns.depth_m]
source = "Depth"
unit = "cm"
[columns.yaw_rad]
source = "Heading"
unit = "deg"
[columns.r_rad_s]
source = "Turn"
"""
LOGGED = {"stamp": ("t_s", 1e3), "Thrust": ("thrust_n", 1.0), "Rudder (deg)": ("rudder_rad", 180.0 / np.pi),
          "Depth": ("depth_m", 100.0), "Heading": ("yaw_rad", 180.0 / np.pi), "Turn": ("r_rad_s", 1.0)}  # fmt: skip


def test_another_log_comes_into_the_columns_that_the_model_declares(pool):
    folder, case, _ = pool
    case("ours", 9, runs=2)
    for run in sorted((folder / "ours").glob("run*.csv")):
        header, *rows = csv.reader(run.read_text().splitlines())
        values = dict(zip(header, np.array(rows, dtype=float).T, strict=True))
        log = np.column_stack([values[name] * factor for name, factor in LOGGED.values()])
        with (folder / f"log_{run.name}").open("w", newline="") as file:
            csv.writer(file).writerows([list(LOGGED), *log.tolist()])
    (folder / "map.toml").write_text(MAPPING)
    logs = sorted(folder.glob("log_run*.csv"))
    done = glider("import", "csv", *logs, "--map", "map.toml", "--out", "theirs", "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    gaps = [json.loads(glider("gap", "measure", case, "--json", cwd=folder).stdout) for case in ("ours", "theirs")]
    for ours, theirs in zip(*(one["runs"] for one in gaps), strict=True):
        assert theirs["channels"] == pytest.approx(ours["channels"], rel=1e-6)
    (folder / "map.toml").write_text(MAPPING.replace("yaw_rad", "psi_rad"))
    wrong = glider("import", "csv", *logs, "--map", "map.toml", "--out", "wrong", cwd=folder)
    assert wrong.returncode == 2
    assert "columns.psi_rad: no column of mine.toml" in wrong.stderr
    (folder / "map.toml").write_text(MAPPING.replace('unit = "cm"', 'unit = "mbar"'))
    no_density = glider("import", "csv", *logs, "--map", "map.toml", "--out", "wrong", cwd=folder)
    assert no_density.returncode == 2
    assert "water_density_kg_m3: missing key, which depth_m needs" in no_density.stderr
    assert not (folder / "wrong").exists()


def test_the_mapping_to_fill_in_has_the_columns_of_the_model(pool):
    """As it is written it brings run files of the model's own columns in."""
    folder, case, _ = pool
    case("own", 9, runs=2)
    (folder / "maps").mkdir()
    made = glider("import", "csv", "--template", "maps/own.toml", "--vehicle", "mine.toml", cwd=folder)
    assert made.returncode == 0, made.stderr
    text = (folder / "maps" / "own.toml").read_text()
    (folder / "maps" / "own.toml").write_text(text.replace('column = "time"', 'column = "t_s"'))
    logs = sorted((folder / "own").glob("run*.csv"))
    done = glider("import", "csv", *logs, "--map", "maps/own.toml", "--out", "again", cwd=folder)
    assert done.returncode == 0, done.stderr
    gaps = [json.loads(glider("gap", "measure", one, "--json", cwd=folder).stdout)["total"] for one in ("own", "again")]
    assert gaps[1] == pytest.approx(gaps[0], rel=1e-6)
    refused = glider("import", "csv", *logs, "--map", "maps/own.toml", "--vehicle", "mine.toml", cwd=folder)
    assert refused.returncode == 2
    assert "--template" in refused.stderr


BLACK_BOX = """
import numpy as np
import mine_model as mine
inputs, parameters = mine.inputs, mine.parameters
outputs = [mine.outputs[0] | {"noise": 0.15}, mine.outputs[1] | {"noise": 0.03}]
def initial(y):
    return np.nan_to_num(np.array([y["depth"], y["depth_rate"], y["yaw"], y["yaw_rate"]]))
def rollout(x, t, u, theta):
    out, still = [], np.zeros(2)
    for k in range(len(t)):
        out.append(mine.measure(x, u[k], theta)[:2])
        h = t[k + 1] - t[k] if k + 1 < len(t) else 0.0
        x = x + h * mine.derivative(x + 0.5 * h * mine.derivative(x, u[k], still, theta), u[k], still, theta)
    return np.array(out)
"""


def test_a_black_box_finds_the_numbers_from_noisy_readings_now_and_then(pool):
    """Depth is read every second, to 0.15 m, the turn's rate never: where windows begin is as well known as that."""
    folder, case, _ = pool
    (folder / "box.py").write_text(BLACK_BOX)
    (folder / "box.toml").write_text(
        'format = 1\nmodel = "box"\n[sensors.depth]\nnoise = 0.15\ntolerance = 0.15\n'
        "[sensors.yaw]\nnoise = 0.03\ntolerance = 0.05\n[windows]\nseconds = 10.0\n"
    )

    def read(n, y):
        y = y + np.random.default_rng(900 + n).standard_normal(y.shape) * [0.15, 0.03, 0.0]
        y[np.arange(len(y)) % 10 != 0, 0] = np.nan
        return y

    case("seldom", 8, runs=10, seconds=60.0, read=read)
    done = glider("identify", "seldom", "--vehicle", "box.toml", "--out", "boxed", "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    for one in json.loads(done.stdout)["parameters"]:
        if one["name"] in HEALTHY:
            assert abs(one["mean"] - HEALTHY[one["name"]]) < 3.0 * one["sd"], one


def test_a_watch_names_the_run_from_which_it_is_heavier(pool):
    folder, case, _ = pool
    case("season", 5, runs=9, theta_of=lambda n, theta: theta + np.array([0, 0.6, 0, 0, 0]) * (n >= 6))
    done = glider(
        "gap", "watch", "season", "--vehicle", "identified/identified.toml", "--out", "w", "--json", cwd=folder
    )
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    page = (folder / "w" / "report.html").read_text()
    assert page.count("<svg") == 2  # gap and size over the runs
    assert page.count('class="point cause"') == 3
    assert glider("gap", "report", "w", cwd=folder).returncode == 0
    assert (folder / "w" / "report.html").read_text() == page
    assert [event["from_run"] for event in answer["events"]] == ["run06"]
    assert answer["events"][0]["to_run"] is None
    assert "weight_in_water" in answer["events"][0]["group"]
    assert [run["verdict"] for run in answer["runs"]] == 6 * ["none"] + 3 * ["cause"]


def test_a_run_is_predicted_with_its_rows_and_columns(pool):
    folder, _, _ = pool
    done = glider(
        "gap", "predict", "healthy/run00.csv", "--model", "identified/identified.toml", "--out", "p.csv", cwd=folder
    )
    assert done.returncode == 0, done.stderr
    measured, predicted = (
        np.genfromtxt(folder / one, delimiter=",", names=True) for one in ("healthy/run00.csv", "p.csv")
    )
    assert set(measured.dtype.names) == set(predicted.dtype.names)
    assert len(measured) == len(predicted)
    assert np.sqrt(np.mean((measured["depth_m"] - predicted["depth_m"]) ** 2)) < 0.3


@pytest.fixture(scope="module")
def days(pool):
    """The vehicle identified from five days on which its gyro had another bias."""
    folder, case, _ = pool
    text = (folder / "mine.toml").read_text()
    (folder / "gyro.toml").write_text(text + "\n[sensors.r]\nbias = 0.02\n")
    for day, bias in enumerate((0.02, -0.03, 0.01, -0.01, 0.03)):
        case(f"day{day}", 20 + day, runs=3, read=lambda n, y, bias=bias: y + np.array([0.0, 0.0, bias]))
    done = glider("identify", *(f"day{n}" for n in range(5)), "--vehicle", "gyro.toml", "--out", "days", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "one session" not in (folder / "days" / "identified.json").read_text()
    return folder, case


def test_labels_that_act_alike_differ_alike_from_run_to_run_in_whatever_unit(days):
    folder, _ = days
    kept = tomllib.loads((folder / "days" / "identified.toml").read_text())["identified"]["label_scatter"]
    assert kept["thrust_offset"] == pytest.approx(kept["weight_in_water"], rel=0.2)
    assert kept["heave_push"] * 12.0 == pytest.approx(kept["weight_in_water"], rel=0.2)


@pytest.mark.parametrize("heavier", [0.0, 0.6], ids=["healthy", "heavier"])
def test_another_day_is_no_cause_and_hides_none(days, heavier):
    folder, case = days
    name = f"later{heavier:.0f}"
    case(name, 31, runs=8, read=lambda n, y: y + np.array([0.0, 0.0, 0.02 if n < 4 else -0.02]),
         theta_of=lambda n, theta: theta + np.array([0, heavier, 0, 0, 0]) * (n >= 4))  # fmt: skip
    done = glider("gap", "watch", name, "--vehicle", "days/identified.toml", "--out", f"w{name}", "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert [one["from_run"] for one in answer["sessions"]] == ["run04"]
    first = answer["sessions"][0]["differences"][0]
    assert first["name"] == "r_bias"
    assert first["difference"] == pytest.approx(-0.04, abs=0.01)
    assert any("run04" in line and "r_bias" in line for line in answer["cautions"])
    if heavier:
        (event,) = answer["events"]
        assert (event["from_run"], event["to_run"]) == ("run04", None)
        assert "weight_in_water" in event["group"]
        assert event["size"] == pytest.approx(0.6, abs=0.2)
    else:
        assert answer["events"] == []
