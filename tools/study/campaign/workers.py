"""Where chunks are flown: in this process, in processes of this machine, or on a Dask cluster."""

import contextlib
import os
import signal
import socket
import threading
from collections.abc import Generator

import numpy as np

from tools.data.errors import InputError
from tools.study.campaign.flights import Chunk, Job, compile_loop, fly_chunk

CONNECT_SECONDS = 10
WORKER_SECONDS = 60
Flying = Generator[tuple[Chunk, np.ndarray], None, None]
TRIES = 3  # of a chunk whose Dask worker goes away


def fly_here(job: Job, chunks: list[Chunk], jobs: int) -> Flying:
    """Fly chunks in `jobs` processes (0: one a core), yielding each as it is done, in any order."""
    if jobs == 1:
        for chunk in chunks:
            yield chunk, fly_chunk(job, chunk)
        return
    import joblib

    compile_loop(job.plan)
    parallel = joblib.Parallel(
        n_jobs=jobs or joblib.cpu_count(), backend="loky", return_as="generator_unordered", batch_size=1
    )
    flown = parallel(joblib.delayed(_in_process)(job, chunk, os.getpid()) for chunk in chunks)
    with contextlib.closing(flown):  # an interrupt ends the workers before it goes on
        yield from flown


def _in_process(job: Job, chunk: Chunk, parent: int) -> tuple[Chunk, np.ndarray]:
    """A chunk in a worker of this machine. Ctrl-C reaches the whole terminal; only the parent is to answer."""
    if os.getpid() != parent and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    return chunk, fly_chunk(job, chunk)


def check_reachable(address: str) -> None:
    """InputError where nothing listens at a Dask address, before anything is begun."""
    from distributed.comm.addressing import get_address_host_port

    try:
        with socket.create_connection(get_address_host_port(address), CONNECT_SECONDS):
            return
    except (OSError, ValueError, OverflowError, TypeError) as error:
        raise InputError(f"no Dask scheduler there: {str(error).splitlines()[0]}", source=address) from None


def fly_on_dask(job: Job, chunks: list[Chunk], address: str) -> Flying:
    """Fly chunks on the cluster whose scheduler is at `address`, yielding each as it is done, in any order.

    Its workers need this version of glider; they say so if they have another.
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
        # The job goes with every chunk, some kilobytes: data put on a worker beforehand would be lost with it.
        futures = {client.submit(fly_chunk, job, chunk, pure=False, retries=TRIES - 1): chunk for chunk in chunks}
        try:
            with client.as_current():  # looked up when it is made
                done = as_completed(list(futures))
            for future in done:
                yield futures.pop(future), future.result()
        finally:
            client.cancel(list(futures))
