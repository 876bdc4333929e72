"""A small case from files to its report, and the report in a real browser at a phone's width."""

import contextlib
import io
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from glider.firmware.core.vehicle import layout
from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.data.runs.case import load_case, write_case
from glider.tools.inference.corrected import load_corrected
from glider.tools.inference.model import nominal_model
from tests.support.flights import World, fly_case
from tests.support.pages import assert_offline

HEAVY = 0.06  # kg, 12 times what [uncertainty] allows for
PHONE = (390, 844)  # CSS pixels
# The page carries no script of its own: a copy of it is asked how it stands, from within a frame as wide as a phone.
PROBE = """<script>addEventListener("load", () => {
  const seen = e => e.getBoundingClientRect(), root = document.documentElement;
  const verdict = seen(document.querySelector("#verdict"));
  parent.postMessage({
    wide: Math.max(root.scrollWidth, document.body.scrollWidth), window: innerWidth, height: root.scrollHeight,
    verdict: [verdict.top, verdict.bottom, verdict.left, verdict.right],
    text: document.querySelector("#verdict").innerText,
    requests: performance.getEntriesByType("resource").map(r => r.name),
    svgs: [...document.querySelectorAll("svg")].map(s => [
      seen(s).width, seen(s).height, s.querySelectorAll("path.line[d], rect.stage").length,
      s.querySelectorAll("text").length,
    ]),
  }, "*");
})</script>"""
FRAME = """<!doctype html><body style="margin:0">
<iframe src="probe.html" style="width:{}px;height:{}px;border:0"></iframe><pre id="said"></pre>
<script>addEventListener("message", e => said.textContent = JSON.stringify(e.data))</script></body>"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A heavy vehicle's case and, beside it, the answer."""
    case, _ = fly_case(World(mocap=True, seconds=45.0, changes={layout.NET_MASS: HEAVY}), 41, runs=2)
    path = tmp_path_factory.mktemp("diagnosis") / "heavy"
    write_case(
        path, case.runs, vehicle="roughie", site="pond", log_rate_hz=10.0, water_density_kg_m3=998.0, suffix=".csv.gz"
    )
    return path


