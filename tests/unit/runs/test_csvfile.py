"""Run files in and out: every complaint names file, line and column; what was written reads back bit for bit."""

import csv
import gzip
import math
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glider.tools.data.errors import InputError
from glider.tools.data.runs import columns as names
from glider.tools.data.runs import csvfile
from glider.tools.data.runs.run import Run, load_run, write_run
from tests.support.examples import examples

GOOD = "t_s,depth_m,note\n0.0,1.0,a\n0.1,,b\n0.2,3,c\n"


def test_known_columns_are_numbers_and_the_others_text(tmp_path):
    path = tmp_path / "run00.csv"
    path.write_text(GOOD)
    run = load_run(path)
    assert (run.name, run.rows) == ("run00", 3)
    np.testing.assert_array_equal(run.columns["depth_m"], [1.0, np.nan, 3.0])
    assert run.extra == {"note": ["a", "b", "c"]}
    assert run.has("t_s", "depth_m")
    assert not run.has("depth_m", "yaw_rad")
    assert not run.has_commands
    assert not run.has_mocap


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "run.csv: "),
        ("t_s,depth_m\n", "run.csv: no samples"),
        ("depth_m\n1\n", "run.csv: t_s: "),
        ("t_s,depth_m,depth_m\n0,1,1\n", "run.csv:1: depth_m: "),
        ("t_s,depth_m\n0,1\n1,x\n", "run.csv:3: depth_m: "),
        ("t_s,depth_m\n0,1\n1,1_0\n", "run.csv:3: depth_m: "),
        ("t_s,depth_m\n0,1\n1,١\n", "run.csv:3: depth_m: "),
        ("t_s,depth_m\n0,1\n1,nan\n", "run.csv:3: depth_m: "),
        ("t_s,depth_m\n0,1\n1,null\n", "run.csv:3: depth_m: "),
        ("t_s,depth_m\n0,1\n1,inf\n", "run.csv:3: depth_m: infinite"),
        ("t_s,depth_m\n0,1\n1,1e999\n", "run.csv:3: depth_m: infinite"),
        ("t_s,depth_m\n0,1\n1\n", "run.csv:3: too few fields: expected 2, got 1"),
        ("t_s,depth_m\n0,1\n1,2,3\n", "run.csv:3: too many fields"),
        ("t_s,depth_m\n0,1\n\n1,2\n", "run.csv:3: too few fields"),
        ("t_s,depth_m\n0,1\n,2\n", "run.csv:3: t_s: "),
        ("t_s,depth_m\n0,1\n1,2\n1,2\n", "run.csv:4: t_s: not increasing: 1.0 after 1.0"),
        ('t_s,note,depth_m\n0,"two\nlines",1\n1,b,x\n', "run.csv:4: depth_m: "),
        ('t_s,note\n0,"a"b\n', "run.csv:2: not CSV"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path, text, said):
    path = tmp_path / "run.csv"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        load_run(path)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_not_utf8_not_gzip_cut_gzip_no_file(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"t_s,depth_m\n0,1\n\xff,2\n")
    (tmp_path / "b.csv.gz").write_bytes(b"not gzip at all")
    (tmp_path / "c.csv.gz").write_bytes(gzip.compress(GOOD.encode())[:-12])
    packed = bytearray(gzip.compress((GOOD * 50).encode()))
    packed[40] ^= 0xFF
    (tmp_path / "d.csv.gz").write_bytes(bytes(packed))
    for name, said in [
        ("a.csv", ":3: not UTF-8"),
        ("b.csv.gz", "damaged gzip"),
        ("c.csv.gz", "damaged gzip"),
        ("d.csv.gz", "damaged gzip"),
        ("e.csv", "No such file"),
    ]:
        with pytest.raises(InputError, match=said):
            load_run(tmp_path / name)


def test_a_file_too_long_is_refused_however_well_it_is_packed(tmp_path, monkeypatch):
    monkeypatch.setattr(csvfile, "MAX_BYTES", 1000)
    path = tmp_path / "run00.csv.gz"
    path.write_bytes(gzip.compress(b"t_s\n" + b"0" * 1_000_000))
    with pytest.raises(InputError, match="longer than"):
        load_run(path)


@pytest.mark.parametrize("variant", [GOOD.replace("\n", "\r\n"), "\ufeff" + GOOD, GOOD + "\n\n", GOOD.rstrip("\n")])
def test_line_ends_and_byte_order_marks_do_not_matter(tmp_path, variant):
    path = tmp_path / "run00.csv"
    path.write_bytes(variant.encode())
    np.testing.assert_array_equal(load_run(path).columns["depth_m"], [1.0, np.nan, 3.0])


