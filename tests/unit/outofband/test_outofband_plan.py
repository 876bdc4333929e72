"""The small file written at arming: read back as written, and nothing else is believed."""

import errno
import json
import os
import subprocess
import sys
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from glider.hal.board import BoardRequest, board_builder
from glider.hal.outofband.plan import FORMAT, NumberPlan, PlanError, ReadPlan, read_plan, write_plan
from glider.tools.data.boards import load_board_file
from glider.tools.data.sources import load_vehicle
from glider.tools.flight.ascent_plan import make_plan
from tests.support.examples import examples


@pytest.fixture(scope="module")
def plan():
    file = load_board_file("roughie")
    board = board_builder("devices")(
        BoardRequest(text=file.text, source=file.source, vehicle=load_vehicle("roughie"), water_density=1000.0)
    )
    settings = load_vehicle("roughie").supervisor
    return make_plan(board, flight="sawtooth-001", settings=settings, water_density=1000.0, watchdog="/dev/watchdog")


def test_the_plan_is_what_the_board_file_says(plan):
    pump, slider = plan.axes
    assert (pump.name, pump.id, pump.counts_per_m) == ("pump", 8, 5e6)
    assert (pump.path.address, pump.path.words, pump.path.position) == (0x6200, 8, NumberPlan(1, "i32", 1.0))
    assert pump.status == ReadPlan(function=3, address=0x1003, words=1, number=NumberPlan(0, "u16", 1.0))
    assert pump.position == ReadPlan(function=3, address=0x1014, words=2, number=NumberPlan(0, "i32", 1.0))
    assert (slider.name, slider.id, slider.wire) == ("slider", 7, None)
    assert pump.wire is not None
    assert pump.wire.id == 2
    assert pump.wire.reading == ReadPlan(function=4, address=0, words=8, number=NumberPlan(1, "u16", 1.0))
    area = load_vehicle("roughie").actuators.ballast
    assert pump.end_m == pytest.approx(max(-0.034, area.range[0] / (1000.0 * area.plunger_area)))
    assert slider.end_m == pytest.approx(max(-0.062, load_vehicle("roughie").actuators.slider.range[0]))
    assert pump.end_m < 0.0 > slider.end_m
    assert plan.servo is not None
    assert plan.servo.quarter_us == 6000
    transmitter, settings = plan.pressure, load_vehicle("roughie").supervisor
    assert transmitter is not None
    assert transmitter.id == 1
    assert transmitter.reading == ReadPlan(function=3, address=0x0100, words=2, number=NumberPlan(0, "f32", 1e5))  # bar
    assert transmitter.pa_per_m == pytest.approx(9806.65)
    assert (transmitter.patience_s, transmitter.step_m) == (settings.no_ascent_s, settings.ascent_step_m)
    assert [axis.last_m for axis in plan.axes] == [-0.034, -0.062]
    # A broken wire reads below 3.8 mA: what is not believed begins there.
    assert pump.wire.low_m == pytest.approx(max(-0.045, (3800 - 12000) / 160000))


def test_it_reads_back_as_written(plan, tmp_path):
    write_plan(tmp_path / "deep" / "plan.json", plan)
    assert read_plan(tmp_path / "deep" / "plan.json") == plan
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["plan.json"]


def test_cut_anywhere_or_with_a_flipped_bit_it_is_refused(plan, tmp_path):
    path = tmp_path / "plan.json"
    write_plan(path, plan)
    whole = path.read_bytes()
    for place in range(0, len(whole) - 1, 7):  # without its last newline it is whole
        path.write_bytes(whole[:place])
        with pytest.raises(PlanError):
            read_plan(path)
    refused = 0
    places = range(0, len(whole) - 1, 7)
    for place in places:
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        try:
            assert read_plan(path) == plan  # a bit of white space
        except PlanError:
            refused += 1
    assert refused > 0.99 * len(places)


