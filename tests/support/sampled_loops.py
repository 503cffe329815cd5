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
