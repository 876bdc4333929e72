"""A model's functions as the observer's kernels call them: compiled by Numba where that can be, plain Python where not.

The kernels are compiled once and take a model's functions as pointers. Numba cannot keep closures over a user's
functions on the disk. So the user's source and calls.py are written into the cache folder under a hash of both, and
compiled there as modules of their own, which keep.
"""

import functools
import hashlib
import importlib.util
import inspect
import os
import sys
import types
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.own import kernels as python_kernels
from glider.tools.own.neighbours import import_file, module_names, neighbours

KERNELS, CALLS = (Path(__file__).with_name(name) for name in ("kernels.py", "calls.py"))
NAMES = ("wrap", "plus", "minus", "normalised", "difference", "read", "push_of", "filter_run", "follow_run", "fly_run",
         "advance", "transition", "transition_by_steps", "transition_by_rates")  # fmt: skip
OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy"}
PLAIN = "GLIDER_OWN_PYTHON"  # set: never compile


@dataclass(frozen=True)
class Kernels:
    """The observer of one model."""

    filter_run: Callable[..., Any]
    follow_run: Callable[..., Any]
    fly_run: Callable[..., Any]
    advance: Callable[..., Any]
    measure: Callable[..., Any]
    compiled: bool
    why: str  # it is not compiled: one line


def _module(name: str, path: Path, given: dict[str, Any]) -> types.ModuleType:
    """A file of this folder imported under a name, with some functions given."""
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    vars(module).update(given)
    return module


@functools.cache
def _compiled_kernels() -> types.ModuleType:
    import numba

    warnings.filterwarnings("ignore", "First-class function type", numba.core.errors.NumbaExperimentalFeatureWarning)
    module = _module("glider_own_kernels", KERNELS, {})
    for name in NAMES:
        vars(module)[name] = numba.njit(**OPTIONS)(vars(module)[name])
    return module


def _motion(model: Any) -> str:
    return "step" if hasattr(model, "step") else "derivative"


def _bound(kernels: types.ModuleType, motion: Any, reads: Any, stepped: bool, measure: Any, why: str = "") -> Kernels:
    """The kernels with a model's functions."""
    filter_run, follow_run, fly_run = (
        functools.partial(getattr(kernels, name), motion, reads, stepped)
        for name in ("filter_run", "follow_run", "fly_run")
    )
    advance = functools.partial(kernels.advance, motion, stepped)
    return Kernels(filter_run, follow_run, fly_run, advance, measure, not why, why)


def plain(model: Any, why: str) -> Kernels:
    """The observer in plain Python."""
    stepped, move = hasattr(model, "step"), getattr(model, _motion(model))

    def motion(out: np.ndarray, x: np.ndarray, u: np.ndarray, w: np.ndarray, theta: np.ndarray, dt: float) -> None:
        out[:] = move(x, u, w, theta, dt) if stepped else move(x, u, w, theta)

    def reads(out: np.ndarray, x: np.ndarray, u: np.ndarray, theta: np.ndarray) -> None:
        out[:] = model.measure(x, u, theta)

    def measure(x: np.ndarray, u: np.ndarray, theta: np.ndarray) -> np.ndarray:
        return np.asarray(model.measure(x, u, theta), dtype=np.float64)

    return _bound(python_kernels, motion, reads, stepped, measure, why)


def kernels_of(model: Any, path: Path | None, attribute: str, tried: tuple[np.ndarray, ...]) -> Kernels:
    """The observer of a model, from its file; why it is not compiled is in the answer.

    path: the Python file that it was loaded from; attribute: its name there, empty where the module is the model;
    tried: x, u, w, theta that its functions are compiled for and called with once.
    """
    if os.environ.get(PLAIN) or os.environ.get("GLIDER_JIT", "1") == "0":
        return plain(model, f"{PLAIN} or GLIDER_JIT asks for plain Python")
    if path is None:
        return plain(model, "the model is no object of a file")
    for name in (_motion(model), "measure"):
        one = getattr(model, name)
        if inspect.ismethod(one) and not inspect.isclass(one.__self__):
            return plain(model, f"{name} is a method with self; write it as a static method or a function")
    try:
        return _compiled(model, path, attribute, tried)
    except Exception as error:  # whatever Numba has against a user's function: the model runs all the same
        return plain(model, _reason(error))


def _reason(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    wanted = [line for line in lines if not line.startswith(("Failed in", "During", "File ", "def ", "<", "-", "^"))]
    return f"Numba: {(wanted or lines or [type(error).__name__])[0]}"[:200]


def _compiled(model: Any, path: Path, attribute: str, tried: tuple[np.ndarray, ...]) -> Kernels:
    import numba

    from glider.firmware.core import jit  # sets Numba's cache folder

    source, motion = CALLS.read_text(encoding="utf-8"), _motion(model)
    # the model may call the tree's own kernels
    versions = (numba.__version__ + jit.kernels_digest()).encode()
    texts = {one.relative_to(path.parent): one.read_bytes() for one in (path, *neighbours(path))}
    key = hashlib.sha256(repr(texts).encode() + source.encode() + versions).hexdigest()[:20]
    folder = jit.cache_root() / "own" / key
    kept, calls = folder / path.name, folder / "calls_of_the_model.py"
    for file, text in (*((folder / name, text) for name, text in texts.items()), (calls, source.encode())):
        if not file.is_file() or file.read_bytes() != text:
            from glider.tools.data.files import write_bytes

            file.parent.mkdir(parents=True, exist_ok=True)
            write_bytes(file, text)
    theirs, beside = _user_module(kept, key, path.parent)
    own, compiled = {one.__name__ for one in (theirs, *beside.values())}, dict[types.FunctionType, Any]()
    for module in (theirs, *beside.values()):
        for name, value in list(vars(module).items()):
            if isinstance(value, types.FunctionType) and value.__module__ in own:
                vars(module)[name] = compiled.setdefault(value, numba.njit(**OPTIONS)(value))
    owner = getattr(theirs, attribute) if attribute else theirs
    given: dict[str, Any] = {}
    for name in (motion, "measure"):
        function = getattr(owner, name)
        given[name] = function if hasattr(function, "py_func") else numba.njit(**OPTIONS)(function)
    called = _module(f"glider_own_{key}", calls, given)
    vector, number = numba.types.Array(numba.types.float64, 1, "C"), numba.types.float64
    moves, reads = (
        numba.cfunc(numba.types.void(*[vector] * arrays, *numbers), **OPTIONS)(function)
        for function, arrays, numbers in ((called.state_after if motion == "step" else called.rates, 5, (number,)),
                                          (called.readings, 4, ()))
    )  # fmt: skip
    found = _bound(_compiled_kernels(), moves, reads, motion == "step", given["measure"])
    x, u, w, theta = tried
    found.advance(x, u, w, theta, 0.01, 1)
    given["measure"](x, u, theta)
    return found


def _user_module(kept: Path, key: str, beside: Path) -> tuple[types.ModuleType, dict[str, types.ModuleType]]:
    """A copy of the user's module, whose functions may be replaced by compiled ones, and copies of its neighbours.

    beside: the folder that they are from, in which other files lie that they may read.
    """
    names = module_names(kept)
    loaded = {one: sys.modules[one] for one in names if one in sys.modules}
    try:
        return import_file(f"glider_own_model_{key}", kept, kept.parent, beside)
    finally:
        for one in names:
            sys.modules.pop(one, None)
        sys.modules.update(loaded)
