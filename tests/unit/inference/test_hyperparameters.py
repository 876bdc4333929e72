"""Numbers that decide are declared once (tools/inference/hyperparameters.py), and may only become fewer."""

import ast
import tomllib
from pathlib import Path

from glider.tools.inference.hyperparameters import CONTRACT, CONVENTION, DOMAIN, FITTED, listed

ROOT = Path(__file__).resolve().parents[3]
MOST = 80  # may only shrink; the aim is 40
DECIDING = [
    *sorted((ROOT / "tools" / "diagnose").glob("*.py")), *sorted((ROOT / "tools" / "watch").glob("*.py")),
    ROOT / "tools" / "gap" / "where.py", ROOT / "tools" / "gap" / "heading.py",
    ROOT / "tools" / "inference" / "healthy_level.py",
]  # fmt: skip
DECLARED = ROOT / "tests" / "data" / "other_numbers.toml"
KINDS = {"search", "grid", "numerical", "data", "display"}
ARITHMETIC = {0.0, 0.5, 1.0, 2.0}  # halves and doubles of formulas; as a bound only 0 and 1 are
GUARD = 1e-3  # below: against a division by zero


def numbers_in(node: ast.AST) -> list[float]:
    """Every number below a node."""
    return [one.value for one in ast.walk(node) if isinstance(one, ast.Constant) and type(one.value) in (int, float)]


def names_of(statement: ast.stmt) -> list[str]:
    """The names that an assignment binds."""
    targets = statement.targets if isinstance(statement, ast.Assign) else [getattr(statement, "target", None)]
    return [one.id for target in targets if target for one in ast.walk(target) if isinstance(one, ast.Name)]


def constants(tree: ast.Module) -> list[str]:
    """Names at module level, and with a default in a class, that hold a number."""
    bodies = [tree.body, *(one.body for one in ast.walk(tree) if isinstance(one, ast.ClassDef))]
    assigned = [one for body in bodies for one in body if isinstance(one, ast.Assign | ast.AnnAssign) and one.value]
    return [name for one in assigned if [n for n in numbers_in(one.value) if n not in (0, 1)] for name in names_of(one)]


def inline(tree: ast.Module) -> list[str]:
    """Numbers in functions that may be a bound, as `function: number`."""
    found = []
    for function in (one for one in ast.walk(tree) if isinstance(one, ast.FunctionDef)):
        inner = {id(n) for one in ast.walk(function) if isinstance(one, ast.FunctionDef) and one is not function
                 for n in ast.walk(one)}  # fmt: skip
        for node in (one for one in ast.walk(function) if id(one) not in inner):
            if isinstance(node, ast.Compare):
                sides = [one for side in (node.left, *node.comparators) for one in direct(side)]
                found += [f"{function.name}: {n:g}" for n in sides if abs(n) not in (0, 1) and abs(n) >= GUARD]
            elif isinstance(node, ast.Constant) and type(node.value) is float:
                value = abs(node.value)
                found += [f"{function.name}: {value:g}"] if value not in ARITHMETIC and value >= GUARD else []
    return found


def direct(side: ast.expr) -> list[float]:
    """Floats of one side of a comparison, but for what its calls and subscripts hold; and an integer beyond 2."""
    if isinstance(side, ast.Constant) and type(side.value) in (int, float):
        return [side.value] if type(side.value) is float or side.value > 2 else []
    if isinstance(side, ast.BinOp):
        return [n for n in direct(side.left) + direct(side.right) if isinstance(n, float)]
    return direct(side.operand) if isinstance(side, ast.UnaryOp) else []


def undeclared(source: str, declared: dict[str, str]) -> list[str]:
    """Numbers of a module that neither the hyperparameters nor the declared others are."""
    tree = ast.parse(source)
    return sorted({*constants(tree), *inline(tree)} - set(declared))


def other_numbers() -> dict[str, dict[str, str]]:
    """By module the numbers that decide nothing, with what they are."""
    return tomllib.loads(DECLARED.read_text(encoding="utf-8"))


def test_hyperparameters_become_fewer():
    assert len(list(listed())) == MOST, "take MOST down with them, never up"


def test_every_hyperparameter_says_what_it_is():
    for _, one, value in listed():
        assert one.metadata["unit"], one.name
        assert one.metadata["meaning"], one.name
        assert one.metadata["source"] in (CONTRACT, DOMAIN, FITTED, CONVENTION), one.name
        assert isinstance(value, float | int)


def test_every_hyperparameter_is_used():
    code = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "tools").rglob("*.py"))
    owner = {
        "Diagnosis": "DIAGNOSIS",
        "Against healthy runs": "HEALTHY",
        "Watch and ocean gliders": "WATCH",
        "Gap": "GAP",
    }
    assert [one.name for section, one, _ in listed() if f"{owner[section]}.{one.name}" not in code] == []


def test_no_other_number_decides():
    others = other_numbers()
    found = {}
    for path in DECIDING:
        name = path.relative_to(ROOT / "tools").as_posix()
        left = undeclared(path.read_text(encoding="utf-8"), others.get(name, {}))
        found |= {name: left} if left else {}
    assert found == {}


def test_declared_numbers_are_there_and_of_a_known_kind():
    modules = {path.relative_to(ROOT / "tools").as_posix(): path for path in DECIDING}
    for name, declared in other_numbers().items():
        tree = ast.parse(modules[name].read_text(encoding="utf-8"))
        assert set(declared) <= {*constants(tree), *inline(tree)}, name
        assert set(declared.values()) <= KINDS, name


def test_the_check_finds_a_threshold_of_its_own():
    assert undeclared("LEAST = 0.3\n", {}) == ["LEAST"]
    assert undeclared("LEAST, MOST = 0.3, 4\nEVEN: float = 0.5\n", {"MOST": "search"}) == ["EVEN", "LEAST"]
    assert undeclared("class A:\n    share: float = 0.4\n", {}) == ["share"]
    assert undeclared("def f(x):\n    return x > 0.5\n", {}) == ["f: 0.5"]
    assert undeclared("def f(x):\n    return opened(x, 3.0, 8.0)\n", {}) == ["f: 3", "f: 8"]
    assert undeclared("def f(x):\n    return len(x) >= 3\n", {}) == ["f: 3"]
    assert undeclared("def f(x, y):\n    return x > 0.5 * y\n", {}) == ["f: 0.5"]
    assert undeclared("def f(x):\n    return 0.5 * x / max(x, 1e-9)\n", {}) == []
