"""The drawn runs of a diagnosis for Foxglove: measured, nominal and corrected poses in MCAP, and a layout."""

import io
from importlib.resources import files
from pathlib import Path

import numpy as np

from glider.hal.recorder.logfile import start_writer
from glider.tools.data.errors import InputError
from glider.tools.data.files import write_files
from glider.tools.data.runs.columns import ATTITUDE, DEPTH, MOCAP_POSITION
from glider.tools.diagnose.record import TABLES, Curves, read_record
from glider.tools.flight.live_view import body_in_world
from glider.tools.inference.channels import ROUGHIE_MEASURES

LAYOUT = "layout.json"
PLACES = [ROUGHIE_MEASURES.columns.index(name) for name in (*MOCAP_POSITION[:2], DEPTH, *ATTITUDE)]
FIRST_NS = 10**9  # of a run's second 0: some readers take a time of 0 for none


def run_mcap(curves: Curves) -> bytes:
    """One run as MCAP: topics /measured, /nominal, /corrected, a foxglove.FrameTransform for each sample.

    A sample that lacks one of the recorded columns has none. A column that the run never recorded is 0 for all three.
    """
    from foxglove.messages import FrameTransform

    seen = np.isfinite(curves.measured).any(axis=0)
    kind, stream = FrameTransform.get_schema(), io.BytesIO()
    writer = start_writer(stream, profile="")
    schema = writer.register_schema(kind.name, kind.encoding, kind.data)
    channels = {name: writer.register_channel(f"/{name}", "protobuf", schema) for name in TABLES}
    poses = {name: np.where(seen[PLACES], getattr(curves, name)[:, PLACES], 0.0) for name in TABLES}
    for row, t in enumerate(curves.t.tolist()):
        ns = FIRST_NS + round(t * 1e9)
        for name in TABLES:
            pose = poses[name][row]
            if np.isfinite(pose).all():
                data = body_in_world(ns, name, *pose.tolist()).encode()
                writer.add_message(channels[name], ns, data, ns, row)
    writer.finish()
    return stream.getvalue()


def write_foxglove(folder: Path, out: Path) -> list[Path]:
    """Write the runs of a diagnosis and a layout into a folder; their paths. InputError where one is there already."""
    record = read_record(folder)
    found = {
        out / f"{picture.name}.mcap": run_mcap(curves)
        for picture, curves in zip(record.details.pictures, record.curves, strict=True)
    }
    layout = files("glider.tools.report").joinpath("foxglove_layout.json").read_text(encoding="utf-8")
    found[out / LAYOUT] = layout.encode("utf-8")
    for path in found:
        if path.exists():
            raise InputError("is there already", source=path)
    out.mkdir(parents=True, exist_ok=True)
    write_files(found)
    return list(found)
