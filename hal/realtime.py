"""What a process may ask of the system to be punctual: each request optional, each with its outcome in words."""

import contextlib
import ctypes
import os

MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4


def take_priority(priority: int) -> str:
    """SCHED_FIFO for this process and those it starts."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except (OSError, AttributeError) as error:
        return f"ordinary priority ({_reason(error)})"
    return f"real-time priority {priority}"


def lock_memory() -> str:
    """mlockall: no page that this process has touched goes to a disk or has to be fetched from one.

    Pages that nobody touches stay out (MCL_ONFAULT): with them a flight would hold four times its memory, stacks of
    idle threads and the compiler's code for the most part.
    """
    try:
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) != 0:
            raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    except (OSError, AttributeError) as error:
        return f"memory not locked ({_reason(error)})"
    return "memory locked"


def unlock_memory() -> None:
    """Undo lock_memory."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).munlockall()


def pin_to_core(core: int) -> str:
    """Keep this process on one core."""
    try:
        os.sched_setaffinity(0, {core})
    except (OSError, AttributeError) as error:
        return f"not pinned to core {core} ({_reason(error)})"
    return f"core {core}"


def leave_real_time() -> None:
    """For a process beside the loop that was started by it: ordinary priority, on whichever core is free."""
    with contextlib.suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    with contextlib.suppress(OSError, AttributeError):
        os.sched_setaffinity(0, range(os.cpu_count() or 1))


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or "not on this system"
