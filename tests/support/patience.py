"""The shipped vehicle, which bears with a busy machine: late ticks and twins that had to wait end no flight of it."""

from pathlib import Path

from glider.tools.data.sources import name_or_path

PATIENT = """overruns = 1000
overrun_share = 1.0
imu_s = 4.0
pressure_s = 4.0
wire_s = 4.0
actuator_s = 4.0
"""


def patient_vehicle(folder: Path) -> Path:
    """A vehicle file in a folder: overruns (row 24) are logged, and abort nothing but a loop that never is on time;
    devices (rows 1 to 4) may be silent for seconds, which the process of their twins may be kept waiting for."""
    text, _ = name_or_path("roughie", "vehicle", "model/vehicles")
    assert "[supervisor]" not in text
    path = folder / "patient.toml"
    path.write_text(f"{text}\n[supervisor]\n{PATIENT}")
    return path
