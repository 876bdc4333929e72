"""Layout modules: a name has one value wherever it stands, and a layout one alias.

A slip between two layouts compiles and flies. A layout is a module called so, a module that numbers three places or
more in a row (`A, B, C = 0, 1, 2`), one that the glossary lists, or the frame of hal.ports.
"""

import ast
import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
ROOMS = ("firmware", "sim_backend", "tools")
FILES = sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py"))
TREES = {path: ast.parse(path.read_text()) for path in (*FILES, *sorted((ROOT / "tests").rglob("*.py")))}


def module_name(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


def numbers_a_row(statement: ast.stmt) -> bool:
    """Whether it is `A, B, C = 0, 1, 2` or `A, B, C = range(3)`, in capitals."""
    if not (isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Tuple)):
        return False
    names, value = statement.targets[0].elts, statement.value
    if len(names) < 3 or not all(isinstance(name, ast.Name) and name.id.isupper() for name in names):
        return False
    if isinstance(value, ast.Call):
        return isinstance(value.func, ast.Name) and value.func.id == "range"
    numbers = [e.value if isinstance(e, ast.Constant) else None for e in getattr(value, "elts", ())]
    return numbers == list(range(len(names)))


def is_layout(path: Path) -> bool:
    return "layout" in path.stem or any(numbers_a_row(statement) for statement in TREES[path].body)


def places(module: str) -> dict[str, float]:
    """The numbers of a module that stand under names in capitals."""
    return {
        name: float(value)
        for name, value in vars(importlib.import_module(module)).items()
        if name.isupper() and isinstance(value, int | float)
    }


def aliases() -> dict[str, str]:
    """Module by alias, from the glossary."""
    rows = re.findall(r"^\| `(\w+)` \| `([\w.]+)` \|", (ROOT / "docs" / "GLOSSARY.md").read_text(), re.MULTILINE)
    return {module: alias for alias, module in rows}


LAYOUTS = sorted({*(module_name(path) for path in FILES if is_layout(path)), *aliases(), "hal.ports"})


def test_the_rule_finds_the_layouts():
    assert {"firmware.core.vehicle.layout", "sim_backend.core.layout", "tools.study.tuning.loops"} <= {*LAYOUTS}
    assert len(LAYOUTS) > 8


def test_a_name_has_one_value():
    values: dict[str, dict[float, list[str]]] = {}
    for module in LAYOUTS:
        for name, value in places(module).items():
            values.setdefault(name, {}).setdefault(value, []).append(module)
    assert {name: by_value for name, by_value in values.items() if len(by_value) > 1} == {}


@pytest.mark.parametrize("room", [*ROOMS, "tests"])
def test_a_layout_has_one_alias(room):
    known = aliases()
    assert len(known) >= 8
    other = [
        (str(path.relative_to(ROOT)), name.asname or name.name)
        for path, tree in TREES.items()
        if path.relative_to(ROOT).parts[0] == room
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for name in node.names
        if (name.asname or name.name) != known.get(f"{node.module}.{name.name}", name.asname or name.name)
    ]
    assert other == []


def bare_fault_rows(tree: ast.AST) -> list[str]:
    """Rows of the fault table by number: `ASKED + 24`, `ask(G, 24, ...)`, `Case(24, ...)`, `worst(24)`."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.BinOp) and isinstance(node.left, ast.Attribute):
            row = node.right if node.left.attr in ("ASKED", "ENABLED", "FIRST", "WORST") else None
        elif isinstance(node, ast.Call) and node.args:
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            place = {"ask": 1, "Case": 0, "Show": 0, "worst": 0, "noticed": 0, "disable": 0}.get(name, len(node.args))
            row = node.args[place] if place < len(node.args) else None
        else:
            continue
        if isinstance(row, ast.Constant) and isinstance(row.value, int):
            found.append(ast.unparse(node))
    return found


def test_rows_of_the_fault_table_have_names():
    assert bare_fault_rows(ast.parse("G[sup.ASKED + 24]; ask(G, 1, sup.LOG); man.worst(2)")) != []
    assert {str(path): rows for path in FILES if (rows := bare_fault_rows(TREES[path]))} == {}


# Kernels in which a place in a state is still a number.
NUMBERED = {
    "sim_backend/core/closed_loop.py",
    "sim_backend/core/effect_plant.py",
    "sim_backend/core/effect_world.py",
    "sim_backend/core/world.py",
    "tools/inference/core/filter.py",
    "tools/inference/core/lacking.py",
    "tools/inference/core/step.py",
}


def literal_state_indices(tree: ast.AST) -> list[str]:
    """Subscripts of a state x, or of rows X of states, by a bare number: `x[7]`, `X[:, 13]`, `x[3:7]`."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name) and node.value.id in ("x", "X"):
            parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
            ends = [
                end for part in parts for end in ((part.lower, part.upper) if isinstance(part, ast.Slice) else (part,))
            ]
            if any(isinstance(end, ast.Constant) and isinstance(end.value, int) for end in ends):
                found.append(ast.unparse(node))
    return found


@pytest.mark.parametrize("room", ["firmware/core", "sim_backend/core", "tools/inference/core"])
def test_states_are_indexed_by_name(room):
    assert literal_state_indices(ast.parse("x[7], X[:, 13], x[3:7], x[X_NU], x[i]")) == ["x[7]", "X[:, 13]", "x[3:7]"]
    numbered = {path.relative_to(ROOT).as_posix() for path in FILES if literal_state_indices(TREES[path])}
    assert {path for path in numbered if path.startswith(room)} <= NUMBERED
