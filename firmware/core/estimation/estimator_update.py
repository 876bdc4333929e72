"""The estimator's measurements: gate, update and what happens to what does not fit (see estimator)."""

import math

from glider.firmware.core.jit import kernel
from glider.firmware.core.layouts import estimator_layout as kf
from glider.firmware.core.maths.rotations import wrap_angle
from glider.firmware.core.maths.wide import anywhere, where
from glider.firmware.core.vehicle.actuators import clip
from glider.firmware.core.vehicle.layout import SERVO_MAX, SERVO_MIN, X_ACT, X_DOWN, X_NU, X_QUAT
from glider.firmware.core.vehicle.state import euler_angles, normalise_attitude, quaternion


@kernel
def widen(cov, column, h0, h1, h2, grow):
    """cov += grow h h', h on error[column : column + 3]."""
    for i in range(3):
        a = h0 if i == 0 else (h1 if i == 1 else h2)
        cov[column + i, column] += grow * (a * h0)
        cov[column + i, column + 1] += grow * (a * h1)
        cov[column + i, column + 2] += grow * (a * h2)


@kernel
def out_of_gate(cov, v, column, h0, h1, h2, left, seen, R, jumped):
    """Variance of an innovation that is taken although it is out of the gate: where its quantity has jumped.

    The measured quantity may have jumped: cov + grow h h' is positive definite, and hardly moves anything else.
    """
    h = h0 * h0 + h1 * h1 + h2 * h2
    wanted = (left / kf.GATE) * (left / kf.GATE) - R
    grow = where(jumped, (wanted - seen) / (h * h), 0.0)
    v[column] += grow * h * h0
    v[column + 1] += grow * h * h1
    v[column + 2] += grow * h * h2
    widen(cov, column, h0, h1, h2, grow)
    return where(jumped, wanted, seen) + R


@kernel
def update_scalar(cov, taken, used, m, dx, column, h0, h1, h2, other, innovation, here, R, rejected_for_s, dt):
    """Measurement number m, h . error[column : column + 3] + error[other] = innovation, variance R, into dx and row m
    of `taken`: the covariance is cov less the sum of r r' over the rows r that are `used`, and cov itself waits.

    `here`: whether there is a measurement; `other` is the sensor's bias in E, 0 where the state has none.
    rejected_for_s: how long this sensor has been out of the gate. Returns the innovation in sigma, the new
    `rejected_for_s`, and the rows used now, a bit each.
    """
    v = taken[m]
    bias = 1.0 if other > 0 else 0.0
    for i in range(kf.N_E):
        v[i] = h0 * cov[column, i] + h1 * cov[column + 1, i] + h2 * cov[column + 2, i] + bias * cov[other, i]
    for k in range(m):
        if not used & (1 << k):
            continue
        r = taken[k]
        along = h0 * r[column] + h1 * r[column + 1] + h2 * r[column + 2] + bias * r[other]
        for i in range(kf.N_E):
            v[i] -= along * r[i]
    seen = h0 * v[column] + h1 * v[column + 1] + h2 * v[column + 2] + bias * v[other]
    left = innovation - (h0 * dx[column] + h1 * dx[column + 1] + h2 * dx[column + 2] + bias * dx[other])
    S = seen + R
    score = left / math.sqrt(S)
    fits = abs(score) <= kf.GATE  # false for NaN, which is rejected and never counts as a jump
    out = here & (abs(score) > kf.GATE)
    rejected_for_s = where(here, where(fits, 0.0, rejected_for_s + dt), rejected_for_s)
    take = here & fits
    if anywhere(out):
        jumped = out & (rejected_for_s >= kf.REJECTED_AT_MOST) & (not kf.E_NU <= column < kf.E_ACT)  # not so the gyro
        if anywhere(jumped):
            S = out_of_gate(cov, v, column, h0, h1, h2, left, seen, R, jumped)
            take = take | jumped
            rejected_for_s = where(jumped, 0.0, rejected_for_s)
    if not anywhere(take):
        return score, rejected_for_s, used
    scale = where(take, 1.0 / math.sqrt(S), 0.0)
    step = where(take, left * scale, 0.0)
    for i in range(kf.N_E):
        v[i] *= scale
        dx[i] += v[i] * step
    return score, rejected_for_s, used | (1 << m)


@kernel
def subtract_taken(cov, taken, used):
    """cov less r r' for the rows r of `taken` that are used, three in one go over cov.

    Which three does not hang on which others are used: so it does not on what is measured in other lanes.
    """
    for k in range(0, kf.N_Z, 3):
        if not used & (7 << k):
            continue
        for n in range(k, k + 3):
            if not used & (1 << n):
                for i in range(kf.N_E):
                    taken[n, i] = 0.0
        r0, r1, r2 = taken[k], taken[k + 1], taken[k + 2]
        for i in range(kf.N_E):
            a, b, c, row = r0[i], r1[i], r2[i], cov[i]
            for j in range(i + 1):
                row[j] -= a * r0[j] + b * r1[j] + c * r2[j]
    # one side of the diagonal serves both: rounding might differ
    for i in range(kf.N_E):
        for j in range(i):
            cov[j, i] = cov[i, j]


