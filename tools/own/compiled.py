"""A model's functions beside the observer's kernels: compiled by Numba where that can be, plain Python where not.

Numba cannot keep closures over a user's functions on the disk. So the user's source and the kernels are written into
the cache folder under a hash of both, and compiled there as a module of their own, which keeps.
"""

import hashlib
import importlib.util
import inspect
import os
import sys
import types
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.own.neighbours import import_file, module_names, neighbours

KERNELS = Path(__file__).with_name("kernels.py")
NAMES = ("wrap", "plus", "minus", "normalised", "difference", "read", "push_of", "filter_run", "follow_run", "fly_run")
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


def _functions(model: Any) -> dict[str, Callable[..., Any]]:
    """step or derivative, and measure, of a model object."""
    motion = "step" if hasattr(model, "step") else "derivative"
    return {motion: getattr(model, motion), "measure": model.measure}


def _module(name: str, path: Path, given: dict[str, Any]) -> types.ModuleType:
    """The kernels' file imported under a name, with the user's functions given; `advance` is that of their motion."""
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    vars(module).update(given)
    vars(module)["advance"] = module.advance_by_steps if "step" in given else module.advance_by_derivative
    return module


def _as_array(function: Callable[..., Any]) -> Callable[..., np.ndarray]:
    """A function whose answer may be any sequence, as one that returns float64."""
    return lambda *given: np.asarray(function(*given), dtype=np.float64)


def plain(model: Any, why: str) -> Kernels:
    """The observer in plain Python."""
    functions = {name: _as_array(one) for name, one in _functions(model).items()}
    made = _module(f"glider_own_plain_{id(model)}", KERNELS, functions)
    return Kernels(made.filter_run, made.follow_run, made.fly_run, made.advance, functions["measure"], False, why)


def kernels_of(model: Any, path: Path | None, attribute: str, tried: tuple[np.ndarray, ...]) -> Kernels:
    """The observer of a model, from its file; why it is not compiled is in the answer.

    path: the Python file that it was loaded from; attribute: its name there, empty where the module is the model;
    tried: x, u, w, theta that its functions are compiled for and called with once.
    """
    if os.environ.get(PLAIN) or os.environ.get("GLIDER_JIT", "1") == "0":
        return plain(model, f"{PLAIN} or GLIDER_JIT asks for plain Python")
    if path is None:
        return plain(model, "the model is no object of a file")
    for name, one in _functions(model).items():
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

    source, motion = KERNELS.read_text(encoding="utf-8"), "step" if hasattr(model, "step") else "derivative"
    # the model may call the tree's own kernels
    versions = (numba.__version__ + jit.kernels_digest()).encode()
    texts = {one.relative_to(path.parent): one.read_bytes() for one in (path, *neighbours(path))}
    key = hashlib.sha256(repr(texts).encode() + source.encode() + versions).hexdigest()[:20]
    folder = jit.cache_root() / "own" / key
    kept, kernels = folder / path.name, folder / "observer_kernels.py"
    for file, text in (*((folder / name, text) for name, text in texts.items()), (kernels, source.encode())):
        if not file.is_file() or file.read_bytes() != text:
            from glider.tools.data.files import write_bytes

            file.parent.mkdir(parents=True, exist_ok=True)
            write_bytes(file, text)
    options: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy"}
    theirs, beside = _user_module(kept, key, path.parent)
    own, compiled = {one.__name__ for one in (theirs, *beside.values())}, dict[types.FunctionType, Any]()
    for module in (theirs, *beside.values()):
        for name, value in list(vars(module).items()):
            if isinstance(value, types.FunctionType) and value.__module__ in own:
                vars(module)[name] = compiled.setdefault(value, numba.njit(**options)(value))
    owner = getattr(theirs, attribute) if attribute else theirs
    given: dict[str, Any] = {}
    for name in (motion, "measure"):
        function = getattr(owner, name)
        given[name] = function if hasattr(function, "py_func") else numba.njit(**options)(function)
    name = f"glider_own_{key}"
    observer = _module(name, kernels, given)
    for one in (*NAMES, "advance"):
        vars(observer)[one] = numba.njit(**options)(vars(observer)[one])
    x, u, w, theta = tried
    observer.advance(x, u, w, theta, 0.01, 1)
    given["measure"](x, u, theta)
    return Kernels(observer.filter_run, observer.follow_run, observer.fly_run, observer.advance, given["measure"],
                   True, "")  # fmt: skip


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
