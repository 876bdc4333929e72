"""Products of matrices in kernels. Numba's own needs SciPy, which what flies, and predicts, does without."""

from firmware.core.jit import kernel


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