@kernel
def inject(P, x, dx):
    """Move x by the error state dx; the attitude by the small rotation q * [1, dtheta / 2]."""
    for i in range(3):
        x[i] += dx[kf.E_POS + i]
    a, b, c = 0.5 * dx[kf.E_ATT], 0.5 * dx[kf.E_ATT + 1], 0.5 * dx[kf.E_ATT + 2]
    q0, q1, q2, q3 = quaternion(x)
    x[X_QUAT] = q0 - q1 * a - q2 * b - q3 * c
    x[X_QUAT + 1] = q1 + q0 * a + q2 * c - q3 * b
    x[X_QUAT + 2] = q2 + q0 * b - q1 * c + q3 * a
    x[X_QUAT + 3] = q3 + q0 * c + q1 * b - q2 * a
    normalise_attitude(x)
    for i in range(6):
        x[X_NU + i] += dx[kf.E_NU + i]
    for i in range(kf.E_ERR, kf.N_E):
        x[kf.X_ERR + i - kf.E_ERR] += dx[i]
    for i in range(3):
        x[X_NU + i] = clip(x[X_NU + i], -kf.SPEED_LIMIT, kf.SPEED_LIMIT)
        x[X_NU + 3 + i] = clip(x[X_NU + 3 + i], -kf.RATE_LIMIT, kf.RATE_LIMIT)
        # a draw-wire may read a little beyond the stops, for it has a bias, but no more
        low, high = P[SERVO_MIN + 4 * i], P[SERVO_MAX + 4 * i]
        margin = 0.0 if i == 0 else kf.STOP_MARGIN * (high - low)
        x[X_ACT + i] = clip(x[X_ACT + i] + dx[kf.E_ACT + i], low - margin, high + margin)


@kernel
def estimator_update(P, settings, x, cov, inflation, z, rejected_for_s, scores, dt, work):
    """Take the measurements z (N_Z, NaN = none) into x and cov, one after the other, about the same x.

    dt is the time since the last update; rejected_for_s (N_Z) is kept between calls. scores (N_Z) gets each innovation
    in sigma, NaN where there was no measurement.
    """
    dx, taken, used = work[kf.W_SCRATCH], work[kf.W_K : kf.W_K + kf.N_Z], 0
    for i in range(kf.N_E):
        dx[i] = 0.0
    phi, theta, psi = euler_angles(x)
    sf, cf, st, ct = math.sin(phi), math.cos(phi), math.sin(theta), math.cos(theta)
    for m in range(kf.N_Z):
        here = abs(z[m]) < kf.LARGEST_READING
        scores[m] = math.nan
        if not anywhere(here):
            continue
        axis = m % 3
        column, h0, h1, h2, other = kf.E_NU + 3 + axis, 1.0, 0.0, 0.0, kf.BIAS_OF[m]
        if m <= kf.Z_YAW or m >= kf.Z_MOCAP_ROLL:
            column = kf.E_ATT
            if axis == 1:
                h0, h1, h2, innovation = 0.0, cf, -sf, z[m] - theta
            else:
                here = here & (ct >= kf.COS_PITCH_MIN)
                if not anywhere(here):
                    continue
                if axis == 0:
                    h1, h2, innovation = sf * st / ct, cf * st / ct, wrap_angle(z[m] - phi)
                else:
                    h0, h1, h2, innovation = 0.0, sf / ct, cf / ct, wrap_angle(z[m] - psi)
        elif m <= kf.Z_R:
            innovation = z[m] - x[X_NU + 3 + axis]
        elif m == kf.Z_DEPTH:
            column, innovation = kf.E_POS + 2, z[m] - x[X_DOWN]
        elif m <= kf.Z_BALLAST:
            column, innovation = kf.E_ACT + m - kf.Z_DEPTH, z[m] - x[X_ACT + m - kf.Z_DEPTH]
        else:
            column, innovation = kf.E_POS + axis, z[m] - x[axis]
        if other > 0:
            innovation -= x[kf.X_ERR + other - kf.E_ERR]
        score, rejected_for_s[m], used = update_scalar(
            cov, taken, used, m, dx, column, h0, h1, h2, other, innovation, here, settings[kf.S_R + m],
            rejected_for_s[m], dt,
        )  # fmt: skip
        scores[m] = where(here, score, math.nan)
        out = here & (abs(score) > kf.GATE)
        if column < kf.E_ACT and anywhere(out):
            which = 0 if column < kf.E_ATT else 1
            grown = min(inflation[which] * math.exp(kf.INFLATION_GROWTH * dt), kf.INFLATION_MAX)
            inflation[which] = where(out, grown, inflation[which])
    subtract_taken(cov, taken, used)
    inject(P, x, dx)
