"""A small case from files to its report, and the report in a real browser: clicked, zoomed, narrow, dark, printed."""

import contextlib
import io
import json
import re
import shutil
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest
from mcap.reader import make_reader
from msgspec.structs import replace

from glider.firmware.core.vehicle import layout
from glider.tools.cli.common import report_errors
from glider.tools.cli.main import cli
from glider.tools.data.runs.case import load_case, write_case
from glider.tools.diagnose.record import Curves, DiagnosisRecord, read_record
from glider.tools.inference.channels import ROUGHIE_MEASURES
from glider.tools.inference.corrected import load_corrected
from glider.tools.inference.model import nominal_model
from glider.tools.report import words
from glider.tools.report.diagnosis import report_html
from glider.tools.report.now import check_of
from tests.support.browser import CHROMIUM, Page, browser
from tests.support.flights import World, fly_case
from tests.support.pages import assert_offline

HEAVY = 0.06  # kg, 12 times what [uncertainty] allows for
MOST_BYTES = 3_000_000  # of a page of six runs
TRACES = "document.querySelector('#traces').dataset"


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
    assert "(net_buoyancy, mass: net" in said.lower()
    mass = found["causes"][0]["parameters"]["mass"]["estimate"]
    assert f"mass {1000.0 * mass:.1f} g, 90 %: " in said
    assert "heavy positive" in said
    _, verdict, first, *_, gaps = said.strip().splitlines()
    assert verdict == f"verdict: cause, {', '.join(found['selected'])}"
    assert first.split()[:2] == [f"{found['causes'][0]['probability']:.2f}", "net_buoyancy"]
    assert f" {found['gap']['before']['total']:.2f}, " in gaps
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
        ("report.json", None, "report.json: "),
        ("diagnosis.json", "{", "diagnosis.json"),
        ("diagnosis.json", '{"format": 2}', "diagnosis.json"),
        ("report.json", '{"format": 1}', "missing required field"),
        ("report.npz", "PK", "report.npz: "),
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


def test_it_opens_offline(page):
    assert_offline(page, scripts=2)  # the data, and what draws them
    assert "default-src 'none'" in page


def test_sections_stand_in_order_with_the_answer_in_them(page, folder):
    order = ["verdict", "now", "where", "ranking", "traces", "shrinkage", "left", "next"]
    places = [page.index(f'id="{name}"') for name in order]
    assert places == sorted(places)
    found = json.loads((folder.parent / "answer" / "diagnosis.json").read_text())
    for which in ("before", "recalibrated", "after", "floor"):
        for value in found["gap"][which].values():
            assert re.search(rf"<td>{value:.2f}(<br>|</td>)", page)
    assert page.count("<svg") == 1 + len(found["selected"])  # the chain; innovations of each effect against a feature
    assert "net mass" in page  # the link that takes it up, by the effect that was tried there


def test_it_says_what_to_check_and_what_to_enter(page, folder):
    found = json.loads((folder.parent / "answer" / "diagnosis.json").read_text())
    now = page[page.index('id="now"') : page.index('id="where"')]
    assert check_of("net_buoyancy")[0] in now
    (entry,) = [one for one in found["enter"] if one["label"] == "net_buoyancy"]
    assert (entry["key"], entry["file"], entry["unit"]) == ("trim.net_mass", 0.0, "kg")
    assert entry["value"] == pytest.approx(found["causes"][0]["parameters"]["mass"]["estimate"])
    assert f"<td><b>{words.number(entry['value'])}</b></td>" in now


def test_the_mission_of_the_next_run_is_in_the_page(page, folder):
    (link,) = re.findall(r'download="next_run.toml" href="data:application/toml;charset=utf-8,([^"]*)"', page)
    assert unquote(link) == (folder.parent / "answer" / "next_run.toml").read_text()


def test_every_run_has_its_own_estimate(page, folder):
    details = json.loads((folder.parent / "answer" / "report.json").read_text())
    (shown,) = [one for one in details["regressors"] if one["label"] == "net_buoyancy"]
    runs = shown["estimates"]["mass"]
    assert [one["run"] for one in runs] == ["run00", "run01"]
    for one in runs:
        low, high = one["ci90"]
        assert low < one["estimate"] < high
        assert one["estimate"] == pytest.approx(HEAVY, abs=0.02)
    mean, error, predicted = (np.array([row[n] for row in shown["bins"]]) for n in (1, 2, 3))
    assert (np.abs(mean - predicted) < 6.0 * error + 0.3).mean() > 0.9  # the effect is of the right form
    assert np.abs(predicted).max() > 5.0


@pytest.fixture(scope="module")
def shown(page, folder, tmp_path_factory) -> Iterator[Page]:
    """The report in a browser."""
    if CHROMIUM is None:
        pytest.skip("no chromium on this machine")
    with browser(tmp_path_factory.mktemp("profile")) as opened:
        opened.view(1200, 900)
        opened.open(folder.parent / "answer" / "report.html")
        yield opened


def axes(shown: Page) -> list[float]:
    """First and last second of the time axes."""
    return [float(shown.value(f"{TRACES}.{name}")) for name in ("from", "to")]


def test_a_click_on_a_claim_leads_to_its_run_and_second(shown):
    claims = shown.value("[...document.querySelectorAll('a.claim')].map(one => ({...one.dataset}))")
    assert len(claims) >= 5
    runs = {claim["run"] for claim in claims}
    for claim in [claims[0], *(next(one for one in claims if one["run"] == run) for run in runs)]:
        selector = f'a.claim[data-run="{claim["run"]}"][data-second="{claim["second"]}"]'
        shown.click(f'{selector}[data-chart="{claim["chart"]}"]')
        second, (first, last) = float(claim["second"]), axes(shown)
        assert shown.value(f"{TRACES}.run") == f"run0{claim['run']}"
        assert float(shown.value(f"{TRACES}.at")) == second
        assert first <= second <= last
        assert last - first <= 30.1  # 15 s to both sides
        # the mark is drawn over that second, in the chart of the claim, which is in sight
        box, mark = shown.value(
            "['.u-over', '.mark'].map(name => { const r = document.querySelector("
            f"""'figure[data-chart="{claim["chart"]}"] ' + name).getBoundingClientRect();"""
            " return [r.left, r.width, r.top]; })"
        )
        assert (mark[0] + 0.5 * mark[1] - box[0]) / box[1] == pytest.approx((second - first) / (last - first), abs=0.02)
        assert 0 <= box[2] <= shown.value("innerHeight")
        assert shown.value("document.activeElement.dataset.chart") == claim["chart"]


def test_all_charts_share_one_time_axis(shown):
    shown.click('[data-move="whole"]')
    whole = axes(shown)
    shown.drag('figure[data-chart="pitch"] .u-over', 0.25, 0.75)
    first, last = axes(shown)
    assert last - first == pytest.approx(0.5 * (whole[1] - whole[0]), rel=0.03)
    assert first == pytest.approx(whole[0] + 0.25 * (whole[1] - whole[0]), abs=1.0)
    shown.value("document.querySelector('#axes').focus()")
    shown.key("ArrowRight")
    moved = axes(shown)
    assert moved[0] > first
    # every chart has moved its playhead alike: those that are drawn are one and the same axis
    places = shown.value("[...document.querySelectorAll('.head')].map(one => one.style.left)")
    assert len(places) >= 20
    assert len(set(places)) == 1
    shown.key("Home")
    assert axes(shown) == whole


def test_the_replay_moves_the_time(shown):
    def picture() -> str:
        return shown.value("document.querySelector('canvas.replay').toDataURL()")

    shown.click("#run-0")
    before = picture()
    shown.click(".play")
    shown.until(f"{TRACES}.at > 1.0")
    shown.click(".play")
    assert shown.value("document.querySelector('.play').textContent") == "Play"
    at = shown.value(f"{TRACES}.at")
    assert picture() != before
    shown.settle()
    assert shown.value(f"{TRACES}.at") == at


