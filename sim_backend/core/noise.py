"""Random numbers by counting: value number n of stream s of a seed, computed and not drawn.

The same (seed, stream, counter) gives the same number in any order, on any thread and on any core, so that a flight
can be repeated bit for bit however many fly at once. Mixing: the finaliser of SplitMix64 (Steele, Lea and Flood,
OOPSLA 2014), applied twice; normal deviates by Box and Muller.
"""

import math

import numpy as np

from glider.firmware.core.jit import kernel

_STREAM = np.uint64(0xD1B54A32D192ED03)
_STEP = np.uint64(0x9E3779B97F4A7C15)
_MIX1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX2 = np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, _S11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)
_ONE = np.uint64(1)
_SCALE = 2.0**-53


@kernel
def _mix(z):
    z = (z ^ (z >> _S30)) * _MIX1
    z = (z ^ (z >> _S27)) * _MIX2
    return z ^ (z >> _S31)


@kernel
def uniform(seed, stream, counter):
    """A number in (0, 1); seed is uint64, stream and counter are integers >= 0."""
    key = _mix(seed + np.uint64(stream) * _STREAM)
    bits = _mix(key + (np.uint64(counter) + _ONE) * _STEP)
    return (float(bits >> _S11) + 0.5) * _SCALE


@kernel
def gaussian(seed, stream, counter):
    """A standard normal deviate; seed is uint64, stream and counter are integers >= 0."""
    radius = math.sqrt(-2.0 * math.log(uniform(seed, stream, 2 * counter)))
    return radius * math.cos(2.0 * math.pi * uniform(seed, stream, 2 * counter + 1))
