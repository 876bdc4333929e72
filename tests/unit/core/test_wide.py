"""Wide numbers against plain ones: what is worked out, how exactly, and that nothing goes from lane to lane."""

import math

import numpy as np
import pytest

from glider.firmware.core.jit import allocating_kernel, kernel
from glider.firmware.core.maths.rotations import quaternion_from_euler
from glider.firmware.core.maths.wide import LANES, anywhere, as_wide, everywhere, lane, room, where, with_lane
from glider.firmware.core.vehicle import layout
from glider.firmware.core.vehicle.batch import nominal_batch
from glider.firmware.core.vehicle.flight import nominal_run
from tests.support.model_states import P

LIBRARY = 0.6  # units in the last place by which the C library, which is the measure here, may be wrong itself


@kernel
def functions(a, b, out):
    out[0], out[1], out[2], out[3], out[4] = math.sin(a), math.cos(a), math.atan2(a, b), math.asin(b), math.tan(a)


@allocating_kernel
def operations(a, b, out):
    """Everything else that a wide number can do, once."""
    c = a
    c += b
    c -= 0.5
    c *= 2
    c /= b
    out[0], out[1], out[2] = c, 1 - a * b, -a / 3.0
    out[3], out[4] = min(a, b), max(0.25, a)
    out[5] = where((a > b) & (a != 0.0), a, where((a <= -b) | (b == 1.0), b, 7.0))
    out[6] = abs(a) + math.sqrt(abs(b)) + math.exp(a) + math.tanh(b) + math.log(abs(a) + 1.0)
    out[7] = where(math.isnan(a), 1.0, 0.0) + where(a < b, 2.0, 0.0) + where(a >= b, 4.0, 0.0)
    scratch = room(out, (2, 3))
    scratch[1, :] = out[:3]
    out[8] = scratch[1].copy()[0] + scratch[0, 1]
    out[9] = with_lane(a, 0, 2.0 * lane(a, 0))


@kernel
def of_plain(kind, a, b, out):
    for i in range(len(a)):
        if kind == 0:
            functions(a[i], b[i], out[i])
        else:
            operations(a[i], b[i], out[i])


@kernel
def of_wide(kind, a, b, out):
    """The same on arrays whose last dimension is the lanes'."""
    of_plain(kind, as_wide(a), as_wide(b), as_wide(out))


