"""Wide numbers for kernels: what wide_type makes of them, and sin, cos, tan, atan2, asin as sums without a branch.

Within 1.5 units in the last place for sin and cos of angles up to 100 rad (2.5 up to 1e5 rad), 3.5 for tan up to
100 rad, 2.5 for atan2 and asin of finite numbers; the C library's, which plain numbers have, within 1. exp, tanh and
log of a wide number are the C library's, lane by lane.
"""

import math

from numba.extending import overload

from glider.firmware.core.jit import inlined_kernel
from glider.firmware.core.maths.wide_type import (
    LANES,
    WIDE,
    anywhere,
    as_wide,
    everywhere,
    is_wide,
    lane,
    lanes,
    room,
    spread,
    where,
    with_lane,
)

__all__ = ["LANES", "anywhere", "as_wide", "everywhere", "lane", "lanes", "room", "spread", "where", "with_lane"]

_TURN = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21)  # pi / 2, 33 bits, 33 bits, the rest
_WHOLE = 6755399441055744.0  # 1.5 2^52: a number that it was added to and taken off again is whole
# Taylor's: what is left out is below 1e-19 of sin and 3e-18 of cos up to pi/4
_SIN = tuple((-1.0) ** n / math.factorial(2 * n + 1) for n in range(1, 9))
_COS = tuple((-1.0) ** n / math.factorial(2 * n) for n in range(2, 9))
# of (atan(t)/t - 1)/t^2 in t^2, through its values at the 11 Chebyshev nodes of 0 .. tan^2(pi/8): within 7e-18
_ATAN = (
    -0.3333333333333333, 0.1999999999999552, -0.14285714284666542, 0.11111111015256361, -0.09090904578123903,
    0.07692183190826087, -0.06664511447381948, 0.0585814891280221, -0.0508544973794026, 0.03923165829558719,
    -0.01917688711906226,
)  # fmt: skip
_TAN_EIGHTH = math.tan(math.pi / 8.0)


@inlined_kernel
def _polynomial(coefficients, z):
    """coefficients[0] + coefficients[1] z + ..."""
    value = coefficients[-1] + 0.0 * z
    for n in range(len(coefficients) - 2, -1, -1):
        value = value * z + coefficients[n]
    return value


@inlined_kernel
def sine_cosine(angle):
    """sin and cos of an angle, rad: by quarter turns to within pi/4, where the series are short."""
    turns = (angle * (2.0 / math.pi) + _WHOLE) - _WHOLE
    r = ((angle - turns * _TURN[0]) - turns * _TURN[1]) - turns * _TURN[2]
    z = r * r
    sine, cosine = r + r * z * _polynomial(_SIN, z), 1.0 - (0.5 * z - z * z * _polynomial(_COS, z))
    half = 0.5 * turns  # quarter turns of an odd number swap the two
    swapped = (half + _WHOLE) - _WHOLE != half
    # half turns gone by, of sin and of cos, which is a quarter ahead; those of an odd number change the sign
    gone, gone_of_cos = (half - 0.25 + _WHOLE) - _WHOLE, (half + 0.25 + _WHOLE) - _WHOLE
    return (
        where(swapped, cosine, sine) * _sign_after(gone),
        where(swapped, sine, cosine) * _sign_after(gone_of_cos),
    )  # fmt: skip


@inlined_kernel
def tangent(angle):
    """tan of an angle, rad."""
    sine, cosine = sine_cosine(angle)
    return sine / cosine


@inlined_kernel
def _sign_after(half_turns):
    """-1 after half turns of an odd number, else 1."""
    pairs = 0.5 * half_turns
    return 1.0 - 4.0 * abs(pairs - ((pairs + _WHOLE) - _WHOLE))


@inlined_kernel
def arc(y, x):
    """atan2(y, x) of finite numbers, rad; where x is a zero of either sign, as of 0.0."""
    ax, ay = abs(x), abs(y)
    steep = ay > ax
    small, big = where(steep, ax, ay), where(steep, ay, ax)
    beyond = small > _TAN_EIGHTH * big  # an eighth of a turn less, by tan(a - pi/4) = (tan a - 1) / (tan a + 1)
    t = where(beyond, small - big, small) / where(big == 0.0, 1.0, where(beyond, small + big, big))
    z = t * t
    angle = where(beyond, 0.25 * math.pi, 0.0) + (t + t * z * _polynomial(_ATAN, z))
    angle = where(steep, 0.5 * math.pi - angle, angle)
    return math.copysign(where(x < 0.0, math.pi - angle, angle), y)


@overload(math.sin)
def _sin(x):
    return (lambda x: sine_cosine(x)[0]) if x == WIDE else None


@overload(math.cos)
def _cos(x):
    return (lambda x: sine_cosine(x)[1]) if x == WIDE else None


@overload(math.tan)
def _tan(x):
    return (lambda x: tangent(x)) if x == WIDE else None


@overload(math.atan2)
def _atan2(y, x):
    return (lambda y, x: arc(y, x)) if is_wide(y, x) else None


@overload(math.asin)
def _asin(x):
    return (lambda x: arc(x, math.sqrt((1.0 - x) * (1.0 + x)))) if x == WIDE else None


def _lane_by_lane(function):
    """The C library's function for each lane."""

    @overload(function)
    def wide_function(x):
        if x != WIDE:
            return None

        def each(x):
            for number in range(lanes(x)):
                x = with_lane(x, number, function(lane(x, number)))
            return x

        return each


for _function in (math.exp, math.tanh, math.log):
    _lane_by_lane(_function)
