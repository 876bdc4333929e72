"""The examples in the API's docstrings run as they stand; the notebooks run from begin to end."""

import doctest
from pathlib import Path

import pytest

from glider.tools.api import calls, recordings

pytestmark = pytest.mark.computes(seconds=65)
NOTEBOOKS = Path(__file__).resolve().parents[3] / "docs" / "notebooks"


@pytest.mark.parametrize("module", [calls, recordings])
def test_the_examples_of_the_docstrings_run(module):
    examples = [test for test in doctest.DocTestFinder().find(module) if test.examples]
    assert len(examples) >= 2
    runner = doctest.DocTestRunner(optionflags=doctest.IGNORE_EXCEPTION_DETAIL)
    for example in examples:
        assert runner.run(example).failed == 0, example.name


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "said"),
    [("diagnose", "The hull drags more than its coefficients say"), ("monitor", "drag ")],
)
def test_a_notebook_runs_and_finds_the_effect(name, said, tmp_path, monkeypatch):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    monkeypatch.setenv("PYTHONPATH", str(NOTEBOOKS.parents[1]))  # of the process that executes the cells
    notebook = nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4)
    assert all(not cell.get("outputs") for cell in notebook.cells)
    nbclient.NotebookClient(notebook, timeout=900, resources={"metadata": {"path": str(tmp_path)}}).execute()
    printed = "".join(
        output.text for cell in notebook.cells for output in cell.get("outputs", []) if output.output_type == "stream"
    )
    assert said in printed
    pictures = [
        output
        for cell in notebook.cells
        for output in cell.get("outputs", [])
        if output.output_type == "execute_result"
    ]
    assert len(pictures) >= 2


def test_the_first_notebook_is_short():
    nbformat = pytest.importorskip("nbformat")
    notebook = nbformat.read(NOTEBOOKS / "diagnose.ipynb", as_version=4)
    lines = [line for cell in notebook.cells if cell.cell_type == "code" for line in cell.source.splitlines() if line]
    assert len(lines) <= 15