def both(kind, a, b, count):
    """(numbers, count) by plain kernels and by wide ones."""
    plain, wide = np.zeros((len(a), count)), np.zeros((len(a) // LANES, count, LANES))
    of_plain(kind, a, b, plain)
    of_wide(kind, a.reshape(-1, LANES).copy(), b.reshape(-1, LANES).copy(), wide)
    return plain, np.swapaxes(wide, 1, 2).reshape(len(a), count)


def apart(ours, right):
    """Largest difference in units in the last place."""
    return float(np.max(np.abs(ours - right) / np.spacing(np.abs(right))))


@pytest.mark.parametrize(("size", "bound"), [(0.8, 1.5), (100.0, 1.5), (1e5, 2.5)])
def test_sines_and_arcs_are_as_exact_as_is_said(size, bound):
    rng = np.random.default_rng(3)
    a, b = rng.uniform(-size, size, 8000), rng.uniform(-1.0, 1.0, 8000)
    b[4000:] *= np.logspace(-12, 0, 4000)
    plain, wide = both(0, a, b, 5)
    assert apart(wide[:, 0], plain[:, 0]) < bound + LIBRARY
    assert apart(wide[:, 1], plain[:, 1]) < bound + LIBRARY
    assert apart(wide[:, 2:4], plain[:, 2:4]) < 2.5 + LIBRARY
    if size <= 100.0:
        assert apart(wide[:, 4], plain[:, 4]) < 3.5 + LIBRARY


def test_arcs_on_the_axes():
    axes = [(y, x) for y in (0.0, -0.0, 1.0, -1.0) for x in (0.0, 1.0, -1.0)]
    y, x = (np.array(values) for values in zip(*axes, strict=True))
    plain, wide = both(0, y, x, 5)
    np.testing.assert_array_equal(wide[:, 2:4], plain[:, 2:4])
    np.testing.assert_array_equal(np.signbit(wide[:, 2]), np.signbit(plain[:, 2]))


def test_operations_are_those_of_plain_numbers():
    a = np.array([0.0, 1.0, -1.0, math.nan, 0.3, -2.5, 1e-9, 4.0])
    b = np.array([1.0, 1.0, 0.5, 2.0, -0.3, math.nan, 3.0, -4.0])
    plain, wide = both(1, a, b, 10)
    head = wide.reshape(-1, LANES, 10)[:, 0, 9]
    np.testing.assert_array_equal(head, 2.0 * a[::LANES])  # of the first lane alone
    np.testing.assert_array_equal(wide.reshape(-1, LANES, 10)[:, 1:, 9], a.reshape(-1, LANES)[:, 1:])
    np.testing.assert_allclose(wide[:, :9], plain[:, :9], rtol=1e-15, atol=1e-16)


@kernel
def asked(values):
    condition = as_wide(values)[0] > 0.0
    return anywhere(condition), everywhere(condition)


def test_lanes_are_asked_together():
    values = np.zeros((1, LANES))
    assert asked(values) == (False, False)
    values[0, -1] = 1.0
    assert asked(values) == (True, LANES == 1)
    values[0, :] = 1.0
    assert asked(values) == (True, True)


def fleet(count):
    """Vehicles of their own parameters, commands and water: the second at rest, the third straight down."""
    rng = np.random.default_rng(5)
    Ps, xs = P * rng.uniform(0.9, 1.1, (count, len(P))), np.zeros((count, layout.N_X))
    for x, angles in zip(xs, rng.uniform(-1.5, 1.5, (count, 3)), strict=True):
        x[layout.X_QUAT : layout.X_NU] = quaternion_from_euler(*angles)
    xs[:, layout.X_NU : layout.X_ACT] = rng.normal(scale=0.2, size=(count, 6))
    xs[1, layout.X_NU : layout.X_ACT] = 0.0
    xs[2, layout.X_NU : layout.X_ACT] = (0.0, 0.0, 0.3, 0.0, 0.0, 0.0)
    Ps[3, layout.LIFT_PRINTED] = 1.0
    commands = rng.uniform(-1.0, 1.0, (count, 3)) * (1.5, 0.08, 0.25)  # some beyond their range
    return Ps, xs, commands, rng.normal(scale=0.1, size=(count, 3))


def test_a_batch_flies_as_its_vehicles_do_alone():
    Ps, xs, commands, waters = fleet(11)  # no multiple of the lanes
    alone, work = xs.copy(), np.zeros((3, layout.N_X))
    for vehicle, x in enumerate(alone):
        nominal_run(Ps[vehicle], x, *commands[vehicle], *waters[vehicle], 0.01, 1000, work)
    nominal_batch(Ps, xs, commands, waters, 0.01, 1000)
    np.testing.assert_allclose(xs, alone, rtol=0.0, atol=1e-11)


def test_a_vehicle_flies_alike_whatever_flies_beside_it():
    together, order = fleet(10), np.random.default_rng(6).permutation(10)
    shuffled = tuple(table[order].copy() for table in together)
    nominal_batch(*together, 0.01, 200)
    nominal_batch(*shuffled, 0.01, 200)
    np.testing.assert_array_equal(shuffled[1], together[1][order])


def test_a_lost_vehicle_takes_none_along():
    sound, lost = fleet(8), fleet(8)
    lost[1][5, layout.X_NU] = math.nan
    nominal_batch(*sound, 0.01, 100)
    nominal_batch(*lost, 0.01, 100)
    assert np.isnan(lost[1][5, layout.X_NU : layout.X_ACT]).all()
    others = np.arange(8) != 5
    np.testing.assert_array_equal(lost[1][others], sound[1][others])