@pytest.mark.parametrize(
    "change",
    [
        lambda table: table.update(axes=[]),
        lambda table: table.pop("servo"),
        lambda table: table.update(extra=1),
        lambda table: table["axes"][0].update(counts_per_m=0.0),
        lambda table: table["axes"][0].update(id="8"),
        lambda table: table["axes"][0].update(id=True),
        lambda table: table["axes"][0].update(end_m=float("nan")),
        lambda table: table["axes"][0].update(end_m=float("inf")),
        lambda table: table["axes"][0]["wire"].update(per_m=0.0),
        lambda table: table["axes"][0].update(wire=[]),
        lambda table: table.update(axes=None),
        lambda table: table["pressure"]["reading"]["number"].update(kind="f64"),
        lambda table: table["pressure"]["reading"]["number"].update(at=1),
        lambda table: table["pressure"]["reading"]["number"].update(at=-1),
        lambda table: table["pressure"]["reading"]["number"].update(step=0.0),
        lambda table: table["pressure"]["reading"].update(words=70_000),
        lambda table: table["pressure"]["reading"].update(address=-1),
        lambda table: table["pressure"].update(reading=None),
        lambda table: table["axes"][0]["status"]["number"].update(kind="f32"),
        lambda table: table["axes"][0]["path"].update(words=9),
        lambda table: table["axes"][0]["path"]["speed"].update(at=4),
        lambda table: table["axes"][0]["path"]["trigger"].update(kind="u32"),
        lambda table: table["axes"][0]["path"].pop("pause"),
        lambda table: table["pressure"].update(pa_per_m=0.0),
        lambda table: table["pressure"].update(patience_s=-1.0),
        lambda table: table["pressure"].pop("zero_pa"),
    ],
)
def test_what_makes_no_sense_is_refused_though_its_sum_is_right(plan, tmp_path, change):
    path = tmp_path / "plan.json"
    write_plan(path, plan)
    table = json.loads(json.loads(path.read_text())["plan"])
    change(table)
    body = json.dumps(table)
    path.write_text(json.dumps({"format": FORMAT, "crc32": f"{zlib.crc32(body.encode()):08x}", "plan": body}))
    with pytest.raises(PlanError, match=r"plan\.json: "):
        read_plan(path)


def test_a_plan_of_another_release_is_called_that(plan, tmp_path):
    path = tmp_path / "plan.json"
    write_plan(path, plan)
    path.write_text(path.read_text().replace(f'"format": {FORMAT}', '"format": 2'))
    with pytest.raises(PlanError, match=r"plan\.json: format 2, expected 3"):
        read_plan(path)


@examples(200)
@given(data=st.binary(max_size=300) | st.recursive(st.none() | st.integers() | st.text(), st.lists).map(
    lambda value: json.dumps(value).encode()))  # fmt: skip
def test_any_bytes_are_refused_in_one_line(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "any.json"
    path.write_bytes(data)
    with pytest.raises(PlanError):
        read_plan(path)


def test_a_missing_or_endless_file_is_refused(tmp_path):
    with pytest.raises(PlanError, match=os.strerror(errno.ENOENT)):
        read_plan(tmp_path / "none.json")
    (tmp_path / "long.json").write_bytes(b"[" * 1_000_000)
    with pytest.raises(PlanError, match="too long"):
        read_plan(tmp_path / "long.json")


def test_the_process_loads_the_standard_library_and_pyserial_alone():
    code = "import sys, glider.hal.outofband.guard; print(*sorted({m.split('.')[0] for m in sys.modules}))"
    done = subprocess.run([sys.executable, "-S", "-c", PATHS + code], capture_output=True, check=True, text=True)
    loaded = set(done.stdout.split())
    assert loaded - set(sys.stdlib_module_names) <= {"__main__", "glider", "serial", "sitecustomize"}
    mine = (
        "import sys, glider.hal.outofband.guard; print(*sorted(m for m in sys.modules if m.startswith('glider.hal.')))"
    )
    done = subprocess.run([sys.executable, "-c", mine], capture_output=True, check=True, text=True)
    wanted = {f"glider.hal.{name}" for name in ("heartbeat", "notify", "realtime", "sortie", "state_file")}
    assert {name for name in done.stdout.split() if not name.startswith("glider.hal.outofband")} == wanted


PATHS = f"import sys; sys.path[:] = {sys.path!r}; "
