"""The test is blind: its making reaches neither the catalogue's effects nor the diagnosis, and no study a command."""

import ast
import subprocess
import sys
from pathlib import Path

import glider.tools.study

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
    names = [f"glider.tools.study.challenge.{name}" for name in BLIND]
    script = f"import sys, {', '.join(names)}; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    assert set(names) <= set(loaded)
    assert [name for name in loaded if name.startswith(FORBIDDEN)] == []


def imported(path: Path) -> set[str]:
    """Every module that a file imports, anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


def test_no_study_imports_a_command():
    files = sorted(Path(glider.tools.study.__path__[0]).rglob("*.py"))
    assert len(files) > 30
    assert [path.name for path in files if any(name.startswith("glider.tools.cli") for name in imported(path))] == []