@pytest.mark.parametrize("text", [".5", "5.", "+1", "01", " 1 ", "1E3", "-0.0", "1e-400", "123456789012345678901234"])
def test_numbers_are_read_as_python_reads_them(tmp_path, text):
    path = tmp_path / "run00.csv"
    path.write_text(f"t_s,depth_m\n0,{text}\n")
    assert load_run(path).columns["depth_m"].tobytes() == np.array([float(text)]).tobytes()


numbers = st.one_of(st.floats(allow_infinity=False, allow_nan=False), st.just(math.nan), st.just(-0.0))
texts = st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=8)


@st.composite
def runs(draw):
    rows = draw(st.integers(1, 6))
    steps = draw(st.lists(st.floats(1e-3, 1e3), min_size=rows, max_size=rows))
    columns = {names.TIME: np.cumsum(steps)}
    for name in draw(st.lists(st.sampled_from(names.ALL[1:]), unique=True, max_size=5)):
        columns[name] = np.array(draw(st.lists(numbers, min_size=rows, max_size=rows)))
    free = texts.map(str.strip).filter(lambda name: name not in names.KNOWN and not name.startswith("\ufeff"))
    extra = {
        name: draw(st.lists(texts, min_size=rows, max_size=rows))
        for name in draw(st.lists(free, unique=True, max_size=2))
    }
    return Run("run00", None, columns, extra)


@examples(150)
@given(run=runs(), packed=st.booleans())
def test_what_is_written_reads_back_bit_for_bit(tmp_path_factory, run, packed):
    path = tmp_path_factory.mktemp("runs") / ("run00.csv.gz" if packed else "run00.csv")
    write_run(path, run)
    again = load_run(path)
    assert list(again.columns) == list(run.columns)
    for name, values in run.columns.items():
        np.testing.assert_array_equal(np.isnan(again.columns[name]), np.isnan(values))
        there = ~np.isnan(values)
        assert again.columns[name][there].tobytes() == values[there].tobytes()
    assert again.extra == run.extra


def test_decimals_round_only_the_columns_named(tmp_path):
    path = tmp_path / "run00.csv"
    columns = {"t_s": np.array([0.0]), "depth_m": np.array([1 / 3]), "yaw_rad": np.array([1 / 3])}
    write_run(path, Run("run00", None, columns), decimals={"depth_m": 2})
    assert path.read_text() == f"t_s,depth_m,yaw_rad\n0.0,0.33,{1 / 3!r}\n"


def test_writing_refuses_what_could_not_be_read(tmp_path):
    t = np.array([0.0, 1.0])
    with pytest.raises(ValueError, match="infinite"):
        write_run(tmp_path / "a.csv", Run("a", None, {"t_s": t, "depth_m": np.array([0.0, np.inf])}))
    with pytest.raises(ValueError, match="unequal"):
        write_run(tmp_path / "a.csv", Run("a", None, {"t_s": t, "depth_m": np.zeros(3)}))
    with pytest.raises(ValueError, match="twice"):
        write_run(tmp_path / "a.csv", Run("a", None, {"t_s": t}, {"t_s": ["0", "1"]}))
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "run00.csv"
    path.mkdir()  # os.replace cannot put a file over a folder
    with pytest.raises(OSError, match="directory"):
        write_run(path, Run("run00", None, {"t_s": np.array([0.0])}))
    assert list(tmp_path.iterdir()) == [path]


def test_equal_runs_are_equal_files(tmp_path):
    run = Run("run00", None, {"t_s": np.arange(5.0)})
    for name in ("a.csv.gz", "b.csv.gz"):
        write_run(tmp_path / name, run)
    assert (tmp_path / "a.csv.gz").read_bytes() == (tmp_path / "b.csv.gz").read_bytes()


def test_ten_thousand_rows_read_quickly(tmp_path):
    rng = np.random.default_rng(1)
    columns = {name: np.round(rng.normal(size=10_000), 5) for name in names.ALL[:13]}
    columns["t_s"] = np.arange(10_000) * 0.1
    path = tmp_path / "run00.csv"
    write_run(path, Run("run00", None, columns))

    def plainly():
        with path.open(newline="") as file:
            rows = csv.reader(file)
            next(rows)
            return [[float(text) for text in row] for row in rows]

    def processor_seconds(read):
        start = time.process_time()
        read()
        return time.process_time() - start

    # in turns: strict reading takes no more than a few times as long as the plainest
    pairs = [(processor_seconds(lambda: load_run(path)), processor_seconds(plainly)) for _ in range(5)]
    assert min(strict for strict, _ in pairs) < 3.0 * min(plain for _, plain in pairs)
