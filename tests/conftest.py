"""Fixtures for all tests."""

from pathlib import Path

import pytest


def pytest_addoption(parser):
    parser.addoption("--board", help="run the contract tests on this board alone: shipped name or file")


ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of contracts and reference data beside the repository; tests that need it are skipped without."""
    folder = ROOT.parent / "shared"
    if not folder.is_dir():
        pytest.skip("no folder 'shared' beside the repository")
    return folder
