"""Programs that stand in strings, started as processes of their own: what they import and name is there."""

import ast
import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NO_PROGRAM = ("tests/unit/core/test_layouts.py", "tests/unit/test_scripts.py")  # text for a rule, not run


def programs(path: Path) -> list[ast.Module]:
    """Parse the strings of a file that are Python and import this project."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and "import" in node.value:
            if "glider." not in node.value:
                continue
            try:
                found.append(ast.parse(node.value))
            except SyntaxError:
                continue
    return found


def missing_names(program: ast.Module) -> list[str]:
    """List imports, and attributes of what is imported, that do not exist."""
    missing, known = [], {}
    for node in ast.walk(program):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("glider"):
            for name in node.names:
                whole = f"{node.module}.{name.name}"
                try:
                    module = importlib.import_module(str(node.module))
                    known[name.asname or name.name] = (
                        getattr(module, name.name) if hasattr(module, name.name) else importlib.import_module(whole)
                    )
                except ModuleNotFoundError:
                    missing.append(whole)
    for node in ast.walk(program):
        owner = known.get(getattr(getattr(node, "value", None), "id", "")) if isinstance(node, ast.Attribute) else None
        if owner is not None and not hasattr(owner, node.attr):
            missing.append(f"{node.value.id}.{node.attr}")
    return missing


@pytest.mark.parametrize("room", ["firmware", "hal", "sim_backend", "tools", "tests"])
def test_programs_in_strings_name_what_is_there(room):
    wrong = {
        str(path.relative_to(ROOT)): missing
        for path in sorted((ROOT / room).rglob("*.py"))
        if str(path.relative_to(ROOT)) not in NO_PROGRAM
        for program in programs(path)
        if (missing := missing_names(program))
    }
    assert wrong == {}


def test_a_name_that_is_gone_is_seen():
    text = "from glider.hal import heartbeat as hb\nfrom glider.hal.sortie import Gone\nhb.Heartbeat\nhb.State\n"
    assert missing_names(ast.parse(text)) == ["glider.hal.sortie.Gone", "hb.State"]
