"""The test is blind: its making reaches neither the catalogue's effects nor the diagnosis."""

import subprocess
import sys

BLIND = (
    "make", "plan", "forms", "cases", "trial", "design", "magnitude", "messy", "evidence", "seal",
    "form_make", "form_plan", "form_cases", "form_fit", "form_vehicle",
)  # fmt: skip
FORBIDDEN = (
    "glider.sim_backend.core.effects",
    "glider.sim_backend.core.effect",
    "glider.tools.diagnose",
    "glider.tools.identify",
    "glider.tools.cli",
)


def test_what_makes_the_cases_never_sees_effects_or_diagnosis():
    names = [f"glider.tools.verify.challenge.{name}" for name in BLIND]
    script = f"import sys, {', '.join(names)}; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    assert set(names) <= set(loaded)
    assert [name for name in loaded if name.startswith(FORBIDDEN)] == []
