"""A model's functions as the observer's kernels call them: compiled by Numba where that can be, plain Python where not.

The kernels are compiled once and take a model's functions as pointers, of C's types: arrays of doubles, and dt.
Functions that Numba cannot compile are pointers into Python (ctypes). It cannot keep closures over a user's functions
on the disk, either. So the user's source and calls.py are written into the cache folder under a hash of both, and
compiled there as modules of their own, which keep.
"""

import ctypes
import functools
import hashlib
import importlib.util
import inspect
import os
import sys
import types
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from glider.tools.own import kernels as python_kernels
from glider.tools.own import near_kernels as python_near_kernels
from glider.tools.own.neighbours import import_file, module_names, neighbours

KERNELS, NEAR_KERNELS, CALLS = (
    Path(__file__).with_name(name) for name in ("kernels.py", "near_kernels.py", "calls.py")
)
NAMES = (
    "wrap", "plus", "minus", "normalised", "difference", "read", "push_of", "filter_run", "follow_run", "fly_run",
    "advance", "of_states", "of_noises", "of_own", "linear_part", "transition", "transition_by_steps",
    "transition_by_rates",
)  # fmt: skip
NEAR_NAMES = "follow_near", "fly_near", "advance_near", "differ"
RUNS, NEAR = ("filter_run", "follow_run", "fly_run"), ("follow_near", "fly_near")
OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy"}
PLAIN = "GLIDER_OWN_PYTHON"  # set: never compile the user's functions


class RaisedError(Exception):
    """What a function of the user's raised while a kernel ran."""

    def __init__(self, error: Exception):
        super().__init__(str(error))
        self.error = error


@dataclass(frozen=True)
class Kernels:
    """The observer of one model."""

    filter_run: Callable[..., Any]
    follow_run: Callable[..., Any]
    fly_run: Callable[..., Any]
    follow_near: Callable[..., Any]
    fly_near: Callable[..., Any]
    advance: Callable[..., Any]
    measure: Callable[..., Any]
    compiled: bool  # the user's functions, too
    why: str  # they are not: one line
    at_once: Callable[[int], int] = int  # how many of so many calls run side by side, in threads

    @property
    def said(self) -> str:
        """How the user's functions run, in words."""
        return "compiled by Numba" if self.compiled else f"plain Python, about ten times slower: {self.why}"


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
def _compiled_kernels() -> types.SimpleNamespace:
    import numba

    warnings.filterwarnings("ignore", "First-class function type", numba.core.errors.NumbaExperimentalFeatureWarning)
    module = _module("glider_own_kernels", KERNELS, {})
    compiled = {"pointer": numba.njit(**OPTIONS)(lambda array: array.ctypes)}
    for name in NAMES:
        compiled[name] = numba.njit(**OPTIONS)(vars(module)[name])
    vars(module).update(compiled)
    near = _module("glider_own_near_kernels", NEAR_KERNELS, {})
    compiled |= {name: numba.njit(**OPTIONS)(vars(near)[name]) for name in NEAR_NAMES}
    vars(near).update(compiled)
    return types.SimpleNamespace(**compiled)


def _motion(model: Any) -> str:
    return "step" if hasattr(model, "step") else "derivative"


def _bound(kernels: Any, motion: Any, reads: Any, stepped: bool, measure: Any, why: str = "") -> Kernels:
    """The kernels with a model's functions."""
    given: dict[str, Any] = {name: functools.partial(getattr(kernels, name), motion, reads, stepped) for name in RUNS}
    given |= {name: functools.partial(getattr(kernels, name), motion, reads) for name in NEAR}
    advance = functools.partial(kernels.advance, motion, stepped)
    return Kernels(**given, advance=advance, measure=measure, compiled=not why, why=why)


def plain(model: Any, why: str) -> Kernels:
    """The observer in plain Python; RaisedError: what the user's functions raise."""
    stepped = hasattr(model, "step")
    motion, reads = _written(_moves(model)), _written(model.measure)
    kernels = types.SimpleNamespace(**vars(python_kernels) | vars(python_near_kernels))
    return _bound(kernels, motion, reads, stepped, _measure(model), why)


def _moves(model: Any) -> Callable[..., Any]:
    """The user's step, or the derivative, called as a step is."""
    return model.step if hasattr(model, "step") else lambda *given: model.derivative(*given[:-1])


def _written(function: Callable[..., Any]) -> Callable[..., None]:
    def call(out: np.ndarray, *given: Any) -> None:
        try:
            out[:] = function(*given)
        except Exception as error:
            raise RaisedError(error) from error

    return call


def _measure(model: Any) -> Callable[..., np.ndarray]:
    def measure(x: np.ndarray, u: np.ndarray, theta: np.ndarray) -> np.ndarray:
        return np.asarray(model.measure(x, u, theta), dtype=np.float64)

    return measure