@pytest.mark.parametrize("width", [400, 900, 1600])
@pytest.mark.parametrize("dark", [False, True])
def test_it_fits_every_width_in_light_and_dark(shown, width, dark):
    shown.view(width, 900, dark)
    assert shown.value("document.documentElement.scrollWidth") <= width
    top, bottom = shown.value(
        "(() => { scrollTo(0, 0); const r = document.querySelector('#verdict').getBoundingClientRect();"
        " return [r.top, r.bottom]; })()"
    )
    assert 0 <= top < bottom < 900
    sizes = shown.value("[...document.querySelectorAll('canvas, svg')].map(one => one.getBoundingClientRect().width)")
    assert min(sizes) > 250
    assert max(sizes) <= width
    # no number of the table is out of sight, and text is readable on its ground
    right = shown.value(
        "Math.max(...[...document.querySelectorAll('#now td')].map(one => one.getBoundingClientRect().right))"
    )
    assert right <= width
    ink, ground = (luminance(shown.value(f"getComputedStyle(document.querySelector('#now')).{name}"))
                   for name in ("color", "backgroundColor"))  # fmt: skip
    assert (ink > ground) == dark
    assert (max(ink, ground) + 0.05) / (min(ink, ground) + 0.05) > 7.0
    # the charts are drawn again in the colours of the scheme
    corner = shown.value(
        "(() => { const c = document.querySelector('.plot canvas');"
        " const p = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;"
        " const want = getComputedStyle(document.documentElement).getPropertyValue('--corrected').trim();"
        " const rgb = [1, 3, 5].map(n => parseInt(want.slice(n, n + 2), 16)); let found = 0;"
        " for (let k = 0; k < p.length; k += 4) if (rgb.every((v, n) => Math.abs(p[k + n] - v) < 12)) found++;"
        " return found; })()"
    )
    assert corner > 50


def luminance(colour: str) -> float:
    """Relative luminance of `rgb(r, g, b)`, 0 to 1."""
    parts = [int(part) / 255.0 for part in re.findall(r"\d+", colour)[:3]]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_every_control_has_a_name_and_the_keyboard_reaches_it(shown):
    shown.view(1200, 900)
    unnamed = shown.value(
        "[...document.querySelectorAll('button, a, input, select, canvas.replay, [role=img], svg')].filter(one =>"
        " !(one.getAttribute('aria-label') || one.textContent.trim() || (one.labels || []).length))"
        ".map(one => one.outerHTML)"
    )
    assert unnamed == []
    shown.value("document.querySelector('#run-0').focus()")
    shown.key("ArrowRight")
    assert shown.value("document.activeElement.id") == "run-1"
    assert shown.value(f"{TRACES}.run") == "run01"
    assert shown.value("document.querySelector('#run-1').getAttribute('aria-selected')") == "true"


def test_nothing_is_requested_and_print_is_dark_on_light(shown):
    assert shown.value("performance.getEntriesByType('resource').map(one => one.name)") == []
    shown.view(800, 900, dark=True)
    shown.value("dispatchEvent(new Event('beforeprint'))")
    shown.view(800, 900, dark=True, media="print")
    assert luminance(shown.value("getComputedStyle(document.body).backgroundColor")) > 0.9
    assert luminance(shown.value("getComputedStyle(document.body).color")) < 0.1
    assert shown.value("getComputedStyle(document.querySelector('.bar-of-tools')).display") == "none"
    tabs = shown.value("[...document.querySelectorAll('[role=tab]')].map(one => getComputedStyle(one).display)")
    assert sum(one != "none" for one in tabs) == 1  # the run that is drawn has its name
    wide, box = shown.value(
        "['.plot canvas', '.plot'].map(name => document.querySelector(name).getBoundingClientRect().width)"
    )
    assert wide <= box  # no part of a chart is cut off
    shown.value("dispatchEvent(new Event('afterprint'))")
    shown.view(1200, 900)


