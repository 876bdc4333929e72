"""Kernels: what a Kalman filter takes from a row of readings, for any kind of vehicle.

n errors of the state, m readings; what was not measured is NaN in d.
"""

import math

from glider.firmware.core.jit import kernel
from glider.firmware.core.maths.matrices import product, transpose
from glider.firmware.core.maths.wide import everywhere, where


@kernel
def take_measurement(H, cov, R, d, HC, HT, S, L, W, K):
    """The update of cov (n, n) by a row of innovations d (m), of which only it is asked what was measured.

    H (m, n), whose rows of what was not measured become 0; R (m) variances; HC, HT, S, L scratch. Out: W (m, m) what
    whitens the innovations, K (n, m) what corrects the state by the whitened ones. Returns log det of their covariance.
    """
    readings, count, seen = len(d), len(cov), 0  # readings from `seen` on were not measured
    # S = H cov H' + R of what was measured, its Cholesky factor L, and W = L^-1; K~ = cov H' L^-T
    for m in range(readings):
        if math.isnan(d[m]):
            H[m, :] = 0.0
        else:
            seen = m + 1
    product(H[:seen], cov, HC)
    transpose(H, HT)
    product(HC[:seen], HT, S)
    for m in range(seen):
        if math.isnan(d[m]):
            S[m, m] = 1.0
        else:
            S[m, m] += R[m]
    for m in range(seen):
        for n in range(m + 1):
            total = S[m, n]
            for k in range(n):
                total -= L[m, k] * L[n, k]
            if m == n:
                L[m, m] = math.sqrt(max(total, 1e-18))
            else:
                L[m, n] = total / L[n, n]
    W[:] = 0.0
    for m in range(seen, readings):
        W[m, m] = 1.0
    for m in range(seen):  # W = L^-1, lower triangular
        W[m, m] = 1.0 / L[m, m]
        for n in range(m):
            total = 0.0
            for k in range(n, m):
                total -= L[m, k] * W[k, n]
            W[m, n] = total / L[m, m]
    for a in range(count):
        K[a, seen:] = 0.0
        for m in range(seen):
            total = 0.0
            for n in range(m + 1):
                total += HC[n, a] * W[m, n]
            K[a, m] = total
    for a in range(count):
        for b in range(a + 1):
            total = 0.5 * (cov[a, b] + cov[b, a])
            for m in range(seen):
                total -= K[a, m] * K[b, m]
            cov[a, b] = total
            cov[b, a] = total
    logarithm = 0.0
    for m in range(seen):
        if not math.isnan(d[m]):
            logarithm += 2.0 * math.log(L[m, m])
    return logarithm


@kernel
def take_gain(W, K, d, error, e):
    """Whiten a row's innovations d (m) by W (m, m) into e (m); what K (n, m) corrects by them into error (n).

    Returns the sum of squares. d is used up, and NaN where nothing was measured: there W is the identity, K is 0.
    """
    total, seen = 0.0, 0  # readings from `seen` on were not measured
    for m in range(len(d)):
        missing = math.isnan(d[m])
        e[m], d[m] = where(missing, math.nan, 0.0), where(missing, 0.0, d[m])
        if not everywhere(missing):
            seen = m + 1
    for m in range(seen - 1, -1, -1):
        missing = math.isnan(e[m])
        if everywhere(missing):
            continue
        value = 0.0
        for n in range(m + 1):
            value += W[m, n] * d[n]
        value = where(missing, 0.0, value)
        e[m], d[m] = where(missing, math.nan, value), value
        total += value * value
    for a in range(len(error)):
        value = 0.0
        for m in range(seen):
            value += K[a, m] * d[m]
        error[a] = value
    return total


@kernel
def take_valid(rows, valid, lost_at, samples):
    """What is `valid` (rows, m) of rows (rows, m), row by row, into samples; beyond lost_at, or no number: lost_at."""
    at = 0
    for i in range(rows.shape[0]):
        for m in range(rows.shape[1]):
            if valid[i, m]:
                value = rows[i, m]
                samples[at] = min(max(value, -lost_at), lost_at) if not math.isnan(value) else lost_at
                at += 1