class _PythonFunction:
    """A Python function behind a pointer: its arrays are copied into ones that it may keep, and what it raises is kept
    for who called the kernel, which gets NaN from then on."""

    def __init__(
        self, function: Callable[..., Any], out: int, given: tuple[np.ndarray, ...], numbers: int,
        raised: list[BaseException],
    ) -> None:  # fmt: skip
        """function(*given, *numbers) answers `out` doubles; numbers: how many of those there are; raised: what any of a
        model's functions has raised in a call of a kernel."""
        result, lost = np.empty(out), np.full(out, np.nan)
        from_array = [(one.ctypes.data, one.nbytes) for one in given]
        result_at, lost_at, size, move = result.ctypes.data, lost.ctypes.data, result.nbytes, ctypes.memmove

        def call(to: int, *rest: Any) -> None:
            if not raised:
                try:
                    for (address, length), pointer in zip(from_array, rest, strict=False):
                        move(address, pointer, length)
                    result[:] = function(*given, *rest[len(given) :])
                    move(to, result_at, size)
                    return
                except BaseException as error:  # an interrupt, too, has to leave the kernel before it is raised
                    raised.append(error)
            move(to, lost_at, size)

        pointers = [ctypes.c_void_p] * (1 + len(given))
        self.kept = ctypes.CFUNCTYPE(None, *pointers, *[ctypes.c_double] * numbers)(call)
        self.arrays = given, result, lost


def _called_back(model: Any, tried: tuple[np.ndarray, ...], outputs: int, why: str) -> Kernels:
    """The compiled kernels, which call the user's functions as plain Python; RaisedError: what these raise."""
    from numba.core.types import WrapperAddressProtocol
    from numba.experimental import function_type  # noqa: F401  makes it a type of arguments

    class Pointer(WrapperAddressProtocol):  # type: ignore[misc]
        def __init__(self, to: _PythonFunction, signature: Any) -> None:
            self.to, self.called = to, signature

        def __wrapper_address__(self) -> int:
            return int(ctypes.cast(self.to.kept, ctypes.c_void_p).value or 0)

        def signature(self) -> Any:
            return self.called

    x, u, w, theta = (one.copy() for one in tried)
    stepped, raised = hasattr(model, "step"), list[BaseException]()
    moves = _PythonFunction(_moves(model), len(x), (x, u, w, theta), 1, raised)
    reads = _PythonFunction(model.measure, outputs, (x, u, theta), 0, raised)
    moving, reading = (Pointer(one, called) for one, called in zip((moves, reads), _signatures(), strict=True))
    found = _bound(_compiled_kernels(), moving, reading, stepped, _measure(model), why)

    def raising(kernel: Callable[..., Any]) -> Callable[..., Any]:
        def call(*given: Any) -> Any:
            try:
                with np.errstate(all="ignore"):  # a model that diverges is far off
                    return kernel(*given)
            finally:  # what became of NaN is no error of its own
                if raised:
                    error = raised.pop()
                    raise (RaisedError(error) if isinstance(error, Exception) else error) from error

        return call

    all_raising: dict[str, Any] = {name: raising(getattr(found, name)) for name in (*RUNS, *NEAR, "advance")}
    return replace(found, **all_raising)


def _signatures() -> tuple[Any, Any]:
    """Numba's, of motion(out, x, u, w, theta, dt) and of reads(out, x, u, theta)."""
    from numba import types as numbas

    array = numbas.CPointer(numbas.float64)
    return numbas.void(*5 * [array], numbas.float64), numbas.void(*4 * [array])


def kernels_of(model: Any, path: Path | None, attribute: str, tried: tuple[np.ndarray, ...], outputs: int) -> Kernels:
    """The observer of a model, from its file; why its functions are not compiled is in the answer.

    path: the Python file that it was loaded from; attribute: its name there, empty where the module is the model;
    tried: x, u, w, theta that its functions are compiled for and called with once; outputs: how many it has.
    """
    if os.environ.get("GLIDER_JIT", "1") == "0":
        return plain(model, "GLIDER_JIT asks for plain Python")
    if why := _not_compiled(model, path):
        return _called_back(model, tried, outputs, why)
    assert path is not None
    try:
        return _compiled(model, path, attribute, tried, outputs)
    except Exception as error:  # whatever Numba has against a user's function: the model runs all the same
        return _called_back(model, tried, outputs, _reason(error))


def _not_compiled(model: Any, path: Path | None) -> str:
    """Why a model's functions are not given to Numba: one line; empty: they are."""
    if os.environ.get(PLAIN):
        return f"{PLAIN} asks for plain Python"
    if path is None:
        return "the model is no object of a file"
    for name in (_motion(model), "measure"):
        one = getattr(model, name)
        if inspect.ismethod(one) and not inspect.isclass(one.__self__):
            return f"{name} is a method with self; write it as a static method or a function"
    return ""


def _reason(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    wanted = [line for line in lines if not line.startswith(("Failed in", "During", "File ", "def ", "<", "-", "^"))]
    return f"Numba: {(wanted or lines or [type(error).__name__])[0]}"[:200]


def _compiled(model: Any, path: Path, attribute: str, tried: tuple[np.ndarray, ...], outputs: int) -> Kernels:
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
    x, u, w, theta = tried
    given: dict[str, Any] = dict(
        zip(("STATES", "INPUTS", "NOISES", "PARAMETERS"), (len(one) for one in tried), strict=True), OUTPUTS=outputs
    )
    for name in (motion, "measure"):
        function = getattr(owner, name)
        given[name] = function if hasattr(function, "py_func") else numba.njit(**OPTIONS)(function)
    called = _module(f"glider_own_{key}", calls, given)
    functions = called.state_after if motion == "step" else called.rates, called.readings
    moves, reads = (numba.cfunc(one, **OPTIONS)(function)
                    for one, function in zip(_signatures(), functions, strict=True))  # fmt: skip
    found = _bound(_compiled_kernels(), moves, reads, motion == "step", given["measure"])
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
