"""6DOF exports of Qualisys: poses, bodies not seen, bad files, and the clocks' offset to an onboard log."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from glider.tools.data.errors import InputError
from glider.tools.data.importers.align import aligned, find_offset
from glider.tools.data.importers.captured import import_qualisys
from glider.tools.data.importers.qualisys import read_capture
from glider.tools.data.runs import columns as names
from glider.tools.data.runs.case import load_case, write_case
from glider.tools.data.runs.run import Run

RATE = 50.0
UP = np.diag([1.0, -1.0, -1.0])


def flight(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Position (NED, m) and attitude (roll, pitch, yaw) of a made-up course."""
    position = np.column_stack([2.0 * np.cos(0.2 * t), 2.0 * np.sin(0.2 * t), 2.0 + np.sin(0.31 * t) + 0.03 * t])
    attitude = np.column_stack([0.5 * np.sin(0.4 * t + 1.0), 0.4 * np.cos(0.31 * t), 2.9 + 0.2 * t])
    attitude[:, 2] = (attitude[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    return position, attitude


def export(path: Path, t: np.ndarray, bodies=("glider",), lost=()) -> Path:
    position, attitude = flight(t)
    R = UP @ Rotation.from_euler("ZYX", attitude[:, ::-1]).as_matrix() @ UP
    lines = [f"NO_OF_FRAMES\t{len(t)}", f"NO_OF_BODIES\t{len(bodies)}", f"FREQUENCY\t{RATE:g}", "DATA_INCLUDED\t6D"]
    lines += ["BODY_NAMES\t" + "\t".join(bodies), "\t".join(["X", "Y", "Z", "Roll", "Pitch", "Yaw", "Residual"])]
    for n in range(len(t)):
        row = [*(1000.0 * position[n] @ UP), 0.0, 0.0, 0.0, 0.5, *R[n].T.reshape(-1)]
        row = [0.0] * 6 + [-1.0] + [0.0] * 9 if n in lost else row
        lines.append("\t".join(f"{value:.6f}" for value in row * len(bodies)))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_poses_are_those_of_the_vehicle_in_ned(tmp_path):
    t = np.arange(200) / RATE
    capture = read_capture(export(tmp_path / "a.tsv", t, ("other", "glider"), lost=(7, 8)), "glider")
    position, attitude = flight(t)
    seen = np.isfinite(capture.pose).all(axis=1)
    assert np.flatnonzero(~seen).tolist() == [7, 8]
    assert capture.rate_hz == RATE
    assert np.allclose(capture.t, t)
    assert np.allclose(capture.pose[seen, :3], position[seen], atol=1e-6)
    assert np.allclose(np.exp(1j * capture.pose[seen, 3:]), np.exp(1j * attitude[seen]), atol=1e-5)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda text: text.replace("FREQUENCY", "F"), "FREQUENCY: "),
        (lambda text: text.replace("NO_OF_BODIES\t1", "NO_OF_BODIES\t2"), "1 names for 2 bodies"),
        (lambda text: text.rsplit("\t", 3)[0] + "\n", "fields, 16 expected"),
        (lambda text: "a,b,c\n1,2,3\n", "not a 6DOF export"),
        (lambda text: text.replace("0.500000", "0.5x", 1), "not a number|not a 6DOF|fields"),
    ],
)
def test_a_bad_file_is_named_in_one_line(tmp_path, change, says):
    path = export(tmp_path / "bad.tsv", np.arange(30) / RATE)
    path.write_text(change(path.read_text(encoding="utf-8")), encoding="utf-8")
    if "0.5x" in path.read_text(encoding="utf-8"):  # the first row: taken for a title line, the rest is read
        assert len(read_capture(path).t) == 29
        return
    with pytest.raises(InputError, match=says) as caught:
        read_capture(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def logged(t: np.ndarray, seed: int) -> Run:
    rng = np.random.default_rng(seed)
    position, attitude = flight(t)
    columns = {names.TIME: t - t[0], names.DEPTH: position[:, 2] + 0.004 * rng.standard_normal(len(t))}
    for n, name in enumerate(names.ATTITUDE):
        columns[name] = attitude[:, n] + 0.003 * rng.standard_normal(len(t))
    return Run("run00", None, columns)


@pytest.mark.parametrize("late", [-12.34, 0.07, 181.26])
def test_the_clocks_offset_is_found(tmp_path, late):
    log = logged(np.arange(0.0, 300.0, 0.1), 1)
    begins = max(late, 0.0)  # of the capture, on the log's clock
    capture = read_capture(export(tmp_path / "a.tsv", np.arange(late, late + 60.0, 1.0 / RATE)))
    offset = find_offset(log, capture)
    assert offset.seconds == pytest.approx(late, abs=max(4.0 * offset.sd, 0.02))
    assert offset.sd < 0.1
    run = aligned(log, capture, offset)
    inside = np.isfinite(run.columns["mocap_z_m"])
    assert inside.any()
    assert log.t[inside][0] >= begins - 0.2
    assert np.abs(run.columns["mocap_z_m"] - log.columns[names.DEPTH])[inside].max() < 0.05


def test_a_capture_of_another_flight_is_refused(tmp_path):
    t = np.arange(0.0, 60.0, 0.1)
    rng = np.random.default_rng(2)
    other = Run("run00", None, {names.TIME: t, names.DEPTH: np.cumsum(rng.standard_normal(len(t)))})
    capture = read_capture(export(tmp_path / "a.tsv", np.arange(0.0, 60.0, 1.0 / RATE)))
    capture.pose[:, 2] = np.cumsum(rng.standard_normal(len(capture.t)))
    with pytest.raises(InputError, match="fit together"):
        find_offset(other, capture)


def test_a_case_beside_its_log(tmp_path):
    log = logged(np.arange(0.0, 60.0, 0.1), 3)
    about = dict(vehicle="roughie", site="pool", log_rate_hz=10.0, water_density_kg_m3=998.0)
    write_case(tmp_path / "log", [log], **about)
    file = export(tmp_path / "a.tsv", np.arange(2.5, 50.0, 1.0 / RATE))
    _, offsets = import_qualisys([file], tmp_path / "log", None, "roughie", tmp_path / "case")
    case = load_case(tmp_path / "case")
    assert case.motion_capture
    assert offsets[0].seconds == pytest.approx(2.5, abs=0.05)
    assert np.isfinite(case.runs[0].columns["mocap_yaw_rad"]).mean() > 0.7
