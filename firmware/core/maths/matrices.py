"""Copies and products of arrays in kernels: without an array made on the way, which Numba's make, and without SciPy."""

from glider.firmware.core.jit import kernel


@kernel
def copy(values, out):
    """out (n,) = values (n,)."""
    for n in range(len(values)):
        out[n] = values[n]


@kernel
def transpose(A, out):
    """out (m, n) = A (n, m) turned over; more rows of out stay."""
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            out[j, i] = A[i, j]


@kernel
def product(A, B, out):
    """out (n, m) = A (n, k) B (k, m)."""
    for i in range(A.shape[0]):
        for j in range(B.shape[1]):
            out[i, j] = 0.0
        for k in range(B.shape[0]):
            factor = A[i, k]
            if factor != 0.0:
                for j in range(B.shape[1]):
                    out[i, j] += factor * B[k, j]
