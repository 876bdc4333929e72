"""What healthy sessions differ by in a label is no change, where one session's runs are all alike."""

import numpy as np
import pytest

from glider.tools.inference.pooled import Parabola, Pooled
from glider.tools.own import usual_effects
from glider.tools.own.check import load_own
from glider.tools.own.diagnose import diagnose_own
from glider.tools.own.identified import write
from glider.tools.own.identify import identify
from glider.tools.own.usual_effects import _in_common
from tests.support.turner import turned, written

K = 3  # numbers, of which the last is a label


@pytest.mark.parametrize("own", [0.0, 0.3, 2.0])
@pytest.mark.parametrize("common", [0.0, 0.7])
def test_a_label_beside_what_a_session_has_in_common_has_the_evidence_of_the_model_written_out(own, common):
    random, runs, tau = np.random.default_rng(3), 4, 1.3
    about = []
    for _ in range(runs):
        rows = random.normal(size=(6, K))
        about.append(Parabola(random.normal(size=K), 1.0, random.normal(size=K), rows.T @ rows))
    root = common * np.vstack([random.normal(size=(K - 1, 2)), np.zeros(2)])
    slope, precision, value = _in_common(about, root, K - 1, np.array([own**2]))[:, 0]
    # root's deviations, those of the runs, the label
    count, augmented = 2 + runs + 1, []
    for n, one in enumerate(about):
        into = np.zeros((K, count))
        into[:, :2] = root
        into[K - 1, [2 + n, count - 1]] = 1.0
        augmented.append(Parabola(np.zeros(count), 0.0, into.T @ one.offset, into.T @ one.curvature @ into))
    for size in (0.0, tau):
        V = np.diag([1.0, 1.0, *runs * [own**2], size**2])
        total = 1.0 + size**2 * precision
        gain = value + 0.5 * (slope**2 * size**2 / total - np.log(total))
        assert gain == pytest.approx(Pooled.of(augmented, V).log_evidence())


LAGS = 0.35, 0.8, 0.5, 0.65  # s: of the vehicle's motor, day by day


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("days")


def identified(folder, lags):
    """The vehicle of days with these lags."""
    model = written(folder)
    found = identify(load_own(folder / "turner.toml"), [turned(model, 20 + n, lag, 3) for n, lag in enumerate(lags)])
    write(found, folder / "identified")
    return load_own(folder / "identified" / "identified.toml"), model


def test_a_label_that_is_none_of_the_vehicles_differs_between_days_and_not_between_runs(folder, monkeypatch):
    monkeypatch.setattr(usual_effects, "MOST_EFFECTS", 0)
    vehicle, _ = identified(folder, (0.2, 0.9, 0.4, 0.7))
    table = vehicle.file.identified
    assert vehicle.declared.effects == {}
    assert table.label_session_scatter["motor_lag"] > max(0.05, 5.0 * table.label_scatter["motor_lag"])


def test_another_day_is_no_change_and_hides_none_but_one_far_from_all_is(folder):
    """The lag is among the vehicle's numbers, and differs from day to day as it did."""
    vehicle, model = identified(folder, LAGS)
    table = vehicle.file.identified
    assert list(vehicle.declared.effects) == ["motor_lag"]
    assert table.session_scatter["motor_lag"] == pytest.approx(np.std(LAGS, ddof=1), rel=0.6)
    assert table.scatter["motor_lag"] < 0.2 * table.session_scatter["motor_lag"]

    def chances(seed: int, lag: float, **changes: float) -> dict[str, float]:
        return diagnose_own(vehicle, turned(model, seed, lag, 3, **changes))[0].chances

    assert chances(31, 0.4)["none"] > 0.7
    assert chances(41, 0.75)["none"] > 0.7
    assert chances(32, 0.4, damping=0.65)["damping"] > 0.7
    assert chances(33, 3.0)["motor_lag"] > 0.7
