"""A Dask cluster on this machine, as a user would start it."""

import contextlib
import re
import subprocess
import sys


@contextlib.contextmanager
def dask_cluster(folder, workers=2):
    """Address of a real scheduler on loopback with worker processes of their own, as a user would start them."""
    dask = [sys.executable, "-m", "dask"]
    quiet = {"stdout": subprocess.DEVNULL, "cwd": folder, "text": True, "stderr": subprocess.PIPE}
    with contextlib.ExitStack() as stack:

        def start(*arguments):
            process = subprocess.Popen([*dask, *arguments], **quiet)
            stack.callback(process.wait, 20)
            stack.callback(process.terminate)
            return process

        scheduler = start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-show")
        address = None
        for line in scheduler.stderr:
            found = re.search(r"Scheduler at:\s+(tcp://\S+)", line)
            if found:
                address = found.group(1)
                break
        assert address, "the scheduler did not start"
        for _ in range(workers):
            start("worker", address, "--nthreads", "1", "--no-dashboard", "--host", "127.0.0.1", "--no-nanny")
        yield address
