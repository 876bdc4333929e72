"""A flight through real drivers, wires and twins at real time: as the same seed in simulation, its log as any other."""

import sys

import pytest

from glider.tools.data.log.reader import read_log
from glider.tools.data.log.rundata import export_case
from glider.tools.verify.figures.devices import ATTITUDE_LIMIT_DEG, POSITION_LIMIT_M, compare_flights
from tests.support.logs import DIP
from tests.support.patience import patient_vehicle

pytestmark = pytest.mark.realtime


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flight")
    (folder / "dip.toml").write_text(DIP)
    return folder, compare_flights(str(folder / "dip.toml"), 7, folder, vehicle=str(patient_vehicle(folder)))


def test_it_ends_where_the_same_seed_ends_in_simulation(flown):
    _, result = flown
    assert result["completed"]
    assert result["end_apart_m"] < POSITION_LIMIT_M
    assert result["attitude_rms_deg"]["flying"] < ATTITUDE_LIMIT_DEG


def test_its_log_exports_like_any_other(flown):
    folder, _ = flown
    log = read_log(folder / "twin.mcap")
    assert log.whole
    assert set(log.topics) >= {"/tick"}
    assert 'kind = "twin"' in log.attachments["board.toml"]
    exported = export_case(log, folder / "case")
    columns = exported.run.columns
    assert {"cmd_slider_m", "slider_m", "ballast_kg", "pitch_rad", "depth_m"} <= set(columns)
    assert exported.run.rows == log.topics["/tick"].count


def test_a_tick_on_devices_gains_no_memory():
    """Over a thousand ticks on the twin the interpreter's blocks do not grow; reads and commands make nothing."""
    import tracemalloc

    from glider.hal.board import BoardRequest, board_builder
    from glider.hal.ports import SLOTS, empty_frame
    from glider.tools.data.boards import load_board_file
    from glider.tools.data.sources import load_vehicle

    file = load_board_file("twin")
    board = board_builder("twin")(BoardRequest(text=file.text, source=file.source, vehicle=load_vehicle("roughie")))
    board.open()
    try:
        frame = empty_frame()
        reads = [(getattr(board, name).read, frame[slot.all]) for name, slot in SLOTS.items()]
        sends = [board.servo.command, board.slider.command, board.ballast.command]

        def ticks(count):
            for _ in range(count):
                board.serve(board.clock._start + board.clock.now() + 0.01)
                for read, slot in reads:
                    read(slot)
                for send in sends:
                    send(0.01)

        ticks(300)
        before = sys.getallocatedblocks()
        ticks(700)
        assert sys.getallocatedblocks() - before < 300
        tracemalloc.start()
        for read, slot in reads:
            read(slot)
        for send in sends:
            send(0.01)
        tracemalloc.reset_peak()
        base = tracemalloc.get_traced_memory()[0]
        for read, slot in reads:
            read(slot)
        for send in sends:
            send(0.01)
        assert tracemalloc.get_traced_memory()[1] - base < 200  # a few boxed numbers
        tracemalloc.stop()
    finally:
        board.close()


def test_a_board_that_does_not_arm_says_why_in_a_line_and_leaves_no_log(tmp_path):
    """The example is nobody's vehicle: nobody has looked its calibration through."""
    import subprocess

    command = [sys.executable, "-m", "glider.tools.cli.main", "fly", "--board", "roughie", "--yes"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 1
    assert "not armed: roughie " in done.stderr
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []
