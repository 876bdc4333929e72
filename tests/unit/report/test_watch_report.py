"""The report of a watch, drawn from its folder alone."""

import json
import re

import pytest

from glider.tools.api.sentences import watch_lines as lines
from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.report.now import check_of
from glider.tools.report.run_picture import LEFT, RIGHT, WIDTH
from glider.tools.report.watch import write_watch_report
from glider.tools.watch.answer import EventAnswer, RunVerdict, Sized, WatchAnswer
from tests.support.golden import check_golden
from tests.support.pages import assert_offline

EVENT = {
    "label": "drag", "where": [{"subsystem": "hydrodynamics", "element": "surge", "probability": 0.9}],
    "group": ["drag", "linear_drag"], "from_run": "run03", "to_run": None, "course": "growing", "probability": 0.93,
    "size": 0.31, "ci90": [0.2, 0.42], "unit": "1", "sizes": [],
}  # fmt: skip
RUNS = [
    {"run": "run02", "verdict": "none", "causes": [], "gap": 0.8, "skipped": None},
    {"run": "run03", "verdict": "cause", "gap": 2.1, "skipped": None,
     "causes": [
         {"label": "drag", "probability": 0.9, "group": ["drag"], "size": 0.3, "ci90": [0.1, 0.5], "unit": "1"},
     ]},
    {"run": "run04", "verdict": "none", "causes": [], "gap": None, "skipped": "12 s: too short"},
]  # fmt: skip


def answer(folder, **changed):
    """A folder with a watch's answer."""
    table = {"format": 1, "runs": RUNS, "events": [EVENT], "reference": ["run00"], "cautions": ["few runs"]} | changed
    (folder / "watch.json").write_text(json.dumps(table))
    return folder


def test_events_and_runs_are_said(tmp_path):
    write_watch_report(answer(tmp_path))
    page = (tmp_path / "report.html").read_text()
    for text in ("drag, from run03", "still there", "cannot tell it from linear_drag", "too short", "few runs", "0.31"):
        assert text in page


def test_runs_have_the_names_of_their_flights_where_they_are_known(tmp_path):
    write_watch_report(answer(tmp_path, flights={"run03": "w04.mcap, 2026-11-20", "run04": "w05.mcap"}))
    page = (tmp_path / "report.html").read_text()
    for cell in ("run02", "run03 (w04.mcap, 2026-11-20)", "run04 (w05.mcap)"):
        assert f"<td>{cell}</td>" in page


def test_the_picture_shows_size_and_interval_over_the_runs(tmp_path):
    sizes = [{"run": "run03", "size": 0.3, "ci90": [0.1, 0.5]}]
    write_watch_report(answer(tmp_path, events=[EVENT | {"sizes": sizes}], flights={"run03": "w04.mcap, 2026-11-20"}))
    gap, size = re.findall(r"<svg.*?</svg>", (tmp_path / "report.html").read_text(), re.S)
    assert re.findall(r'class="point (\w+)"', gap) == ["none", "cause"]  # the third was not judged
    assert "run03 (w04.mcap, 2026-11-20): gap 2.10, cause" in gap
    assert ">2026-11-20</tspan>" in gap
    # the event's runs are shaded: the last two of three
    x, wide = map(float, re.search(r'class="span" x="([\d.]+)" y="\d+" width="([\d.]+)"', gap).groups())
    assert wide == pytest.approx(2.0 * (WIDTH - LEFT - RIGHT) / 3.0, abs=0.1)
    assert x + wide == pytest.approx(WIDTH - RIGHT, abs=0.1)
    low, high = map(float, re.search(r'<path d="M[\d.]+ ([\d.]+)V([\d.]+)"', size).groups())
    middle = float(re.search(r'cy="([\d.]+)"', size).group(1))
    assert middle == pytest.approx(0.5 * (low + high), abs=0.1)
    assert low > high  # 0.1 is drawn below 0.5


def test_an_event_without_sizes_by_run_is_a_stripe(tmp_path):
    write_watch_report(answer(tmp_path))
    _, size = re.findall(r"<svg.*?</svg>", (tmp_path / "report.html").read_text(), re.S)
    assert 'class="size"' in size
    assert 'class="point' not in size


def test_what_to_check_and_the_sign_of_a_change_are_said(tmp_path):
    parameters = {"scale": {"estimate": 0.31, "ci90": [0.2, 0.42], "unit": "1"}}
    write_watch_report(answer(tmp_path, events=[EVENT | {"parameters": parameters}]))
    page = (tmp_path / "report.html").read_text()
    assert " times 1.31" in page
    assert check_of("drag")[0] in page
    assert_offline(page)


def test_sentences_of_page_and_terminal(tmp_path):
    size = Sized(0.31, (0.2, 0.42), "1")
    runs = [RunVerdict("run02", "none", [], 0.8, None), RunVerdict("run03", "cause", [], 2.1, None)]
    event = EventAnswer("drag", [], ["drag"], "run03", None, "step", 0.93, size, [])
    sentences = lines(WatchAnswer(runs, [event], ["run00"], [], "roughie", {"run03": "w04.mcap, 2026-11-20"}))
    assert sentences[1].startswith("run03 (w04.mcap, 2026-11-20) cause")
    assert sentences[0].index("none") == sentences[1].index("cause")
    said = {
        "a page, runs alone": write_watch_report(answer(tmp_path)),
        "a page, flights known": write_watch_report(answer(tmp_path, flights={"run03": "w04.mcap, 2026-11-20"})),
        "a page, no event": write_watch_report(answer(tmp_path, events=[])),
        "a terminal": sentences[-1],
    }
    check_golden("watch_words.txt", "".join(f"{name}:\n{text}\n\n" for name, text in said.items()))


@pytest.mark.parametrize("changed", [{"runs": 3}, {"events": [{"label": 1}]}])
def test_what_is_no_answer_is_one_line(tmp_path, capsys, changed):
    folder = answer(tmp_path, **changed)
    code = report_errors(lambda **kept: cli(["gap", "report", str(folder)], **kept))
    assert code == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "watch.json" in line
