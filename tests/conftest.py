"""Fixtures for all tests."""

import os
import signal
from pathlib import Path

import pytest

# Tests fill the cores by processes. Before NumPy is loaded: its BLAS otherwise keeps a second core waiting in each.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# A shell starts what it runs in the background with Ctrl-C or a hang-up ignored; programs under test would inherit it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
for ignored in (signal.SIGHUP, signal.SIGQUIT, signal.SIGTSTP):
    if signal.getsignal(ignored) is signal.SIG_IGN:
        signal.signal(ignored, signal.SIG_DFL)


def pytest_addoption(parser):
    parser.addoption("--board", help="run the contract tests on this board alone: shipped name or file")


REAL_TIME = "realtime"


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """What waits for the clock first: one process takes all of it, one after the other, beside those that compute."""
    for item in items:
        if item.get_closest_marker(REAL_TIME):
            item.add_marker(pytest.mark.xdist_group(REAL_TIME))
    items.sort(key=lambda item: item.get_closest_marker(REAL_TIME) is None)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """A file's tests stay with one process: what they share is flown once."""
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return REAL_TIME if nodeid.endswith(f"@{REAL_TIME}") else nodeid.split("::")[0]

    return ByFile(config, log)


ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of contracts and reference data beside the repository; tests that need it are skipped without."""
    folder = ROOT.parent / "shared"
    if not folder.is_dir():
        pytest.skip("no folder 'shared' beside the repository")
    return folder
