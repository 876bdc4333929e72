"""The report: one file that needs nothing else, right in numbers, and looked at in a browser."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from glider.tools.gap.assess import CaseGap, assess
from glider.tools.report import gap as gap_report
from glider.tools.report.gap import report_html, write_report
from tests.support.flights import World, fly_case
from tests.support.pages import assert_offline


@pytest.fixture(scope="module")
def found() -> CaseGap:
    case, _ = fly_case(World(mocap=True, seconds=45.0), 31, runs=2)
    return assess(case)


@pytest.fixture(scope="module")
def page(found) -> str:
    return report_html(found)


def test_it_opens_offline(page):
    assert_offline(page)


def test_numbers_are_those_of_the_measure(found, page):
    text = re.sub(r"<[^>]*>", " ", re.sub(r"<svg.*?</svg>", "", page, flags=re.S))
    assert f"{found.total:.2f}" in text
    for run in found.runs:
        assert run.name in text
        for value in run.channels.values():
            assert f"{value:.2f}" in text


def test_every_run_has_its_pictures(found, page):
    # depth, pitch, roll, yaw, three rates, slider, ballast, each with its error; plan
    assert page.count("<svg") == 19 * len(found.runs)
    assert page.count('class="line predicted"') == 19 * len(found.runs)
    assert page.count('class="line limit"') == 9 * 2 * len(found.runs)
    assert page.count('class="start"') == 18 * 2 * len(found.runs)  # two whole windows
    assert page.count('class="unscored"') == 18 * len(found.runs)


def test_names_from_outside_are_no_markup(found, monkeypatch):
    monkeypatch.setattr(found.case, "site", "<b>pond</b>")
    assert "<b>pond</b>" not in report_html(found)


def test_a_long_case_shows_its_worst_runs(found, monkeypatch):
    monkeypatch.setattr(gap_report, "MOST_RUNS", 1)
    page = report_html(found)
    assert page.count("<svg") == 19
    worst = max(found.runs, key=lambda run: run.total).name
    assert f"<h2>{worst}</h2>" in page
    assert "1 more run" in page


@pytest.mark.parametrize("width", [500, 1200])  # 500 px is the narrowest window a headless browser opens
def test_a_browser_shows_it_without_scrolling_sideways(found, tmp_path, width):
    browser = shutil.which("chromium")
    if browser is None:
        pytest.skip("no chromium on this machine")
    path = tmp_path / "gap.html"
    write_report(path, found)
    # The page itself carries no script: a copy of it is asked for its width.
    sizes = "[document.documentElement.scrollWidth, innerWidth, document.body.scrollHeight]"
    probe = f"<script>document.title = {sizes}.join('/')</script>"
    copy = tmp_path / "probe.html"
    copy.write_text(path.read_text().replace("</body>", probe + "</body>"))
    shown = subprocess.run(
        [browser, "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", "--hide-scrollbars", f"--user-data-dir={tmp_path / 'profile'}",
         f"--window-size={width},1000", "--dump-dom", copy.as_uri()],
        capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    wide, window, height = map(int, re.search(r"<title>(\d+)/(\d+)/(\d+)</title>", shown.stdout).groups())
    assert window == width
    assert wide <= window
    assert height > 1500
    assert Path(path).stat().st_size < 2_000_000
