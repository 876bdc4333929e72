"""The observer of a declared model: an extended Kalman filter, followed by kept gains, and flown open loop.

What a model of the user's has to give is handed in: motion(out, x, u, w, theta, dt), which writes the rates of the
states into out (n,), or, where `stepped`, the states after dt; reads(out, x, u, theta), which writes the outputs. So
the kernels are compiled once for all models (compiled.py), or run as plain Python. Jacobians are forward differences
on the manifold of the states.

Shapes: rows of a run r, states n, errors m (a quaternion has three), inputs i, outputs y, noises w; ports: a process
(two states each) that adds to a noise, [noise, omega rad/s, tau s, sigma].
"""

import numpy as np

DIFFERENCE_STEP = 1e-6  # of a state's scale: difference step
CALM, LONGEST_MEMORY = 1e-12, 400  # s: shorter lags and delays are none; rows searched back for a delay


def pointer(array):
    """An array as the model's functions take it: where they are pointers, so is this (compiled.py)."""
    return array


def wrap(angle):
    """An angle within -pi to pi."""
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))


def plus(x, d, kinds):
    """State x (n,) moved by an error d (m,); kinds (n,): 0 vector, 1 angle, 2 first of a quaternion, 3 the others."""
    out = x.copy()
    k = 0
    for j in range(len(x)):
        if kinds[j] <= 1:
            out[j] = x[j] + d[k]
            k += 1
        elif kinds[j] == 2:
            a, b, c = 0.5 * d[k], 0.5 * d[k + 1], 0.5 * d[k + 2]
            s = 1.0 / np.sqrt(1.0 + a * a + b * b + c * c)
            q0, q1, q2, q3 = x[j], x[j + 1], x[j + 2], x[j + 3]
            out[j] = s * (q0 - q1 * a - q2 * b - q3 * c)
            out[j + 1] = s * (q1 + q0 * a + q2 * c - q3 * b)
            out[j + 2] = s * (q2 + q0 * b + q3 * a - q1 * c)
            out[j + 3] = s * (q3 + q0 * c + q1 * b - q2 * a)
            k += 3
    return out


def minus(x, y, kinds, out):
    """The error (m,) that leads from y to x, into out."""
    k = 0
    for j in range(len(x)):
        if kinds[j] == 0:
            out[k] = x[j] - y[j]
            k += 1
        elif kinds[j] == 1:
            out[k] = wrap(x[j] - y[j])
            k += 1
        elif kinds[j] == 2:
            p0, p1, p2, p3 = y[j], y[j + 1], y[j + 2], y[j + 3]
            q0, q1, q2, q3 = x[j], x[j + 1], x[j + 2], x[j + 3]
            w = p0 * q0 + p1 * q1 + p2 * q2 + p3 * q3
            sign = 2.0 / w if abs(w) > 1e-9 else 2.0
            out[k] = sign * (p0 * q1 - p1 * q0 - p2 * q3 + p3 * q2)
            out[k + 1] = sign * (p0 * q2 - p2 * q0 - p3 * q1 + p1 * q3)
            out[k + 2] = sign * (p0 * q3 - p3 * q0 - p1 * q2 + p2 * q1)
            k += 3


def normalised(x, kinds):
    """Quaternions of length 1, in place."""
    for j in range(len(x)):
        if kinds[j] == 2:
            s = np.sqrt(x[j] ** 2 + x[j + 1] ** 2 + x[j + 2] ** 2 + x[j + 3] ** 2)
            if s > 0.0:
                for i in range(4):
                    x[j + i] = x[j + i] / s
    return x


def difference(y, h, angles, out):
    """Outputs less predicted ones, angles wrapped, into out (y,)."""
    for j in range(len(y)):
        out[j] = wrap(y[j] - h[j]) if angles[j] else y[j] - h[j]


