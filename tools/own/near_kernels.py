"""Kernels of a model and of others near it, flown at once: as those of kernels.py, by the first one's derivatives.

Shapes as there; models that are flown.
"""

import numpy as np

from glider.tools.own.kernels import difference, linear_part, normalised, plus, pointer, push_of, read


def follow_near(
    motion, reads, T, U, Y, X, theta, own, S, push, which, ports, kinds, scales, density, angles, parts, gains, linear,
    states,
):  # fmt: skip
    """`follow_run` of a model that gives rates and of others near it (`advance_near`), into states (models, r, n + o).

    Starts X (models, n), theta (models, parameters), S (models, 5, y); which (models, 2): places in U (driven, r, 2, i)
    and push (pushed, r, w) of what drives and pushes each; gains and linear (r, parts, ...): of the first one's filter.
    """
    n_y, n_p, n_o, models, n = Y.shape[1], ports.shape[0], own.shape[1], X.shape[0], X.shape[1]
    at_ports, u, w = gains.shape[1] - 2 * n_p - n_o, np.zeros((models, U.shape[3])), np.zeros((models, push.shape[2]))
    X, theta, a, h = X.copy(), theta.copy(), np.zeros((models, 2 * n_p)), np.zeros(n_y)
    unknown = np.empty((0, n, n))
    nu, lagged, history = np.zeros((models, n_y)), np.zeros((models, n_y)), np.zeros((models, len(T), n_y))
    for row in range(len(T)):
        if row > 0:
            dt = T[row] - T[row - 1]
            for k in range(models):
                u[k] = U[which[k, 0], row - 1, 0]
                push_of(push[which[k, 1], row - 1], ports, a[k], w[k])
            known = linear[row] if row < len(linear) else unknown
            X = advance_near(motion, X, u, w, theta, own, dt, parts, kinds, scales, density, known)
            for k in range(n_p):
                decay = np.exp(-dt / ports[k, 2])
                c, s = decay * np.cos(ports[k, 1] * dt), decay * np.sin(ports[k, 1] * dt)
                for j in range(models):
                    a0, a1 = a[j, 2 * k], a[j, 2 * k + 1]
                    a[j, 2 * k], a[j, 2 * k + 1] = c * a0 + s * a1, c * a1 - s * a0
        for k in range(models):
            reads(pointer(h), pointer(X[k]), pointer(U[which[k, 0], row, 1]), pointer(theta[k]))
            difference(Y[row], read(h, T[row], row, T, lagged[k], history[k], angles, S[k]), angles, nu[k])
            for j in range(n_y):
                if np.isnan(nu[k, j]):
                    nu[k, j] = 0.0
        moved = nu @ gains[row].T
        for k in range(models):
            X[k] = normalised(plus(X[k], moved[k, :at_ports], kinds), kinds)
            for j in range(2 * n_p):
                a[k, j] += moved[k, at_ports + j]
            for j in range(n_o):
                theta[k, int(own[0, j])] += moved[k, at_ports + 2 * n_p + j]
                states[k, row, n + j] = theta[k, int(own[0, j])]
            states[k, row, :n] = X[k]


def fly_near(
    motion, reads, T, U, starts, ends, X, theta, own, S, push, which, kinds, scales, density, angles, parts, out
):
    """`fly_run` of a model that gives rates and of others near it (`advance_near`), from X (models, windows, n + o),
    into out (models, r, y); the others as in `follow_near`."""
    n_y, models, n = out.shape[2], X.shape[0], X.shape[2] - own.shape[1]
    theta, h = theta.copy(), np.zeros(n_y)
    u, w, unknown = np.zeros((models, U.shape[3])), np.zeros((models, push.shape[2])), np.empty((0, n, n))
    for window in range(len(starts)):
        first, end = starts[window], ends[window]
        x, when = X[:, window, :n].copy(), T[first:end]
        for k in range(models):
            for j in range(own.shape[1]):
                theta[k, int(own[0, j])] = X[k, window, n + j]
        lagged, history = np.zeros((models, n_y)), np.zeros((models, end - first, n_y))
        for row in range(first, end):
            if row > first:
                for k in range(models):
                    u[k], w[k] = U[which[k, 0], row - 1, 0], push[which[k, 1], row - 1]
                dt = T[row] - T[row - 1]
                x = advance_near(motion, x, u, w, theta, own, dt, parts, kinds, scales, density, unknown)
            for k in range(models):
                reads(pointer(h), pointer(x[k]), pointer(U[which[k, 0], row, 1]), pointer(theta[k]))
                out[k, row] = read(h, T[row], row - first, when, lagged[k], history[k], angles, S[k])
                out[k, row] += S[k, 2] * (T[first] - T[0])


def advance_near(motion, X, u, w, theta, own, dt, parts, kinds, scales, density, known):
    """States (models, n) after dt of a model, which comes first, and of others near it; each has its u, w and theta.

    The first is advanced by Runge and Kutta's steps. The others' distances d from it follow d' = J d + s, with the
    first's J midway through a part, and s by which their rates differ from its there: of noises and of a run's own
    parameters to first order, of other numbers as they are. known (parts, ...): the first's `linear_part` of each, or
    empty.
    """
    models, n, n_w, n_o, h = X.shape[0], X.shape[1], w.shape[1], own.shape[1], dt / parts
    g, one, along = np.empty(n), np.eye(n), np.empty((n, n + n_w + n_o + 3))
    driven, numbers, w0 = np.zeros(models, dtype=np.bool_), theta.copy(), w[0].copy()
    beside = np.zeros((models, n_w + n_o))
    beside[:, :n_w] = w - w[0]
    for j in range(n_o):
        place = int(own[0, j])
        beside[:, n_w + j], numbers[:, place] = theta[:, place] - theta[0, place], theta[0, place]
    for k in range(1, models):
        driven[k] = differ(u[k], u[0]) or differ(numbers[k], theta[0])
    for part in range(parts):
        if len(known) > 0:
            along[:, :] = known[part]
        else:
            linear_part(motion, X[0].copy(), u[0], w0, theta[0], h, own, kinds, scales, density, along)
        M, middle, f, x1 = along[:, :n].copy(), along[:, -3].copy(), along[:, -2].copy(), along[:, -1].copy()
        pushed = beside @ along[:, n:-3].copy().T
        for k in range(1, models):
            if driven[k]:
                motion(pointer(g), pointer(middle), pointer(u[k]), pointer(w0), pointer(numbers[k]), h)
                for j in range(n):
                    pushed[k, j] += h * (g[j] - f[j])
        by = one + M @ (one + M @ (one + M / 4.0) / 3.0) / 2.0
        d = X - X[0]
        X = x1 + d + (d @ M.T + pushed) @ by.T
    for k in range(models):
        normalised(X[k], kinds)
    return X


def differ(a, b):
    """Whether two vectors do."""
    found = False
    for j in range(len(a)):
        found = found or a[j] != b[j]
    return found