def glider(*words: object) -> int:
    """The command line's exit code."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", ["glider", *map(str, words)])
        return report_errors(cli)


@pytest.fixture(scope="module")
def said(folder) -> str:
    """What the command prints on standard output; its files lie in `answer` beside the case."""
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert glider("gap", "diagnose", folder, "--out", folder.parent / "answer") == 0
    return out.getvalue()


@pytest.fixture(scope="module")
def page(folder, said) -> str:
    return (folder.parent / "answer" / "report.html").read_text()


def test_the_cause_is_found_and_said(folder, said):
    found = json.loads((folder.parent / "answer" / "diagnosis.json").read_text())
    assert found["verdict"] == "cause"
    assert found["selected"][0] == "net_buoyancy"
    assert "the vehicle is ballasted heavy or light (net_buoyancy, mass: net" in said.lower()
    mass = found["causes"][0]["parameters"]["mass"]["estimate"]
    assert f"mass {1000.0 * mass:.1f} g, 90 %: " in said
    assert "heavy positive" in said
    _, verdict, first, *_, gaps = said.strip().splitlines()
    assert verdict == f"verdict: cause, {', '.join(found['selected'])}"
    assert first.split()[:2] == [f"{found['causes'][0]['probability']:.2f}", "net_buoyancy"]
    assert gaps.startswith(f"gap in tolerances: before {found['gap']['before']['total']:.2f}, recalibrated ")
    case = load_case(folder)
    load_corrected(folder.parent / "answer" / "corrected.toml", nominal_model(case))
    low, high = found["causes"][0]["parameters"]["mass"]["ci90"]
    assert low < HEAVY < high or abs(found["causes"][0]["parameters"]["mass"]["estimate"] - HEAVY) < 0.02


def test_it_is_drawn_again_from_what_is_on_disk(folder, said, page, tmp_path, capsys):
    """Also where the case has moved: the folder holds what the pictures show. The verdict is printed again."""
    again = tmp_path / "again"
    shutil.copytree(folder.parent / "answer", again)
    (again / "report.html").unlink()
    assert glider("gap", "report", again) == 0
    assert (again / "report.html").read_bytes() == page.encode()
    assert capsys.readouterr().out == said


@pytest.mark.parametrize(
    ("name", "damage", "message"),
    [
        ("report.json", None, "report.json: no such file"),
        ("diagnosis.json", "{", "diagnosis.json"),
        ("diagnosis.json", '{"format": 2}', "diagnosis.json"),
        ("report.json", '{"format": 1}', "missing required field"),
        ("report.npz", "PK", "report.npz: not the curves of this diagnosis"),
    ],
)
def test_a_damaged_diagnosis_is_one_line_and_exit_2(folder, page, tmp_path, capsys, name, damage, message):
    broken = tmp_path / "broken"
    shutil.copytree(folder.parent / "answer", broken)
    if damage is None:
        (broken / name).unlink()
    else:
        (broken / name).write_text(damage)
    assert glider("gap", "report", broken) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert message in line
    assert glider("gap", "report", tmp_path / "nothing") == 2


def test_drawing_a_report_fits_nothing():
    script = "import sys, glider.tools.report.diagnosis; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    assert "glider.tools.report.words" in loaded
    fitting = {
        "glider.tools.inference.fit",
        *(f"glider.tools.diagnose.{name}" for name in ("search", "verdict", "chain", "shrink")),
    }
    assert not fitting & set(loaded)


def test_it_opens_offline_and_without_script(page):
    assert_offline(page)


def test_sections_stand_in_order_with_the_answer_in_them(page, folder):
    order = ["verdict", "where", "ranking", "shrinkage", "left", "next"]
    places = [page.index(f'id="{name}"') for name in order]
    assert places == sorted(places)
    found = json.loads((folder.parent / "answer" / "diagnosis.json").read_text())
    for which in ("before", "recalibrated", "after", "floor"):
        for value in found["gap"][which].values():
            assert f"<td>{value:.2f}</td>" in page
    # depth, pitch, roll, yaw and the plan, of two runs, each with three lines; and the chain
    assert page.count("<svg") == 11
    for style in ("measured", "nominal", "corrected"):
        assert page.count(f'class="line {style}"') == 10
    assert "net mass" in page  # the link that takes it up, by the effect that was tried there


def test_a_phone_shows_it(page, tmp_path):
    browser = shutil.which("chromium")
    if browser is None:
        pytest.skip("no chromium on this machine")
    (tmp_path / "probe.html").write_text(page.replace("</body>", PROBE + "</body>"))
    (tmp_path / "frame.html").write_text(FRAME.format(*PHONE))
    shown = subprocess.run(
        [browser, "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", f"--user-data-dir={tmp_path / 'profile'}",
         "--window-size=800,900", "--virtual-time-budget=10000", "--dump-dom", (tmp_path / "frame.html").as_uri()],
        capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    answer = json.loads(re.search(r'<pre id="said">(\{.*?\})</pre>', shown.stdout, re.S).group(1))
    assert answer["window"] <= PHONE[0]
    assert answer["window"] > PHONE[0] - 20  # less a scroll bar
    assert answer["wide"] <= answer["window"]
    top, bottom, left, right = answer["verdict"]
    assert 0 <= top < bottom < PHONE[1]
    assert 0 <= left < right <= answer["window"]
    assert "net_buoyancy" in answer["text"]
    assert answer["requests"] == []
    assert len(answer["svgs"]) == 11
    for wide, high, drawn, labels in answer["svgs"]:
        assert 250 < wide <= answer["window"]
        assert high > 50
        assert drawn >= 3
        assert labels >= 4
    assert 2000 < answer["height"] < 20_000
    assert len(page) < 2_000_000