def read(h, t, row, T, lagged, history, angles, S):
    """What the sensors make of outputs h (y,): lag, delay, gain, bias, drift, S (5, y); lagged and history kept."""
    out = np.empty(len(h))
    dt = t - T[row - 1] if row > 0 else 0.0
    for j in range(len(h)):
        if S[3, j] > CALM and row > 0:
            step = wrap(h[j] - lagged[j]) if angles[j] else h[j] - lagged[j]
            lagged[j] = lagged[j] + (1.0 - np.exp(-dt / S[3, j])) * step
        else:
            lagged[j] = h[j]
        history[row, j] = lagged[j]
        value = lagged[j]
        if S[4, j] > CALM:
            when = t - S[4, j]
            k = row
            while k > 0 and T[k] > when and row - k < LONGEST_MEMORY:
                k -= 1
            if T[k] > when:
                value = history[k, j]
            elif k < row:
                share = (when - T[k]) / (T[k + 1] - T[k])
                step = history[k + 1, j] - history[k, j]
                value = history[k, j] + share * (wrap(step) if angles[j] else step)
        out[j] = S[0, j] * value + S[1, j] + S[2, j] * (t - T[0])
    return out


def push_of(push, ports, a, w):
    """Noise inputs: the forces in force and what the ports' processes have now, into w (w,)."""
    for j in range(len(push)):
        w[j] = push[j]
    for k in range(ports.shape[0]):
        w[int(ports[k, 0])] += a[2 * k]


