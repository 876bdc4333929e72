"""A user's functions as the kernels call them: what they answer is written into `out`, NaN where they raise an error.

The functions stand here as names only: compiled.py executes this file beside the user's, compiled by Numba.
"""

# ruff: noqa: F821
# mypy: disable-error-code="name-defined"
import numpy as np


def rates(out, x, u, w, theta, dt):
    """dx/dt into out (n,)."""
    try:
        out[:] = derivative(x, u, w, theta)
    except Exception:
        out[:] = np.nan


def state_after(out, x, u, w, theta, dt):
    """The state after dt into out (n,)."""
    try:
        out[:] = step(x, u, w, theta, dt)
    except Exception:
        out[:] = np.nan


def readings(out, x, u, theta):
    """Outputs into out (y,)."""
    try:
        out[:] = measure(x, u, theta)
    except Exception:
        out[:] = np.nan
