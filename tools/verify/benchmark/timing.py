"""Taking times: whole processes, pieces of code, and two things in turns so that the machine's moods hit both."""

import statistics
import subprocess
import time
from collections.abc import Callable, Sequence
from typing import Any


def seconds(function: Callable[[], object]) -> float:
    """Wall time of one call, s."""
    begin = time.perf_counter()
    function()
    return time.perf_counter() - begin


def process_seconds(command: Sequence[str]) -> float:
    """Wall time of a whole process, s, its output thrown away. CalledProcessError where it does not end well."""
    return seconds(lambda: subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))


def alternate(repeats: int, *functions: Callable[[], Any]) -> list[list[Any]]:
    """Call the functions in turns, A B A B ..., `repeats` times each; what each returned, in order."""
    results: list[list[Any]] = [[] for _ in functions]
    for _ in range(repeats):
        for function, found in zip(functions, results, strict=True):
            found.append(function())
    return results


def median(values: Sequence[float]) -> float:
    """The middle one, or the mean of the two in the middle."""
    return float(statistics.median(values))
