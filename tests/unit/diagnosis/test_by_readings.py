"""What readings are certain of is selected with its size, whatever path the rest of the answer took."""

import numpy as np
import pytest

from glider.sim_backend.core.effects import effect_layout as ef
from glider.tools.diagnose import by_readings
from glider.tools.diagnose.diagnosis import diagnose, plain
from glider.tools.gap.corrected import findings_of
from glider.tools.inference.rules import Rules
from glider.tools.readings.findings import Finding
from tests.support.cases import make_case

pytestmark = pytest.mark.computes(seconds=20)

SCALE = -0.8
FAR = {
    "CG_OFFSET_X": -0.0023, "NET_MASS_OFFSET": 0.023, "DRAG_0": 0.46, "PITCH_TRIM": 0.37, "LIFT": 0.43,
    "SLIDER_SCALE": -0.4, "DRAG_ALPHA": -0.43, "WEATHERCOCK": 0.19,
}  # fmt: skip


@pytest.fixture(scope="module")
def near(tmp_path_factory):
    """Gyros that turn a fifth as far, on a vehicle that its file misses by about as much as the catalogue may."""
    F = np.zeros(ef.N_F)
    F[ef.GYRO_SCALE] = SCALE
    for name, value in FAR.items():
        F[getattr(ef, name)] = value
    return make_case(tmp_path_factory.mktemp("near"), F, seed=35, runs=2)


def cause(answer: dict, label: str) -> dict:
    return next(one for one in answer["causes"] if one["label"] == label)


@pytest.mark.parametrize("rules", [Rules(), Rules(evidence=False)], ids=["all", "one effect at most"])
def test_a_gyro_s_scale_is_selected_with_its_size_whichever_path_the_answer_took(near, rules):
    assert {one.label for one in findings_of(near.runs)} >= {"gyro_scale"}
    answer = plain(diagnose(near, rules=rules))
    assert "gyro_scale" in answer["selected"]
    scale = cause(answer, "gyro_scale")["parameters"]["scale"]
    assert scale["estimate"] == pytest.approx(SCALE, abs=0.05)
    assert scale["ci90"][0] < scale["estimate"] < scale["ci90"][1]


def finding(channel: str, label: str | None, size: float, half: float) -> Finding:
    return Finding(channel, "attitude", "scale", size, (size - half, size + half), "1", label, True, "")


def test_sizes_go_by_the_most_certain_and_by_axis():
    scales = [finding(f"{axis}_rad_s", "gyro_scale", 0.2, half) for axis, half in (("p", 0.1), ("q", 0.01))]
    others = [finding("r_rad_s", "gyro_bias", 0.5, 0.25), finding("yaw_rad", "compass", 0.1, 0.01),
              finding("depth_m", None, 3.0, 0.1), finding("depth_m", "depth_scale", 0.3, 0.1),
              finding("depth_m", "depth_scale", 0.1, 0.01)]  # fmt: skip
    found = by_readings.sizes([*scales, *others])
    assert list(found) == ["gyro_scale", "gyro_bias", "compass", "depth_scale"]
    assert found["gyro_scale"]["scale"].estimate == pytest.approx(0.2)
    assert found["gyro_scale"]["scale"].ci90[1] < 0.215  # both axes together
    assert found["gyro_bias"] == {"r": by_readings.Size(0.5, (0.25, 0.75), "rad/s")}
    assert found["compass"] == {}  # it has more parameters than this has sizes
    assert found["depth_scale"]["scale"].estimate == 0.1
    assert by_readings.nats(others, "depth_scale") == pytest.approx(0.5 * (1.645 * 10.0) ** 2)