def filter_run(
    motion, reads, stepped, T, U, Y, x0, P0, theta, own, S, push, density, R, ports, kinds, scales, angles, parts, keep
):
    """The filter along one run: -2 log likelihood, mean squared innovation, and what following it asks for.

    T (r,) s; U (r, 2, i): inputs from a row to the next, and at it; Y (r, y) with NaN; x0 (n,), its covariance
    P0 (m, m); own (3, o): parameters that are a number of each run, estimated along it: place in theta, 1 sigma,
    difference step; S (5, y) of `read`; push (r, w); density (w,); R (y,) variances; parts: steps in which a row's
    step is taken. Into keep: gains (r, m + 2 ports + o, y), states and own parameters (r, n + o) after each row, and,
    where there is room, the covariance (r, m + 2 ports + o, the same) of their errors and `linear_part` of every part
    (r, parts, n, n + w + o + 3) before it.
    Returns value, squares, samples.
    """
    n_y, n_w, n_p, n_o, n = Y.shape[1], push.shape[1], ports.shape[0], own.shape[1], len(x0)
    m = len(P0)
    full = m + 2 * n_p + n_o
    at_own = m + 2 * n_p
    theta = theta.copy()
    gains, states, covariances, linear = keep
    unkept = np.empty((parts, n, n + n_w + n_o + 3))
    P = np.zeros((full, full))
    P[:m, :m] = P0
    a = np.zeros(2 * n_p)
    for k in range(2 * n_p):
        P[m + k, m + k] = ports[k // 2, 3] ** 2
    for k in range(n_o):
        P[at_own + k, at_own + k] = own[1, k] ** 2
    x, w, d, nu = x0.copy(), np.zeros(n_w), np.zeros(m), np.zeros(n_y)
    h0, moved = np.zeros(n_y), np.zeros(n_y)
    lagged, history = np.zeros(n_y), np.zeros((len(T), n_y))
    F, G, H = np.zeros((full, full)), np.zeros((full, n_w)), np.zeros((n_y, full))
    value, squares, samples = 0.0, 0.0, 0
    for row in range(len(T)):
        if row > 0:
            dt = T[row] - T[row - 1]
            push_of(push[row - 1], ports, a, w)
            F[:, :], G[:, :] = 0.0, 0.0
            by = motion, stepped, dt, parts
            along = linear[row] if row < len(linear) else unkept
            x1 = transition(by, x, U[row - 1, 0], w, theta, kinds, scales, density, own, F, G, along)
            for j in range(n_o):
                F[at_own + j, at_own + j] = 1.0
            for k in range(n_p):
                decay = np.exp(-dt / ports[k, 2])
                c, s = decay * np.cos(ports[k, 1] * dt), decay * np.sin(ports[k, 1] * dt)
                at = m + 2 * k
                for j in range(m):
                    F[j, at] = G[j, int(ports[k, 0])]
                F[at, at], F[at, at + 1], F[at + 1, at], F[at + 1, at + 1] = c, s, -s, c
                a0, a1 = a[2 * k], a[2 * k + 1]
                a[2 * k], a[2 * k + 1] = c * a0 + s * a1, c * a1 - s * a0
            P = F @ P @ F.T
            for j in range(n_w):
                for k in range(m):
                    if G[k, j] != 0.0:
                        for i in range(m):
                            P[k, i] += G[k, j] * G[i, j] * density[j] ** 2 / dt
            for k in range(n_p):
                grown = ports[k, 3] ** 2 * (1.0 - np.exp(-2.0 * dt / ports[k, 2]))
                P[m + 2 * k, m + 2 * k] += grown
                P[m + 2 * k + 1, m + 2 * k + 1] += grown
            x = x1
        reads(pointer(h0), pointer(x), pointer(U[row, 1]), pointer(theta))
        h = read(h0, T[row], row, T, lagged, history, angles, S)
        difference(Y[row], h, angles, nu)
        H[:, :] = 0.0
        for k in range(m):
            d[:] = 0.0
            d[k] = DIFFERENCE_STEP * scales[k]
            x1 = plus(x, d, kinds)
            reads(pointer(moved), pointer(x1), pointer(U[row, 1]), pointer(theta))
            for j in range(n_y):
                step = wrap(moved[j] - h0[j]) if angles[j] else moved[j] - h0[j]
                H[j, k] = S[0, j] * step / (DIFFERENCE_STEP * scales[k])
        for k in range(n_o):
            place = int(own[0, k])
            theta[place] += own[2, k]
            reads(pointer(moved), pointer(x), pointer(U[row, 1]), pointer(theta))
            theta[place] -= own[2, k]
            for j in range(n_y):
                step = wrap(moved[j] - h0[j]) if angles[j] else moved[j] - h0[j]
                H[j, at_own + k] = S[0, j] * step / own[2, k]
        V = np.zeros((n_y, n_y))
        seen = 0
        for j in range(n_y):
            if np.isnan(nu[j]):
                nu[j] = 0.0
                H[j, :] = 0.0
                V[j, j] = 1.0
            else:
                V[j, j] = R[j]
                seen += 1
        across = P @ H.T
        V = V + H @ across
        L = np.linalg.cholesky(V)
        W = np.linalg.inv(L)
        K = across @ (W.T @ W)
        e = W @ nu
        for j in range(n_y):
            value += e[j] ** 2 + 2.0 * np.log(L[j, j])
            squares += e[j] ** 2
        samples += seen
        step_all = K @ nu
        x = normalised(plus(x, step_all[:m], kinds), kinds)
        a = a + step_all[m:at_own]
        for k in range(n_o):
            theta[int(own[0, k])] += step_all[at_own + k]
        P = P - K @ V @ K.T
        P = 0.5 * (P + P.T)
        if row < len(covariances):
            covariances[row] = P
        gains[row] = K
        states[row, :n] = x
        for k in range(n_o):
            states[row, n + k] = theta[int(own[0, k])]
        if not np.isfinite(value) or not np.isfinite(x).all():
            return np.inf, np.inf, samples
    return value, squares, samples


def follow_run(motion, reads, stepped, T, U, Y, x0, theta, own, S, push, ports, kinds, angles, parts, m, gains, states):
    """States and own parameters (r, n + o) of another model by kept gains, into states."""
    n_y, n_w, n_p = Y.shape[1], push.shape[1], ports.shape[0]
    x, w, nu, a, h0 = x0.copy(), np.zeros(n_w), np.zeros(n_y), np.zeros(2 * n_p), np.zeros(n_y)
    lagged, history = np.zeros(n_y), np.zeros((len(T), n_y))
    theta, at_own = theta.copy(), m + 2 * n_p
    for row in range(len(T)):
        if row > 0:
            dt = T[row] - T[row - 1]
            push_of(push[row - 1], ports, a, w)
            x = normalised(advance(motion, stepped, x, U[row - 1, 0], w, theta, dt, parts), kinds)
            for k in range(n_p):
                decay = np.exp(-dt / ports[k, 2])
                c, s = decay * np.cos(ports[k, 1] * dt), decay * np.sin(ports[k, 1] * dt)
                a0, a1 = a[2 * k], a[2 * k + 1]
                a[2 * k], a[2 * k + 1] = c * a0 + s * a1, c * a1 - s * a0
        reads(pointer(h0), pointer(x), pointer(U[row, 1]), pointer(theta))
        h = read(h0, T[row], row, T, lagged, history, angles, S)
        difference(Y[row], h, angles, nu)
        for j in range(n_y):
            if np.isnan(nu[j]):
                nu[j] = 0.0
        moved = gains[row] @ nu
        x = normalised(plus(x, moved[:m], kinds), kinds)
        a = a + moved[m:at_own]
        for k in range(own.shape[1]):
            theta[int(own[0, k])] += moved[at_own + k]
            states[row, len(x) + k] = theta[int(own[0, k])]
        states[row, : len(x)] = x


def fly_run(motion, reads, stepped, T, U, starts, ends, X, theta, own, S, push, kinds, angles, parts, out):
    """Outputs (r, y) of windows flown open loop from states and own parameters X (windows,
    n + o) at rows `starts` to rows `ends`, into out."""
    n_y, n = out.shape[1], X.shape[1] - own.shape[1]
    theta, h = theta.copy(), np.zeros(n_y)
    for k in range(len(starts)):
        x = X[k, :n].copy()
        for j in range(own.shape[1]):
            theta[int(own[0, j])] = X[k, n + j]
        lagged, history = np.zeros(n_y), np.zeros((ends[k] - starts[k], n_y))
        for row in range(starts[k], ends[k]):
            if row > starts[k]:
                dt = T[row] - T[row - 1]
                x = normalised(advance(motion, stepped, x, U[row - 1, 0], push[row - 1], theta, dt, parts), kinds)
            since = row - starts[k]
            reads(pointer(h), pointer(x), pointer(U[row, 1]), pointer(theta))
            when = T[starts[k] : ends[k]]
            out[row] = read(h, T[row], since, when, lagged, history, angles, S)
            out[row] += S[2] * (T[starts[k]] - T[0])


def advance(motion, stepped, x, u, w, theta, dt, parts):
    """The state (n,) after dt, in parts: by the user's steps, or by Runge and Kutta's of the fourth order."""
    n, h, x = len(x), dt / parts, x.copy()
    y = np.empty(n)
    if stepped:
        for _ in range(parts):
            motion(pointer(y), pointer(x), pointer(u), pointer(w), pointer(theta), h)
            x[:] = y
        return x
    rates, rate = np.zeros(n), np.empty(n)
    for _ in range(parts):
        motion(pointer(rate), pointer(x), pointer(u), pointer(w), pointer(theta), h)
        for stage in range(3):
            share = 1.0 if stage == 2 else 0.5
            for j in range(n):
                rates[j] += (1.0 if stage == 0 else 2.0) * rate[j]
                y[j] = x[j] + share * h * rate[j]
            motion(pointer(rate), pointer(y), pointer(u), pointer(w), pointer(theta), h)
        for j in range(n):
            x[j] += h / 6.0 * (rates[j] + rate[j])
            rates[j] = 0.0
    return x


def transition(by, x, u, w, theta, kinds, scales, density, own, F, G, along):
    """The state after dt, and what it has of an error of x, into F[:m, :m], of the noises, into G[:m], and of a run's
    own parameters, into the last columns of F[:m]. by: motion, stepped, dt, parts; along (parts, ...): `linear_part` of
    each, of a model that gives rates."""
    if by[1]:
        return transition_by_steps(by, x, u, w, theta, kinds, scales, density, own, F, G)
    return transition_by_rates(by, x, u, w, theta, kinds, scales, density, own, F, G, along)


def transition_by_steps(by, x, u, w, theta, kinds, scales, density, own, F, G):
    """`transition` by forward differences of the user's step."""
    motion, stepped, dt, parts = by
    m, at_own, d = len(scales), len(F) - own.shape[1], np.zeros(len(scales))
    x1 = normalised(advance(motion, stepped, x, u, w, theta, dt, parts), kinds)
    for j in range(m):
        size = DIFFERENCE_STEP * scales[j]
        d[:] = 0.0
        d[j] = size
        minus(normalised(advance(motion, stepped, plus(x, d, kinds), u, w, theta, dt, parts), kinds), x1, kinds, d)
        F[:m, j] = d / size
    for j in range(len(w)):
        size = DIFFERENCE_STEP * max(density[j], 1e-3)
        w[j] += size
        minus(normalised(advance(motion, stepped, x, u, w, theta, dt, parts), kinds), x1, kinds, d)
        w[j] -= size
        G[:m, j] = d / size
    for j in range(own.shape[1]):
        place = int(own[0, j])
        theta[place] += own[2, j]
        minus(normalised(advance(motion, stepped, x, u, w, theta, dt, parts), kinds), x1, kinds, d)
        theta[place] -= own[2, j]
        F[:m, at_own + j] = d / own[2, j]
    return x1


def of_states(motion, x, f, u, w, theta, h, kinds, scales):
    """h times the derivatives (n, n) of the rates f (n,) at x by the states: forward differences."""
    n, k = len(x), 0
    M, g = np.empty((n, n)), np.empty(n)
    for j in range(n):
        size, usual = DIFFERENCE_STEP * scales[k], x[j]
        x[j] += size
        motion(pointer(g), pointer(x), pointer(u), pointer(w), pointer(theta), h)
        M[:, j] = (g - f) * (h / size)
        x[j] = usual
        if kinds[j] != 2:  # a quaternion has an error less than it has numbers
            k += 1
    return M


def of_noises(motion, x, f, u, w, theta, h, density):
    """The same (n, w) by the noises."""
    M, g = np.empty((len(x), len(w))), np.empty(len(x))
    for j in range(len(w)):
        size, usual = DIFFERENCE_STEP * max(density[j], 1e-3), w[j]
        w[j] += size
        motion(pointer(g), pointer(x), pointer(u), pointer(w), pointer(theta), h)
        M[:, j] = (g - f) * (h / size)
        w[j] = usual
    return M


def of_own(motion, x, f, u, w, theta, h, own):
    """The same (n, o) by a run's own parameters."""
    M, g = np.empty((len(x), own.shape[1])), np.empty(len(x))
    for j in range(own.shape[1]):
        place = int(own[0, j])
        usual = theta[place]
        theta[place] += own[2, j]
        motion(pointer(g), pointer(x), pointer(u), pointer(w), pointer(theta), h)
        M[:, j] = (g - f) * (h / own[2, j])
        theta[place] = usual
    return M


def linear_part(motion, x, u, w, theta, h, own, kinds, scales, density, out):
    """A part h of a step from x (n,), linear as it is midway, into out (n, n + w + o + 3): h times the derivatives of
    the rates there by states, noises and a run's own parameters; the state there, its rates, and the state after."""
    n, n_w, f = len(x), len(w), np.empty(len(x))
    x1 = advance(motion, False, x, u, w, theta, h, 1)
    middle = 0.5 * (x + x1)
    motion(pointer(f), pointer(middle), pointer(u), pointer(w), pointer(theta), h)
    out[:, :n] = of_states(motion, middle, f, u, w, theta, h, kinds, scales)
    out[:, n : n + n_w] = of_noises(motion, middle, f, u, w, theta, h, density)
    out[:, n + n_w : -3] = of_own(motion, middle, f, u, w, theta, h, own)
    out[:, -3], out[:, -2], out[:, -1] = middle, f, x1


def transition_by_rates(by, x, u, w, theta, kinds, scales, density, own, F, G, along):
    """`transition` by the user's derivative: what Runge and Kutta's step makes of the system, linear as it is midway
    through a part, 1 + M + M^2 / 2 + M^3 / 6 + M^4 / 24, by forward differences there, part by part."""
    motion, _, dt, parts = by
    n, m, n_w, n_o, h = len(x), len(scales), len(w), own.shape[1], dt / parts
    of_all = n + n_w + n_o
    E, one, x1 = np.eye(of_all), np.eye(of_all), x
    for part in range(parts):
        linear_part(motion, x1, u, w, theta, h, own, kinds, scales, density, along[part])
        M = np.zeros((of_all, of_all))
        M[:n], x1 = along[part, :, :of_all], along[part, :, -1].copy()
        E = (one + M @ (one + M @ (one + M @ (one + M / 4.0) / 3.0) / 2.0)) @ E
    x1 = normalised(x1, kinds)
    later, d = E[:n, :n].copy(), np.zeros(m)
    for j in range(m):
        size = DIFFERENCE_STEP * scales[j]
        d[:] = 0.0
        d[j] = size
        minus(normalised(x1 + later @ (plus(x, d, kinds) - x), kinds), x1, kinds, d)
        F[:m, j] = d / size
    for j in range(n_w + n_o):
        minus(normalised(x1 + DIFFERENCE_STEP * E[:n, n + j], kinds), x1, kinds, d)
        if j < n_w:
            G[:m, j] = d / DIFFERENCE_STEP
        else:
            F[:m, len(F) - n_o + j - n_w] = d / DIFFERENCE_STEP
    return x1
