"""Explicit Runge-Kutta methods, a stage at a time: the caller works out the derivative, `end_stage` what becomes of it.

A method is a table with a row for each stage: when it is (NODE) and what its derivative weighs (WEIGHT), both as shares
of the step. Each stage starts from x along the derivative of the one before it. With y a copy of x, a step is

    for stage in range(len(RK4)):
        derivative(y, t + RK4[stage][NODE] * dt, k)
        end_stage(RK4, stage, dt, x, k, total, y, n)

The derivative is called by name and not handed over: a kernel that is an argument takes its own arguments in a tuple,
and counting that tuple's references costs a quarter of the step.
Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.1; the limits of stability: II, IV.2.
"""

from glider.firmware.core.jit import inlined_kernel

NODE, WEIGHT = 0, 1
RK4 = ((0.0, 1.0 / 6.0), (0.5, 1.0 / 3.0), (0.5, 1.0 / 3.0), (1.0, 1.0 / 6.0))  # the classical one, order 4
MIDPOINT = ((0.0, 0.0), (0.5, 1.0))  # order 2
RK4_STABLE, MIDPOINT_STABLE = 2.785, 2.0


@inlined_kernel
def stable_product(method):
    """Return the largest product of step and rate of decay at which a decaying motion does not grow.

    |R(-z)| <= 1 up to there, with R(z) = 1 + z + z^2/2 (+ z^3/6 + z^4/24 of RK4).
    """
    return RK4_STABLE if len(method) == len(RK4) else MIDPOINT_STABLE


@inlined_kernel
def end_stage(method, stage, dt, x, k, total, y, n):
    """After stage number `stage`, whose derivative is in k: the next stage's state into y or, after the last, x moved.

    The first n entries of x, k, y and of the scratch `total` are meant.
    """
    weight = method[stage][WEIGHT] * dt
    if stage == 0:
        for i in range(n):
            total[i] = 0.0
    for i in range(n):
        total[i] += weight * k[i]
    if stage + 1 < len(method):
        ahead = method[stage + 1][NODE] * dt
        for i in range(n):
            y[i] = x[i] + ahead * k[i]
    else:
        for i in range(n):
            x[i] += total[i]
