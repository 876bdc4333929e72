"""Counting every block that Python's object allocator hands out: how "allocation-free" is proved.

Net counts (sys.getallocatedblocks) miss what is made and freed within a tick, and the peak of tracemalloc hides a small
array behind larger neighbours. Here the allocator itself is wrapped for the duration of a measurement, so that every
request is seen with its size. A boxed float takes 24 bytes, a NumPy scalar 32, a bound method 48; an array object takes
96 and its data more, so "nothing above 64 bytes" is "no array, list, tuple of many or frame was made".
"""

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

DOMAINS = (1, 2)  # PYMEM_DOMAIN_MEM (what lists and dicts hold) and PYMEM_DOMAIN_OBJ (objects)
LARGEST_SIZE = 4095  # sizes from here on are counted together
BOXED = 64  # bytes; no scalar object is larger


class _Allocator(ctypes.Structure):
    """PyMemAllocatorEx of the C API."""

    _fields_ = (
        ("ctx", ctypes.c_void_p), ("malloc", ctypes.c_void_p), ("calloc", ctypes.c_void_p),
        ("realloc", ctypes.c_void_p), ("free", ctypes.c_void_p),
    )  # fmt: skip


@cache
def _hooks(domain: int) -> tuple[_Allocator, _Allocator, np.ndarray, list]:
    """A domain's allocator as it is, one that counts and passes on, and the counts by size in bytes."""
    from numba import cfunc, types

    get = ctypes.pythonapi.PyMem_GetAllocator
    get.argtypes, get.restype = [ctypes.c_int, ctypes.POINTER(_Allocator)], None
    original = _Allocator()
    get(domain, ctypes.byref(original))
    if original.ctx:
        raise RuntimeError("Python runs with a debugging allocator; blocks cannot be counted through it")
    pointer, size = ctypes.c_void_p, ctypes.c_ssize_t
    malloc = ctypes.CFUNCTYPE(pointer, pointer, size)(original.malloc)
    calloc = ctypes.CFUNCTYPE(pointer, pointer, size, size)(original.calloc)
    realloc = ctypes.CFUNCTYPE(pointer, pointer, pointer, size)(original.realloc)
    counts = np.zeros(LARGEST_SIZE + 1, dtype=np.int64)
    table = types.CPointer(types.int64)

    @cfunc(types.voidptr(table, types.intp))
    def counting_malloc(by_size, n):
        by_size[min(n, LARGEST_SIZE)] += 1
        return malloc(0, n)

    @cfunc(types.voidptr(table, types.intp, types.intp))
    def counting_calloc(by_size, k, n):
        by_size[min(k * n, LARGEST_SIZE)] += 1
        return calloc(0, k, n)

    @cfunc(types.voidptr(table, types.voidptr, types.intp))
    def counting_realloc(by_size, p, n):
        by_size[min(n, LARGEST_SIZE)] += 1
        return realloc(0, p, n)

    wrappers: list[Any] = [counting_malloc, counting_calloc, counting_realloc]
    counting = _Allocator(counts.ctypes.data, *(wrapper.address for wrapper in wrappers), original.free)
    return original, counting, counts, [*wrappers, malloc, calloc, realloc]


def blocks_asked_for(function: Callable[[], object], times: int = 200) -> dict[int, float]:
    """Blocks that one call of `function` asks for, by size in bytes; what the counting itself costs is taken off.

    Sizes of LARGEST_SIZE bytes and more are counted as LARGEST_SIZE. A block that only some calls ask for shows as a
    fraction.
    """
    _count(function, 10)  # the interpreter settles into a call it has not seen counted before
    counting_alone = _count(_nothing, times)
    per_call = (_count(function, times) - counting_alone) / times
    return {int(size): float(per_call[size]) for size in np.flatnonzero(per_call > 0.0)}


def _nothing() -> None:
    """A call that asks for nothing."""


def _count(function: Callable[[], object], times: int) -> np.ndarray:
    hooks = {domain: _hooks(domain) for domain in DOMAINS}
    setter = ctypes.pythonapi.PyMem_SetAllocator
    setter.argtypes, setter.restype = [ctypes.c_int, ctypes.POINTER(_Allocator)], None
    for _, _, counts, _ in hooks.values():
        counts[:] = 0
    try:
        for domain, (_, counting, _, _) in hooks.items():
            setter(domain, ctypes.byref(counting))
        for _ in range(times):
            function()
    finally:
        for domain, (original, _, _, _) in hooks.items():
            setter(domain, ctypes.byref(original))
    return np.sum([counts for _, _, counts, _ in hooks.values()], axis=0)
