"""Runs as Parquet hold the runs' numbers exactly, with units, gaps as nulls and the case in their metadata."""

import numpy as np
import pytest

from glider.tools.data.errors import InputError
from glider.tools.data.exporters.parquet import export_parquet
from glider.tools.data.runs.case import write_case
from glider.tools.data.runs.run import Run

parquet = pytest.importorskip("pyarrow.parquet")


def test_a_case_s_runs_are_written_exactly(tmp_path):
    t = np.arange(50) / 10.0
    depth = np.where(t > 2.0, np.nan, 1.0 + np.sqrt(t))
    run = Run("run00", None, {"t_s": t, "depth_m": depth}, {"note": [f"n{n}" for n in range(50)]}, "a.mcap")
    write_case(tmp_path / "case", [run, run], vehicle="roughie", site="lake", log_rate_hz=10.0,
               water_density_kg_m3=998.0)  # fmt: skip
    files = export_parquet(tmp_path / "case", tmp_path / "out")
    assert [file.name for file in files] == ["run00.parquet", "run01.parquet"]
    table = parquet.read_table(files[1])
    assert table.schema.names == ["t_s", "depth_m", "note"]
    assert table.schema.field("depth_m").metadata == {b"unit": b"m"}
    assert np.array_equal(table["depth_m"].to_numpy(), depth, equal_nan=True)
    assert table["depth_m"].null_count == np.isnan(depth).sum()
    assert b'site = "lake"' in table.schema.metadata[b"case.toml"]
    assert table.schema.metadata[b"flight"] == b"a.mcap"
    with pytest.raises(InputError, match="already"):
        export_parquet(tmp_path / "case", tmp_path / "out")
