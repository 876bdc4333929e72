"""Results do not depend on how many threads share a kernel's loop out: the other tests run on one."""

import ast
import json
import os
import subprocess
import sys

from glider.firmware.core import jit
from tests.support.threads import THREADS

# Where the kernels stand that tests.support.threads calls, one way or another.
SHARED_OUT = {
    "fly_batch", "fly_followed", "fly_open_loop_many", "fly_windows", "filter_runs", "follow_runs", "log_densities",
    "read_rows", "simulate_runs", "walk_chains",
}  # fmt: skip


def test_two_threads_give_the_bits_of_one(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "tests.support.threads", str(tmp_path)], cwd=jit.PACKAGES_DIR,
        env=os.environ | {"NUMBA_NUM_THREADS": str(THREADS)}, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found == dict.fromkeys(("fleet", "open_loop", "chains", "observer"), True)


def test_every_kernel_that_is_shared_out_is_among_them():
    names = {
        node.name
        for path in jit.kernel_files()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef)
        and any(getattr(decorator, "id", "") == "parallel_kernel" for decorator in node.decorator_list)
    }
    assert names == SHARED_OUT
