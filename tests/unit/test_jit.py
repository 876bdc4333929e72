"""How kernels are compiled: where they may stand, what the cache key covers, and plain Python beside machine code."""

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core.errors import NumbaError

from glider.firmware.core import jit

ROOT = jit.PACKAGES_DIR
PACKAGES = ("firmware", "hal", "sim_backend", "tools")
COMPILERS = {
    "kernel", "inlined_kernel", "allocating_kernel", "parallel_kernel", "njit", "jit", "vectorize", "guvectorize",
    "stencil", "jitclass",
}  # fmt: skip

# Flies through every kernel of the nominal flight and prints what came out, to the last bit.
FLIGHT = """
import numpy as np
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.flight import nominal_run
from glider.firmware.core.maths.rotations import euler_from_quaternion, quaternion_from_euler, wrap_angle
from glider.firmware.model.library import shipped
from glider.firmware.model.vehicle import decode_vehicle

P = decode_vehicle(shipped("model/vehicles")["roughie"], "roughie").vector()
for start in ((0.1, -0.2, 3.0, 0.3, 0.05, 0.02), (-2.0, 1.2, -1.0, -0.1, 0.3, 0.2), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)):
    x, work = np.zeros(layout.N_X), np.zeros((5, layout.N_X))
    x[3:7] = quaternion_from_euler(start[0], start[1], start[2])
    x[7:10] = start[3:]
    nominal_run(P, x, 0.6, -0.03, 0.15, 0.1, -0.05, 0.02, 0.01, 300, work)
    print(*(float(value).hex() for value in (*x, *euler_from_quaternion(*x[3:7]), wrap_angle(10.0 * x[3]))))
"""


@jit.kernel
def refused(values):
    return (2.0 * values).sum()


@jit.allocating_kernel
def allowed(values):
    return (2.0 * values).sum()


@jit.kernel
def calling(values):
    return allowed(values)


def sources(*words: str) -> list[Path]:
    """The files in which one of some words stands: parsing all of them takes seconds."""
    files = (path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py")))
    return [path for path in files if any(word in path.read_text(encoding="utf-8") for word in words)]


def decorators(path: Path) -> set[str]:
    """Names of everything that decorates or wraps a function in a file."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        for decorator in getattr(node, "decorator_list", []):
            target = decorator.func if isinstance(decorator, ast.Call) else decorator
            names.add(target.attr if isinstance(target, ast.Attribute) else getattr(target, "id", ""))
    return names


def test_kernels_stand_where_the_cache_key_looks():
    covered = set(jit.kernel_files())
    strays = [path for path in sources(*COMPILERS) if decorators(path) & COMPILERS and path not in covered]
    assert not strays, f"kernels outside {jit.KERNEL_DIRS}: the cache would not notice their changes"


def test_nothing_is_cached_on_disk_but_by_jit():
    """Numba caches only what asks for it: `cache=True` elsewhere would be a kernel that the key does not cover."""
    asking = {
        path.relative_to(ROOT)
        for path in sources("cache")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.keyword) and node.arg == "cache"
    }
    assert asking == {Path("firmware/core/jit.py")}


@pytest.mark.skipif(jit.CACHE_DIR is None, reason="plain Python makes what it likes")
def test_what_a_kernel_may_make_does_not_hang_on_who_calls_it():
    """An array made in a kernel is refused, and allowed in an allocating one that such a kernel calls first."""
    with pytest.raises(NumbaError, match="NRT required"):
        refused(np.ones(3))
    assert calling(np.ones(3)) == 6.0


@pytest.fixture
def copied_kernels(tmp_path, monkeypatch):
    """The kernel files in a folder of their own, with jit looking there."""
    for path in jit.kernel_files():
        target = tmp_path / path.relative_to(ROOT)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target)
    monkeypatch.setattr(jit, "PACKAGES_DIR", tmp_path)
    return tmp_path


def test_digest_is_the_same_for_the_same_files(copied_kernels, monkeypatch):
    copied = jit.kernels_digest()
    monkeypatch.setattr(jit, "PACKAGES_DIR", ROOT)
    assert copied == jit.kernels_digest()


def test_digest_changes_with_every_kernel_file(copied_kernels):
    files, seen = jit.kernel_files(), {jit.kernels_digest()}
    assert len(files) > 5
    for path in files:
        path.write_bytes(path.read_bytes() + b"\n")
        seen.add(jit.kernels_digest())
    (copied_kernels / "firmware" / "core" / "another.py").write_text("")
    seen.add(jit.kernels_digest())
    assert len(seen) == len(files) + 2


def fly(**environment: str) -> np.ndarray:
    done = subprocess.run(
        [sys.executable, "-c", FLIGHT], env=os.environ | environment, capture_output=True, text=True, check=True
    )
    return np.array([[float.fromhex(number) for number in line.split()] for line in done.stdout.splitlines()])


def test_what_no_kernel_calls_is_not_imported():
    """Numba asks for SciPy's BLAS, and what only reads files asks for no compiler."""
    loaded = "import sys; print(*({*sys.modules} & {'scipy.linalg', 'numba'}))"
    for script, there in ((FLIGHT, "numba"), ("import glider.tools.data.sources", "")):
        command = [sys.executable, "-c", f"{script}\n{loaded}"]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        assert done.stdout.splitlines()[-1] == there


def test_compiled_kernels_fly_like_plain_python():
    compiled, plain = fly(GLIDER_JIT="1"), fly(GLIDER_JIT="0")
    assert compiled.shape == (3, 20)
    assert np.array_equal(compiled, plain)  # the same operations in the same order, each rounded


@jit.kernel
def multiply_add(a, b, c):
    return a * b + c


def test_a_product_and_a_sum_are_rounded_each():
    """In one rounding, as a processor's fused multiply-add does, this would be 2^-60 and not 0."""
    assert multiply_add(1.0 + 2.0**-30, 1.0 - 2.0**-30, -1.0) == 0.0


def test_cache_goes_where_it_is_told(tmp_path):
    turn = "from glider.firmware.core.maths.rotations import wrap_angle; wrap_angle(4.0)"
    subprocess.run([sys.executable, "-c", turn], env=os.environ | {"GLIDER_CACHE_DIR": str(tmp_path)}, check=True)
    folders = list(tmp_path.glob(f"kernels-{jit.kernels_digest()}-*"))
    assert len(folders) == 1
    assert list(folders[0].rglob("*.nbi"))