def test_a_click_saves_the_mission(shown, folder, tmp_path):
    shown.view(1200, 900)
    shown.command("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    shown.click("a[download]")
    saved, end = tmp_path / "next_run.toml", time.monotonic() + 10.0
    while not saved.is_file() and time.monotonic() < end:
        time.sleep(0.05)
    assert saved.read_text() == (folder.parent / "answer" / "next_run.toml").read_text()


def test_six_runs_of_three_minutes_stay_within_three_megabytes(folder, said, tmp_path):
    """The record's runs drawn out to six of three minutes, at 50 Hz, of noise: no compression helps."""
    record = read_record(folder.parent / "answer")
    rng, rows = np.random.default_rng(5), 9000
    width = record.curves[0].measured.shape[1]
    noise = [rng.normal(size=(rows, width)) for _ in range(4)]
    curves = [Curves(np.arange(rows) / 50.0, *noise[:3], noise[3][:, :3]) for _ in range(6)]
    pictures = [replace(record.details.pictures[0], name=f"run{n:02d}") for n in range(6)]
    details = replace(record.details, pictures=pictures)
    whole = DiagnosisRecord(record.answer, details, curves, record.shown, record.mission)
    page = report_html(whole).encode()
    assert 1_000_000 < len(page) <= MOST_BYTES
    assert report_html(whole).encode() == page


@pytest.mark.skipif(find_spec("foxglove") is None, reason="the extra `live` is not installed")
def test_the_runs_for_foxglove_hold_the_three_poses(folder, said, tmp_path, capsys):
    assert glider("gap", "report", folder.parent / "answer", "--foxglove", tmp_path / "fox") == 0
    paths = [Path(line) for line in capsys.readouterr().out.split()]
    assert [path.name for path in paths] == ["run00.mcap", "run01.mcap", "layout.json"]
    curves = read_record(folder.parent / "answer").curves[1]
    poses: dict[str, list] = {}
    with paths[1].open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert (schema.name, schema.encoding) == ("foxglove.FrameTransform", "protobuf")
            poses.setdefault(channel.topic, []).append((message.log_time, translation(message.data)))
    assert set(poses) == {"/measured", "/nominal", "/corrected"}
    depth, north, east = (ROUGHIE_MEASURES.columns.index(name) for name in ("depth_m", "mocap_x_m", "mocap_y_m"))
    poses_of = [
        depth,
        north,
        east,
        *(ROUGHIE_MEASURES.columns.index(f"{name}_rad") for name in ("roll", "pitch", "yaw")),
    ]
    for topic, found in poses.items():
        table = getattr(curves, topic[1:])
        whole = np.isfinite(table[:, poses_of]).all(axis=1)
        assert whole.sum() > 0.9 * len(curves.t)
        assert [ns / 1e9 for ns, _ in found] == pytest.approx(1.0 + curves.t[whole], abs=1e-6)
        wanted = np.stack([table[:, north], -table[:, east], -table[:, depth]], axis=1)[whole]
        assert np.array([xyz for _, xyz in found]) == pytest.approx(wanted)
    plot = json.loads(paths[2].read_text())["configById"]["Plot!height"]
    assert {path["value"].split(".")[0] for path in plot["paths"]} == set(poses)
    assert glider("gap", "report", folder.parent / "answer", "--foxglove", tmp_path / "fox") == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert str(tmp_path / "fox") in line


def translation(data: bytes) -> list[float]:
    """x, y, z of a FrameTransform: field 4, whose fields 1 to 3 are doubles; 0 is left out."""
    body = fields(data)[4]
    return [struct.unpack("<d", known)[0] if (known := fields(body).get(n)) else 0.0 for n in (1, 2, 3)]


def fields(data: bytes) -> dict[int, bytes]:
    """Fields of a protobuf message by number: doubles and lengths, of less than 128 bytes each."""
    found, at = {}, 0
    while at < len(data):
        number, kind = data[at] >> 3, data[at] & 7
        size, head = (8, 1) if kind == 1 else (data[at + 1], 2)
        found[number] = data[at + head : at + head + size]
        at += head + size
    return found
