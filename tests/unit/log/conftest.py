"""Fixtures for the logs' tests."""

import pytest

from tests.support.log_files import tick_rows, write_small_log


@pytest.fixture(scope="session")
def rows():
    return tick_rows(500)


@pytest.fixture(scope="session")
def small_log(tmp_path_factory, rows):
    """A complete log."""
    return write_small_log(tmp_path_factory.mktemp("log") / "flight.mcap", rows)
