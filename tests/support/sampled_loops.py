"""Frequency responses of loops with discrete-time controllers in many digits, from open-loop responses."""

import mpmath
import numpy as np

DIGITS = 80


def response(plant, law, rate, delay, w, beside="1e-25"):
    """Return the response of x' = A x + B w, y = C x with u = K y by Tustin's rule from the first outputs to the first
    inputs, and the sensitivity from sample to sample.

    G_w + G_u H (1 - K G_z)^-1 K G_w, taken at w (1 + ``beside``): next to poles, which cancel in so many digits.
    """
    with mpmath.workdps(DIGITS):
        mp = mpmath
        a, b, c = (mp.matrix(np.asarray(m, dtype=float).tolist()) for m in plant)
        n, u = a.rows, len(law.C)
        y = len(law.B.T)
        h, w = 1 / mp.mpf(rate), mp.mpf(w) * (1 + mp.mpf(beside))
        z, bu, cy = mp.exp(1j * w * h), b[:, :u], c[:y, :]
        periods = int(mp.floor(mp.mpf(delay) / h + mp.mpf("1e-12")))
        rest = max(mp.mpf(delay) - periods * h, mp.mpf(0))

        def held(time):
            block = mp.zeros(n + u)
            block[:n, :n], block[:n, n:] = a * time, bu * time
            whole = mp.expm(block)
            return whole[:n, :n], whole[:n, n:]

        (first, before), (last, after) = held(rest), held(h - rest)
        g_z = cy * ((z * mp.eye(n) - last * first) ** -1) * (last * before / z + after) / z**periods
        s = 2 / h * (z - 1) / (z + 1)
        k = mp.matrix(law.D.tolist())
        if len(law.A):
            k += mp.matrix(law.C.tolist()) * ((s * mp.eye(len(law.A)) - mp.matrix(law.A.tolist())) ** -1) * mp.matrix(
                law.B.tolist())  # fmt: skip
        g = c * ((1j * w * mp.eye(n) - a) ** -1) * b
        hold = (1 - mp.exp(-1j * w * h)) / (1j * w * h) * mp.exp(-1j * w * mp.mpf(delay))
        forces = (mp.eye(u) - k * g_z) ** -1 * k * g[:y, :]
        value = g + g[:, :u] * forces * hold
        s_z = (mp.eye(u) - k * g_z) ** -1
        return tuple(np.array(m.tolist(), dtype=complex) for m in (value, s_z))


def step_response(plant, law, rate, samples):
    """Return the first state of x' = A x + B_u K y + B_w, y = C x, from rest at some samples.

    By powers of the equations from sample to sample. ``plant``: A, B_u, C, B_w; ``law``: with one state, by Tustin's
    rule.
    """
    with mpmath.workdps(DIGITS):
        mp = mpmath
        a, b, c, w = (mp.matrix(np.asarray(m, dtype=float).tolist()) for m in plant)
        ak, bk, ck, dk = (mp.matrix(np.asarray(m, dtype=float).tolist()) for m in (law.A, law.B, law.C, law.D))
        n, h, block = a.rows, 1 / mp.mpf(rate), mp.zeros(a.rows + 2)
        block[:n, :n], block[:n, n], block[:n, n + 1] = a * h, b * h, w * h
        whole, pole = mp.expm(block), 1 / (1 - h / 2 * ak[0, 0])
        law_step = pole * (1 + h / 2 * ak[0, 0]), h * pole * bk, ck * pole, dk + h / 2 * ck * pole * bk
        step = mp.zeros(n + 2)  # states, that of the controller, and the constant disturbance
        step[:n, :n] = whole[:n, :n] + whole[:n, n] * law_step[3] * c
        step[:n, n], step[:n, n + 1] = whole[:n, n] * law_step[2][0, 0], whole[:n, n + 1]
        step[n, :n], step[n, n], step[n + 1, n + 1] = law_step[1] * c, law_step[0], mp.mpf(1)
        start = mp.matrix([0] * (n + 1) + [1])
        return np.array([float((step**k * start)[0]) for k in samples])
