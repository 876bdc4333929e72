"""Where pieces of a large task are worked on: in this process, in processes of this machine, or on a Dask cluster."""

import contextlib
import os
import signal
import socket
import threading
from collections.abc import Callable, Generator, Iterable
from multiprocessing import parent_process
from typing import Any

from glider.tools.data.errors import InputError

CONNECT_SECONDS = 10
WORKER_SECONDS = 60
TRIES = 3  # of a piece whose Dask worker goes away
Work = Callable[[Any], Any]  # what is done with a piece; it and its pieces can be pickled
Worked = Generator[tuple[Any, Any], None, None]  # pieces with their outcomes, in any order


def end_with_parent() -> None:
    """Initializer of a pool's workers. A parent that is killed cannot tell them, and they would wait forever."""
    threading.Thread(target=_wait_for_parent, daemon=True).start()


def _wait_for_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)  # in the middle of whatever the worker does


def work_here(work: Work, pieces: Iterable[Any], jobs: int) -> Worked:
    """Work on pieces in `jobs` processes (0: one a core; 1: this one), yielding each as it is done."""
    if jobs == 1:
        for piece in pieces:
            yield piece, work(piece)
        return
    import joblib

    parallel = joblib.Parallel(
        n_jobs=jobs or joblib.cpu_count(), backend="loky", return_as="generator_unordered", batch_size=1
    )
    done = parallel(joblib.delayed(_in_process)(work, piece, os.getpid()) for piece in pieces)
    with contextlib.closing(done):  # an interrupt ends the workers before it goes on
        yield from done


def _in_process(work: Work, piece: Any, parent: int) -> tuple[Any, Any]:
    """A piece in a worker of this machine. Ctrl-C reaches the whole terminal; only the parent is to answer."""
    if os.getpid() != parent and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    return piece, work(piece)


def check_reachable(address: str) -> None:
    """InputError where nothing listens at a Dask address, before anything is begun."""
    from distributed.comm.addressing import get_address_host_port

    try:
        with socket.create_connection(get_address_host_port(address), CONNECT_SECONDS):
            return
    except (OSError, ValueError, OverflowError, TypeError) as error:
        raise InputError(f"no Dask scheduler there: {str(error).splitlines()[0]}", source=address) from None


def work_on_dask(work: Work, pieces: Iterable[Any], address: str) -> Worked:
    """Work on pieces on the cluster whose scheduler is at `address`, yielding each as it is done.

    Its workers need this version of glider. A piece whose worker goes away is given to another, TRIES times in all.
    """
    check_reachable(address)
    from distributed import Client, as_completed

    try:
        client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except OSError as error:  # TimeoutError is one
        raise InputError(f"no Dask scheduler there: {str(error).splitlines()[0]}", source=address) from None
    with client:
        try:
            client.wait_for_workers(1, timeout=WORKER_SECONDS)
        except TimeoutError:
            raise InputError(f"no Dask worker there in {WORKER_SECONDS} s", source=address) from None
        # What is needed goes with every piece: data put on a worker beforehand would be lost with it.
        futures = {client.submit(work, piece, pure=False, retries=TRIES - 1): piece for piece in pieces}
        try:
            with client.as_current():  # looked up when it is made
                done = as_completed(list(futures))
            for future in done:
                yield futures.pop(future), future.result()
        finally:
            client.cancel(list(futures))


def work_through(work: Work, pieces: Iterable[Any], jobs: int = 0, dask: str | None = None) -> Worked:
    """Work on pieces on the Dask cluster at an address, or else in `jobs` processes of this machine."""
    return work_on_dask(work, pieces, dask) if dask else work_here(work, pieces, jobs)
