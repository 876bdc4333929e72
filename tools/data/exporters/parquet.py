"""A case's runs as Parquet, a file a run: columns of float64 with their units, the case in the files' metadata."""

from pathlib import Path

import numpy as np

from glider.tools.data.errors import InputError, need
from glider.tools.data.files import whole
from glider.tools.data.runs.case import CASE_FILE, load_runs
from glider.tools.data.runs.overview import overview
from glider.tools.data.sources import read_text


def export_parquet(folder: Path, out: Path) -> list[Path]:
    """Write the runs of a case into a folder, run00.parquet on; a missing sample is null. Returns the files.

    InputError where the folder holds no case, or `out` holds such a file already.
    """
    need("parquet", "pyarrow")
    import pyarrow
    from pyarrow import parquet

    _, runs = load_runs(folder)
    files = [out / f"{run.name}.parquet" for run in runs]
    for file in files:
        if file.exists():
            raise InputError("is there already: name another folder", source=file)
    out.mkdir(parents=True, exist_ok=True)
    with whole(*files) as temporary:
        for run, path in zip(runs, temporary, strict=True):
            units = {one.name: one.unit for one in overview([run])}
            arrays = [pyarrow.array(values, mask=np.isnan(values)) for values in run.columns.values()]
            fields = [pyarrow.field(name, pyarrow.float64(), metadata={"unit": units[name]}) for name in run.columns]
            arrays += [pyarrow.array(texts) for texts in run.extra.values()]
            fields += [pyarrow.field(name, pyarrow.string()) for name in run.extra]
            about = {"run": run.name, "flight": run.flight, CASE_FILE: read_text(folder / CASE_FILE)}
            parquet.write_table(pyarrow.table(arrays, schema=pyarrow.schema(fields, metadata=about)), path)
    return files
