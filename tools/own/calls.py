"""A user's functions as the kernels call them: with pointers; what they answer is written into `out`, NaN where they
raise an error.

The functions, and how many states, inputs, noises, parameters and outputs there are, stand here as names only:
compiled.py executes this file beside the user's, compiled by Numba.
"""

# ruff: noqa: F821
# mypy: disable-error-code="name-defined"
import numpy as np
from numba import carray


def rates(out, x, u, w, theta, dt):
    """dx/dt into out (n,)."""
    rate = carray(out, STATES)
    try:
        rate[:] = derivative(carray(x, STATES), carray(u, INPUTS), carray(w, NOISES), carray(theta, PARAMETERS))
    except Exception:
        rate[:] = np.nan


def state_after(out, x, u, w, theta, dt):
    """The state after dt into out (n,)."""
    after = carray(out, STATES)
    try:
        after[:] = step(carray(x, STATES), carray(u, INPUTS), carray(w, NOISES), carray(theta, PARAMETERS), dt)
    except Exception:
        after[:] = np.nan


def readings(out, x, u, theta):
    """Outputs into out (y,)."""
    y = carray(out, OUTPUTS)
    try:
        y[:] = measure(carray(x, STATES), carray(u, INPUTS), carray(theta, PARAMETERS))
    except Exception:
        y[:] = np.nan
