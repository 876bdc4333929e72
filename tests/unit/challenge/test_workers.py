"""Workers of a pool end with the process that started them, also where that is killed."""

import signal
import subprocess
import sys

import pytest

from glider.firmware.core import jit

pytestmark = pytest.mark.realtime(seconds=60)

WORKING = """
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from glider.tools.study.workers import end_with_parent

def work(_):
    print("at work", flush=True)
    time.sleep(50)

if __name__ == "__main__":
    with ProcessPoolExecutor(2, mp_context=get_context("METHOD"), initializer=end_with_parent) as pool:
        list(pool.map(work, range(2)))
"""


@pytest.mark.parametrize("method", ["spawn", "fork"])
def test_workers_end_with_a_parent_that_is_killed(tmp_path, method):
    script = tmp_path / "working.py"
    script.write_text(WORKING.replace("METHOD", method), encoding="utf-8")
    with subprocess.Popen(
        [sys.executable, str(script)], cwd=tmp_path, env={"PYTHONPATH": str(jit.PACKAGES_DIR)}, stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL, text=True,
    ) as parent:  # fmt: skip
        assert [parent.stdout.readline() for _ in range(2)] == 2 * ["at work\n"]
        parent.send_signal(signal.SIGKILL)
        parent.communicate(timeout=40)  # the workers hold the other end of the pipe
