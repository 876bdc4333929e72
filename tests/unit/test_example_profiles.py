"""Profiles of the property tests: the same examples in every run, or many others; no test decides that by itself."""

import ast
import subprocess
import sys
from pathlib import Path

from hypothesis import settings

from tests.support.examples import CI_EXAMPLES, EXPLORE_EXAMPLES, examples

ROOT = Path(__file__).resolve().parents[2]
OF_A_PROFILE = {"derandomize", "deadline", "max_examples", "print_blob", "database"}


def own_settings(tree: ast.AST) -> list[str]:
    """Calls of `settings` that fix what a profile decides."""
    return [
        ast.unparse(node)
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and getattr(node.func, "id", getattr(node.func, "attr", "")) == "settings"
        if OF_A_PROFILE & {keyword.arg for keyword in node.keywords}
    ]


def test_no_test_fixes_what_the_profile_decides():
    assert len(own_settings(ast.parse("settings(derandomize=True); settings(phases=[])"))) == 1
    files = [path for path in sorted((ROOT / "tests").rglob("*.py")) if path.name != "examples.py"]
    assert {str(path): found for path in files if (found := own_settings(ast.parse(path.read_text())))} == {}


def test_what_the_profiles_are():
    ci, explore = settings.get_profile("ci"), settings.get_profile("explore")
    assert (ci.derandomize, ci.max_examples, ci.deadline) == (True, CI_EXAMPLES, None)
    assert (explore.derandomize, explore.max_examples, explore.deadline) == (False, EXPLORE_EXAMPLES, None)
    assert explore.print_blob


def test_a_test_tries_its_own_count_or_a_multiple_of_it(pytestconfig):
    explored = pytestconfig.getoption("--hypothesis-profile") == "explore"
    assert examples(30).max_examples == (30 * EXPLORE_EXAMPLES // CI_EXAMPLES if explored else 30)
    assert examples(30).derandomize is not explored


def test_the_command_line_chooses_the_profile():
    chosen = f"{Path(__file__).relative_to(ROOT)}::{test_a_test_tries_its_own_count_or_a_multiple_of_it.__name__}"
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--hypothesis-profile", "explore"]
    done = subprocess.run([*command, chosen], cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout
