"""Charts: round ticks, points where they belong, lines that break where data are missing."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

from glider.tools.report.charts import HEIGHT, LEFT, RIGHT, TOP, WIDTH, Band, Chart, Curve, label, svg, ticks


@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (-53.2, 27.9), (0.0123, 0.0127), (-1e4, 3e5), (59.9, 61.0)])
def test_ticks_are_round_and_inside(low, high):
    marks = ticks(low, high)
    assert 2 <= len(marks) <= 6
    assert marks[0] >= low - 1e-9 * (high - low)
    assert marks[-1] <= high + 1e-9 * (high - low)
    step = marks[1] - marks[0]
    assert round(step / 10 ** np.floor(np.log10(step * 1.0001)), 6) in (1.0, 2.0, 5.0)


def test_labels_have_no_tail():
    assert [label(v) for v in (0.30000000000000004, -2.0, 1e-15, 1200.0)] == ["0.3", "\N{MINUS SIGN}2", "0", "1200"]


def points(text: str, style: str) -> np.ndarray:
    path = re.search(rf'class="line {style}" d="([^"]*)"', text).group(1)
    return np.array([[float(v) for v in pair.split()] for pair in re.split("[ML]", path)[1:]])


def chart(y: np.ndarray, **options) -> str:
    t = np.arange(len(y), dtype=float)
    return svg(Chart("depth <m>", "s", [Curve(t, y, "measured")], [Band(0.0, 2.0, "start")], **options))


def test_the_picture_is_well_formed_and_within_its_box():
    text = chart(np.sin(np.arange(50.0)))
    ElementTree.fromstring(text)
    drawn = points(text, "measured")
    assert (drawn[:, 0] >= LEFT - 0.1).all()
    assert (drawn[:, 0] <= WIDTH - RIGHT + 0.1).all()
    assert (drawn[:, 1] >= TOP).all()
    assert (drawn[:, 1] <= HEIGHT).all()
    assert "depth &lt;m&gt;" in text


def test_depth_grows_downwards():
    y = np.array([0.0, 1.0, 2.0])
    assert (np.diff(points(chart(y, down=True), "measured")[:, 1]) > 0).all()
    assert (np.diff(points(chart(y), "measured")[:, 1]) < 0).all()


def test_a_line_breaks_where_nothing_was_measured():
    y = np.array([1.0, 2.0, np.nan, 3.0, 4.0])
    path = re.search(r'class="line measured" d="([^"]*)"', chart(y)).group(1)
    assert path.count("M") == 2
    assert path.count("L") == 2


def test_a_long_line_is_thinned_but_keeps_its_breaks():
    y = np.sin(np.arange(20_000) / 500.0)
    y[7777] = np.nan
    text = chart(y)
    path = re.search(r'class="line measured" d="([^"]*)"', text).group(1)
    assert path.count("M") == 2
    assert path.count("L") < 800


def test_a_plan_has_one_scale_on_both_axes():
    x, y = np.array([0.0, 10.0, 10.0]), np.array([0.0, 0.0, 3.0])
    drawn = points(svg(Chart("plan", "east", [Curve(x, y, "measured")], square=True)), "measured")
    assert abs(drawn[1, 0] - drawn[0, 0]) / 10.0 == pytest.approx(abs(drawn[2, 1] - drawn[1, 1]) / 3.0, rel=0.02)


@pytest.mark.parametrize("y", [np.array([2.0]), np.full(5, 3.0), np.full(4, np.nan)], ids=["one", "flat", "none"])
def test_hardly_anything_to_draw(y):
    ElementTree.fromstring(chart(y))
