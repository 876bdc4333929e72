"""Layout modules: a name has one value wherever it stands, and a layout one alias.

A slip between two layouts compiles and flies. A layout is a module called so, a module that numbers three places or
more in a row (`A, B, C = 0, 1, 2`), one that the glossary lists, or the frame of glider.hal.ports.
"""

import ast
import importlib
import re
from functools import cache
from pathlib import Path

import pytest

from glider.firmware.core.layouts import estimator_layout as kf
from glider.firmware.core.layouts.cursor import Cursor
from glider.firmware.core.vehicle import layout
from glider.sim_backend.core import layout as wl
from glider.sim_backend.core.effects import effect_layout as ef

ROOT = Path(__file__).resolve().parents[3]
ROOMS = ("firmware", "sim_backend", "tools")
FILES = sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py"))
TESTS = sorted((ROOT / "tests").rglob("*.py"))


@cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


def module_name(path: Path) -> str:
    return "glider." + ".".join(path.relative_to(ROOT).with_suffix("").parts)


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
    return "layout" in path.stem or any(numbers_a_row(statement) for statement in tree_of(path).body)


def places(module: str) -> dict[str, float]:
    """The numbers of a module that stand under names in capitals."""
    return {
        name: float(value)
        for name, value in vars(importlib.import_module(module)).items()
        if name.isupper() and isinstance(value, int | float)
    }


def aliases() -> dict[str, str]:
    """Module by alias, from the glossary."""
    rows = re.findall(
        r"^\| `(\w+)` \| `([\w.]+)` \|", (ROOT / "docs" / "reference" / "glossary.md").read_text(), re.MULTILINE
    )
    return {module: alias for alias, module in rows}


@cache
def layouts() -> list[str]:
    """Names of the layout modules."""
    return sorted({*(module_name(path) for path in FILES if is_layout(path)), *aliases(), "glider.hal.ports"})


def test_the_rule_finds_the_layouts():
    assert {
        "glider.firmware.core.vehicle.layout",
        "glider.sim_backend.core.layout",
        "glider.tools.study.tuning.loops",
    } <= {*layouts()}
    assert len(layouts()) > 8


# Vectors of other vehicles, each in layouts of its own: a name has another meaning there.
OTHERS = {
    "glider.sim_backend.ocean.core.layout": "ocean", "glider.sim_backend.foreign.ocean": "foreign ocean",
    "glider.tools.verify.challenge.ocean_design": "foreign ocean",
}  # fmt: skip


def test_a_name_has_one_value():
    values: dict[tuple[str, str], dict[float, list[str]]] = {}
    for module in layouts():
        for name, value in places(module).items():
            values.setdefault((OTHERS.get(module, ""), name), {}).setdefault(value, []).append(module)
    assert {name: by_value for name, by_value in values.items() if len(by_value) > 1} == {}


def layouts_named_from(tree: ast.AST) -> set[str]:
    """The vehicles from whose layouts a module takes bare names in capitals."""
    return {
        OTHERS.get(str(node.module), "")
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module in layouts()
        if any(name.name.isupper() for name in node.names)
    }


def test_no_module_takes_names_from_the_layouts_of_two_vehicles():
    text = "from glider.sim_backend.ocean.core.layout import N_P\nfrom glider.firmware.core.vehicle.layout import N_F"
    assert layouts_named_from(ast.parse(text)) == {"ocean", ""}
    assert [str(path) for path in FILES if len(layouts_named_from(tree_of(path))) > 1] == []


@pytest.mark.parametrize("room", [*ROOMS, "tests"])
def test_a_layout_has_one_alias(room):
    known = aliases()
    assert len(known) >= 8
    other = [
        (str(path.relative_to(ROOT)), name.asname or name.name)
        for path in (*FILES, *TESTS)
        if path.relative_to(ROOT).parts[0] == room
        if any(module.rpartition(".")[2] in path.read_text() for module in known)  # else there is nothing to parse for
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.ImportFrom)
        for name in node.names
        if (name.asname or name.name) != known.get(f"{node.module}.{name.name}", name.asname or name.name)
    ]
    assert other == []


