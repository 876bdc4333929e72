"""Fixtures for all tests."""

import collections
import contextlib
import functools
import gc
import os
import re
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from tests.support.examples import register_profiles

# Property tests: the same examples in every run; `make explore` chooses the other profile (tests/support/examples.py).
register_profiles()
settings.load_profile("ci")

# Tests fill the cores by processes. Before NumPy and Numba are loaded: in each process, threads beyond the first
# otherwise keep a core busy waiting for each other. What runs on several threads is a test of its own (test_threads).
for library in ("OPENBLAS", "NUMBA"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

# A shell starts what it runs in the background with Ctrl-C or a hang-up ignored; programs under test would inherit it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
for ignored in (signal.SIGHUP, signal.SIGQUIT, signal.SIGTSTP):
    if signal.getsignal(ignored) is signal.SIG_IGN:
        signal.signal(ignored, signal.SIG_DFL)


def pytest_addoption(parser):
    parser.addoption("--board", help="run the contract tests on this board alone: shipped name or file")


WAITING = 2  # processes, of four or more, that take what waits for the clock: more of these flights would be late
MARK = re.compile(r"^pytestmark = pytest\.mark\.(realtime|computes)(?:\(seconds=(\d+)\))?$", re.MULTILINE)


@functools.cache
def marked(file: Path) -> tuple[bool, int]:
    """Whether a file's tests wait for the clock on the wall, and how long they take, as its mark says (0: not long)."""
    mark = MARK.search(file.read_text(encoding="utf-8"))
    return (False, 0) if mark is None else (mark.group(1) == "realtime", int(mark.group(2) or 0))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """A file's tests stay with one process: what they share is flown once. Half of the processes, two at most, take the
    files that wait for the clock, which leaves the cores idle, the others those that compute, all of them the longest
    first, so that none is left alone with one at the end; who has nothing left of his own helps the others.
    """
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return nodeid.split("::")[0]

        def _assign_work_unit(self, node) -> None:
            waits = self.nodes.index(node) < min(WAITING, max(1, self.numnodes // 2))
            marks = {scope: marked(config.rootpath / scope) for scope in self.workqueue}
            own = [scope for scope in marks if marks[scope][0] == waits]
            if own:
                self.workqueue.move_to_end(max(own, key=lambda scope: marks[scope][1]), last=False)
            super()._assign_work_unit(node)

    return ByFile(config, log)


# What stands before the first test is no garbage, and half a million objects: a flight that arms has all that is not
# frozen collected, a tenth of a second each time. In tests what is frozen stays so.
gc.unfreeze = lambda: None


def pytest_collection_finish():
    gc.freeze()


ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of contracts and reference data beside the repository; tests that need it are skipped without."""
    folder = ROOT.parent / "shared"
    if not folder.is_dir():
        pytest.skip("no folder 'shared' beside the repository")
    return folder


@pytest.fixture(scope="session", autouse=True)
def unwritten() -> Iterator[None]:
    """The vehicle that many tests share is at the end as it was. Read-only it would be another type to Numba, for which
    the kernels would be compiled again.
    """
    yield
    if (states := sys.modules.get("tests.support.model_states")) is not None:
        anew = states.decode_vehicle(states.VEHICLE_TEXT, "roughie").vector()
        assert states.P.tobytes() == anew.tobytes(), "P was written into"


@pytest.fixture(scope="session", autouse=True)
def compiled(request) -> None:
    """The kernels of a flight are in the cache before a program is started that is given so many seconds to fly."""
    if any(item.get_closest_marker("realtime") for item in request.session.items):
        from glider.tools.flight.precompile import FLIGHT, ensure_compiled

        ensure_compiled(FLIGHT, lambda text: None, lambda label, total: contextlib.nullcontext(lambda n: None))


def pytest_terminal_summary(terminalreporter):
    """What was skipped and why, in a line that no -q hides."""
    reasons = collections.Counter(report.longrepr[2] for report in terminalreporter.stats.get("skipped", []))
    if reasons:
        said = "; ".join(f"{count} {reason.removeprefix('Skipped: ')}" for reason, count in reasons.most_common())
        terminalreporter.write_line(f"skipped {reasons.total()}: {said}")
