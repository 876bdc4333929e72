"""Fixtures for the logs' tests."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def rows():
    from log_files import tick_rows

    return tick_rows(500)


@pytest.fixture(scope="session")
def small_log(tmp_path_factory, rows):
    """A complete log."""
    from log_files import write_small_log

    return write_small_log(tmp_path_factory.mktemp("log") / "flight.mcap", rows)
