"""How kernels are compiled: one way, one cache that notices every change.

Numba's own disk cache does not see a change in a kernel that a cached kernel calls, so the cache directory carries a
hash over every file that may hold kernels (KERNEL_DIRS, with all their rooms). A kernel file elsewhere would escape
the hash; tests/unit/test_jit.py holds the rule.

Set GLIDER_JIT=0 to run every kernel as plain Python (slow, for reading and stepping through).
"""

import errno
import hashlib
import os
import shutil
import stat
import sys
import tempfile
from pathlib import Path

PACKAGES_DIR = Path(__file__).resolve().parents[2]
KERNEL_DIRS = (
    "firmware/core", "sim_backend/core", "sim_backend/foreign", "sim_backend/ocean/core",
    "tools/inference/core", "tools/identify/core",
)  # fmt: skip
# places in the frame that the kernels freeze; kernels that call a user's functions
OTHER_FILES = ("hal/ports.py", "tools/own/kernels.py", "tools/own/near_kernels.py")
KEEP_CACHES = 3


def kernel_files() -> list[Path]:
    """Every source file whose kernels the cache key covers, in a fixed order."""
    kernels = [path for folder in KERNEL_DIRS for path in sorted((PACKAGES_DIR / folder).rglob("*.py"))]
    return kernels + [path for name in OTHER_FILES if (path := PACKAGES_DIR / name).is_file()]


def kernels_digest() -> str:
    """Hash of every kernel file's bytes, 16 hex digits."""
    digest = hashlib.sha256()
    for path in kernel_files():
        digest.update(path.relative_to(PACKAGES_DIR).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def cache_root() -> Path:
    """Folder of all compiled-kernel caches: GLIDER_CACHE_DIR, else the user's cache folder, else a temporary one."""
    wanted = os.environ.get("GLIDER_CACHE_DIR")
    if wanted:
        candidates = [Path(wanted)]
    else:
        base = os.environ.get("XDG_CACHE_HOME")
        candidates = [Path(base) / "glider" if base else Path.home() / ".cache" / "glider"]
        candidates.append(Path(tempfile.gettempdir()) / f"glider-cache-{os.getuid()}")
    for candidate in candidates:
        try:
            candidate.mkdir(parents=True, exist_ok=True, mode=0o755)
        except OSError:
            continue
        if os.access(candidate, os.W_OK) and _is_ours(candidate):
            return candidate
    tried = ", ".join(map(str, candidates))
    missing = "no writable folder of one's own for compiled kernels: set GLIDER_CACHE_DIR"
    raise PermissionError(errno.EACCES, missing, tried)


def _is_ours(folder: Path) -> bool:
    """Compiled kernels are code: a folder that somebody else owns, or may write into, is not read from."""
    found = folder.stat()
    return found.st_uid in (0, os.getuid()) and not found.st_mode & stat.S_IWOTH


def _prune(root: Path, current: Path) -> None:
    """Remove all but the newest caches of earlier kernel versions."""
    old = [path for path in root.glob("kernels-*") if path != current]
    old.sort(key=lambda path: path.stat().st_mtime, reverse=True)
    for path in old[KEEP_CACHES - 1 :]:
        shutil.rmtree(path, ignore_errors=True)


def _configure() -> Path | None:
    if os.environ.get("GLIDER_JIT", "1") == "0":
        os.environ["NUMBA_DISABLE_JIT"] = "1"
        return None
    root = cache_root()
    directory = root / f"kernels-{kernels_digest()}-py{sys.version_info.major}{sys.version_info.minor}"
    fresh = not directory.exists()
    directory.mkdir(parents=True, exist_ok=True)
    # Before numba is imported: it reads the variable once. Everything this process compiles with cache=True lands here.
    os.environ["NUMBA_CACHE_DIR"] = str(directory)
    if fresh:
        _prune(root, directory)
    return directory


CACHE_DIR = _configure()

import numba  # noqa: E402  (the cache folder has to be set first)

# No kernel calls BLAS. Numba looks for SciPy's all the same before the first one runs: a fifth of a second of imports.
_BLAS = "scipy.linalg.cython_blas"
if _BLAS not in sys.modules:
    sys.modules[_BLAS] = None  # type: ignore[assignment]  # how Python learns that there is none
    try:
        import numba.np.arraymath
    finally:
        del sys.modules[_BLAS]

if CACHE_DIR is not None:
    numba.config.CACHE_DIR = str(CACHE_DIR)  # type: ignore[attr-defined]  # made at run time

# No fast math, and no contraction either, which a C compiler does by default: where a product and a sum become one
# rounding hangs on what is inlined where, so that the same kernel called from two others, or compiled on another
# computer, would differ in the last bit. Plain operations are what Python does, anywhere: a diagnosis takes 6 % more.
# Nobody calls a kernel from C: the entry for that is not compiled.
_OPTIONS = dict(cache=True, nogil=True, error_model="numpy", fastmath=False, no_cfunc_wrapper=True)
# Without Numba's memory management a view of an array, which most lines of a kernel make, is a pointer and no more.
# With it each is counted in and out by two locked instructions: more than half of a closed loop's time.
# Said of every kernel: what is not said is taken over from the kernel that calls it first.
_NO_MEMORY, _MEMORY = dict(_nrt=False), dict(_nrt=True)
_KERNELS: list = []


def _made(dispatcher):
    """A kernel that takes a constant as any number: Numba would compile one for each 0 or 1 that a kernel hands it."""
    if CACHE_DIR is not None:
        template = dispatcher.get_call_template

        def plain(arguments, keywords):
            named = {name: numba.types.unliteral(kind) for name, kind in keywords.items()}
            return template(tuple(numba.types.unliteral(kind) for kind in arguments), named)

        dispatcher.get_call_template = plain
    _KERNELS.append(dispatcher)
    return dispatcher


def kernel(function):
    """Compile a pure function of float64 scalars and arrays; results go to tuples or the caller's `out`.

    It makes no array of its own: an allocation in it is an error of the compiler's.
    """
    return _made(numba.njit(**_OPTIONS, **_NO_MEMORY)(function))


def inlined_kernel(function):
    """Compile a kernel that becomes part of every kernel that calls it: small pieces, whose sums are shared there."""
    return _made(numba.njit(**_OPTIONS, **_NO_MEMORY, forceinline=True)(function))


def allocating_kernel(function):
    """Compile a kernel that makes scratch arrays, and hands them to kernels that do what is done often."""
    return _made(numba.njit(**_OPTIONS, **_MEMORY)(function))


def parallel_kernel(function):
    """Compile a kernel whose `prange` loop is shared out over all cores."""
    return _made(numba.njit(**_OPTIONS, **_MEMORY, parallel=True)(function))


prange = numba.prange


def compiled_signatures() -> int:
    """Number of compiled specialisations of all kernels imported so far: constant while nothing compiles."""
    return sum(len(getattr(dispatcher, "signatures", ())) for dispatcher in _KERNELS)


def kernel_count() -> int:
    """Number of kernels imported so far, compiled or not."""
    return len(_KERNELS)


def freeze_kernels() -> None:
    """Turn a call with unforeseen types of any kernel that has been called into an error: once the loop is armed."""
    for dispatcher in _KERNELS:
        if getattr(dispatcher, "signatures", ()):
            dispatcher.disable_compile(True)


def thaw_kernels() -> None:
    """Allow compilation again: after a flight, for whatever else the process does."""
    for dispatcher in _KERNELS:
        if getattr(dispatcher, "signatures", ()):
            dispatcher.disable_compile(False)
