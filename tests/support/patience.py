"""The shipped vehicle, which bears with a busy machine: late ticks (row 24) do not end its flights."""

from pathlib import Path

from tools.data.sources import name_or_path


def patient_vehicle(folder: Path) -> Path:
    """A vehicle file in a folder: overruns are logged, and abort nothing but a loop that never is on time."""
    text, _ = name_or_path("roughie", "vehicle", "model/vehicles")
    assert "[supervisor]" not in text
    path = folder / "patient.toml"
    path.write_text(f"{text}\n[supervisor]\noverruns = 1000\noverrun_share = 1.0\n")
    return path