def bare_fault_rows(tree: ast.AST) -> list[str]:
    """Rows of the fault table by number: `ASKED + 24`, `request(G, 24, ...)`, `Case(24, ...)`, `worst(24)`."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.BinOp) and isinstance(node.left, ast.Attribute):
            row = node.right if node.left.attr in ("ASKED", "ENABLED", "FIRST", "WORST") else None
        elif isinstance(node, ast.Call) and node.args:
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            first = name in ("Case", "Show", "worst", "noticed", "disable")
            place = 0 if first else 1 if name == "request" else len(node.args)
            row = node.args[place] if place < len(node.args) else None
        else:
            continue
        if isinstance(row, ast.Constant) and isinstance(row.value, int):
            found.append(ast.unparse(node))
    return found


def test_rows_of_the_fault_table_have_names():
    assert bare_fault_rows(ast.parse("G[sup.ASKED + 24]; request(G, 1, sup.LEVEL_1); man.worst(2)")) != []
    assert {str(path): rows for path in FILES if (rows := bare_fault_rows(tree_of(path)))} == {}


def counted_by_hand(tree: ast.Module) -> list[str]:
    """Places given as numbers, alone or behind another place: `TICK = 7`, `A, B = 0, 1`, `SEEN = BEGAN + 1`."""
    return [
        ast.unparse(statement)
        for statement in tree.body
        if isinstance(statement, ast.Assign)
        and any(isinstance(part, ast.Constant) and type(part.value) is int for part in ast.walk(statement.value))
        and not any(isinstance(part, ast.Call) for part in ast.walk(statement.value))
        and ast.unparse(statement.targets[0]) not in ("WIDTHS", "N_RING")
    ]


@pytest.mark.parametrize("name", ["supervisor_layout", "control_layout"])
def test_places_of_supervisor_and_autopilot_are_counted_by_a_cursor(name):
    assert len(counted_by_hand(ast.parse("A = 7\nA, B = 0, 1\nB = A + 1\nC = 1.0\nD = cursor(6)"))) == 3
    assert counted_by_hand(tree_of(ROOT / "firmware" / "core" / "layouts" / f"{name}.py")) == []


def test_a_cursor_hands_out_plain_numbers_in_turn():
    cursor = Cursor()
    a, b, (c, d) = cursor(), cursor(3), cursor.each(2)
    assert [a, b, c, d, cursor.size] == [0, 1, 4, 5, 6]
    assert {type(place) for place in (a, b, c, d)} == {int}
    with pytest.raises(ValueError, match="unpack"):
        _, _ = cursor.each(3)


STATES = {"x", "X", "start", "starts", "begins", "error", "spread", "spreads", "spectral", "cov"}
NAMED = (
    "firmware/core", "sim_backend/core", "tools/data", "tools/flight", "tools/inference", "tools/gap", "tools/diagnose",
    "tools/identify",
)  # fmt: skip


def literal_state_indices(tree: ast.AST) -> list[str]:
    """Subscripts of states, their errors or process noise by a bare number: `x[7]`, `gains.X[:, 13]`, `x[3:7]`."""
    found = []
    for node in ast.walk(tree):
        if not isinstance(node, ast.Subscript):
            continue
        if getattr(node.value, "id", getattr(node.value, "attr", "")) in STATES:
            last = node.slice.elts[-1] if isinstance(node.slice, ast.Tuple) else node.slice
            ends = (last.lower, last.upper) if isinstance(last, ast.Slice) else (last,)
            if any(isinstance(end, ast.Constant) and isinstance(end.value, int) for end in ends):
                found.append(ast.unparse(node))
    return found


@pytest.mark.parametrize("room", NAMED)
def test_states_are_indexed_by_name(room):
    bare = ["x[7]", "a.X[:, 13]", "x[3:7]"]
    assert literal_state_indices(ast.parse(f"{', '.join(bare)}, x[X_NU], x[i], X[-1], X[0, X_NU]")) == bare
    here = [path for path in FILES if path.is_relative_to(ROOT / room)]
    assert here
    assert {str(path): found for path in here if (found := literal_state_indices(tree_of(path)))} == {}


def test_a_scratch_row_of_the_filter_holds_a_vehicle_and_a_state():
    """A row that is too short is written past its end, and nobody says so."""
    assert max(layout.N_P, kf.N_XE, kf.N_E) <= kf.N_W
    assert wl.WORK_WIDTH >= ef.N_XF
